#include "cli/report_folder.h"

#include <algorithm>

#include "evaluate/shader.h"
#include "reference/metric.h"
#include "reference/output_file.h"

namespace lobefit {

namespace fs = std::filesystem;

namespace {

/// Bytes of figures on a page, as their files have them.
constexpr std::size_t most_figure_bytes = 1'000'000;

}  // namespace

bool is_there(const fs::path& path) {
  std::error_code ignored;
  return fs::is_regular_file(path, ignored);
}

std::shared_ptr<const Table> FolderTables::find(const std::string& sha256) {
  if (!std::exchange(listed_, true)) {
    for (const auto& file : fs::directory_iterator(folder_)) {
      if (file.path().extension() == ".exr") paths_.emplace(sha256_of_file(file.path()), file.path());
    }
  }
  const auto path = paths_.find(sha256);
  if (path == paths_.end()) return nullptr;
  std::shared_ptr<const Table>& table = tables_[sha256];
  if (!table) table = std::make_shared<const Table>(Table::read(path->second));
  return table;
}

void FolderFigures::add(const std::string& stem, std::vector<HtmlFigure>& figures) {
  std::optional<HtmlFigure> smallest;
  for (const auto& [extension, type] : {std::pair(".svg", "image/svg+xml"), std::pair(".png", "image/png")}) {
    const fs::path path = folder_ / (stem + extension);
    if (!is_there(path)) continue;
    HtmlFigure figure{.title = stem, .media_type = type, .content = read_file(path)};
    if (!smallest || figure.content.size() < smallest->content.size()) smallest = std::move(figure);
  }
  if (!smallest) return;
  if (bytes_ + smallest->content.size() > most_figure_bytes) {
    left_out_.push_back(stem);
    return;
  }
  bytes_ += smallest->content.size();
  figures.push_back(std::move(*smallest));
}

void FolderFigures::add_remark(std::vector<std::string>& remarks) const {
  if (left_out_.empty()) return;
  remarks.push_back("To keep the page small, it leaves out the figures " + joined(left_out_) +
                    "; they lie in the folder.");
}

std::vector<HtmlShader> folder_shaders(const fs::path& folder, const std::string& stem) {
  std::vector<HtmlShader> shaders;
  for (const std::string& language : shader_languages()) {
    const fs::path path = folder / (stem + "." + language);
    if (is_there(path)) shaders.push_back({language, read_file(path)});
  }
  return shaders;
}

std::optional<FolderFit> folder_fit(const fs::path& path) {
  if (!is_there(path)) return std::nullopt;
  Json json = parse_json(read_file(path), path.string());
  Fit fit = Fit::from_json(json, path.string());
  std::string sha256 = JsonReader(json, path.string()).at("provenance").at("table_sha256").text();
  return FolderFit{path, std::move(json), std::move(fit), std::move(sha256)};
}

std::string joined(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
  return text;
}

std::vector<std::string> texts(const JsonReader& list) {
  std::vector<std::string> result;
  for (const JsonReader& element : list.elements()) result.push_back(element.text());
  return result;
}

void add_provenance(const JsonReader& provenance, HtmlReport& report) {
  for (const auto& [name, member] : provenance.members())
    report.provenance.emplace_back(name, member.value().is_string() ? member.text() : member.value().dump());
}

double domain_rms(const JsonReader& domain, const Table& table, const std::vector<float>& values) {
  const Quantity quantity = parse_quantity(domain.at("metric").text());
  std::string weights;
  for (const std::string& name : texts(domain.at("weights"))) weights += (weights.empty() ? "" : ",") + name;
  return rms_difference(table, values, quantity,
                        entry_weights(table, parse_weights(weights.empty() ? "uniform" : weights), quantity));
}

bool is_opaque_surface(const Model& model) { return model.info->kind == ModelKind::brdf && !model.info->transmits; }

HtmlReport report_head(const JsonReader& result) {
  const JsonReader provenance = result.at("provenance");
  // Results of older versions state neither title nor description.
  HtmlReport report{.title = result.has("title") ? result.at("title").text() : result.at("recipe").text(),
                    .description = result.has("description") ? result.at("description").text() : "",
                    .conclusion = result.at("conclusion").text(),
                    .command = provenance.at("command").text()};
  add_provenance(provenance, report);
  if (result.has("checks")) {
    // Of constants the check stands beside what it is of; of forms the two are one.
    const std::vector<JsonReader> checks = result.at("checks").elements();
    const auto passed = std::ranges::count_if(checks, [](const JsonReader& check) {
      return (check.has("check") ? check.at("check") : check).at("passed").boolean();
    });
    report.provenance.emplace_back("float against double",
                                   std::to_string(passed) + " of " + std::to_string(checks.size()) + " checks passed");
  }
  return report;
}

}  // namespace lobefit
