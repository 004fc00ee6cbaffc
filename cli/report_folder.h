// Folders of results as lobefit writes them, read back for a page.
#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "fit/fit.h"
#include "reference/json_reader.h"
#include "report/html_report.h"

namespace lobefit {

bool is_there(const std::filesystem::path& path);

/// Tables of a folder by what they hold, each read once.
class FolderTables {
 public:
  explicit FolderTables(std::filesystem::path folder) : folder_(std::move(folder)) {}
  /// Null if the folder has none of this SHA-256. Throws Error(invalid_input) for a file that is no table.
  std::shared_ptr<const Table> find(const std::string& sha256);

 private:
  std::filesystem::path folder_;
  std::map<std::string, std::filesystem::path> paths_;  // by SHA-256
  std::map<std::string, std::shared_ptr<const Table>> tables_;
  bool listed_ = false;
};

/// Figures of a folder, as far as a page has room.
class FolderFigures {
 public:
  explicit FolderFigures(std::filesystem::path folder) : folder_(std::move(folder)) {}
  /// Adds STEM.svg or STEM.png, the smaller, if there is one.
  void add(const std::string& stem, std::vector<HtmlFigure>& figures);
  /// One remark on what had no room, if any.
  void add_remark(std::vector<std::string>& remarks) const;

 private:
  std::filesystem::path folder_;
  std::size_t bytes_ = 0;
  std::vector<std::string> left_out_;
};

/// STEM.LANGUAGE of every shader language that the folder has.
std::vector<HtmlShader> folder_shaders(const std::filesystem::path& folder, const std::string& stem);

/// A fit's file with the table that it was made on; nothing if the folder lacks the file. Throws Error(invalid_input).
struct FolderFit {
  std::filesystem::path path;
  Json document;
  Fit fit;
  std::string table_sha256;
};
std::optional<FolderFit> folder_fit(const std::filesystem::path& path);

/// Every fit of a folder. Throws Error(invalid_input) for JSON that is broken, whatever it was to be.
std::vector<std::filesystem::path> folder_fits(const std::filesystem::path& folder);

/// Pages of more fits have their shaders in GLSL alone, which the spheres need, and neither slices nor references.
inline constexpr std::size_t most_complete_fits = 8;

/// A fit as a row of a page. `with_table`: against its data, where they lie as the fit found them or in its folder;
/// throws Error(invalid_input) if they give another error than the fit's file.
HtmlRow fit_row(const std::string& name, const FolderFit& found, bool with_table, bool all_languages,
                const std::string& command, std::vector<std::string>& remarks);
/// How sure a fit is: its descent, its starts, its correlation matrix. `label` tells several of one row apart.
void add_fit_quality(const Fit& fit, const std::string& label, HtmlRow& row);
/// The same by a result's own "correlation" and "history", as far as it has them; `parameters` has the names.
void add_fit_quality(const JsonReader& result, const JsonReader& parameters, const std::string& label, HtmlRow& row);

/// "a, b"
std::string joined(const std::vector<std::string>& names);
std::vector<std::string> texts(const JsonReader& list);
/// Every member of a result's "provenance".
void add_provenance(const JsonReader& provenance, HtmlReport& report);
/// rms of a model's values from a table over a row's "domain", in its metric and with its weights.
double domain_rms(const JsonReader& domain, const Table& table, const std::vector<float>& values);
/// Whether a sphere shows what the model is.
bool is_opaque_surface(const Model& model);
/// Title, conclusion, provenance: what all results have in common.
HtmlReport report_head(const JsonReader& result);

/// Of `refit` with recipes of constants: tables, fits and shaders in the folder are used where they are.
HtmlReport constants_report(const std::filesystem::path& folder, const JsonReader& result);
/// Of `refit` with recipes of closed forms.
HtmlReport forms_report(const std::filesystem::path& folder, const JsonReader& result);
/// Of `refit` with recipes of curves: every reference and albedo against each model.
HtmlReport curves_report(const std::filesystem::path& folder, const JsonReader& result);
/// Of `refit substrate-rules`: constants, held-out pairs, and what each shipped tree costs.
HtmlReport substrate_report(const std::filesystem::path& folder, const JsonReader& result);
/// Of `slab validate`, by its validation.json.
HtmlReport slab_report(const std::filesystem::path& folder, const JsonReader& validation);
/// Of single fits.
HtmlReport fits_report(const std::vector<std::filesystem::path>& fits, const std::string& command);
/// Of `fit` over several materials, by its summary.json.
HtmlReport materials_report(const std::filesystem::path& folder, const JsonReader& summary, const std::string& command);

}  // namespace lobefit
