// lobefit report: a folder of results as one HTML page.
#include <fmt/format.h>

#include <iostream>

#include "cli/arguments.h"
#include "cli/report_folder.h"
#include "reference/output_file.h"

namespace lobefit {

namespace {

namespace fs = std::filesystem;

/// By what the result holds; results of all recipes have rows.
HtmlReport refit_report(const fs::path& folder, const JsonReader& result) {
  const std::vector<JsonReader> rows = result.at("rows").elements();
  if (rows.empty()) throw result.at("rows").error("the list is empty", "run the recipe again");
  if (rows.front().has("formula")) return forms_report(folder, result);
  if (result.has("curves")) return curves_report(folder, result);
  if (result.has("trees")) return substrate_report(folder, result);
  if (result.has("published") && rows.front().has("domain")) return constants_report(folder, result);
  throw result.error("no page is made of results of this kind", "run the recipe again, or see its result.md");
}

HtmlReport folder_report(const fs::path& folder, const std::string& command) {
  std::error_code ignored;
  if (!fs::is_directory(folder, ignored)) {
    throw Error(ExitCode::invalid_input, "no such folder", folder.string(),
                "name a folder of results, such as out/proxima");
  }
  const fs::path result = folder / "result.json", summary = folder / "summary.json",
                 validation = folder / "validation.json";
  if (is_there(result)) {
    const Json json = parse_json(read_file(result), result.string());
    return refit_report(folder, JsonReader(json, result.string()));
  }
  if (is_there(summary)) {
    const Json json = parse_json(read_file(summary), summary.string());
    return materials_report(folder, JsonReader(json, summary.string()), command);
  }
  if (is_there(validation)) {
    const Json json = parse_json(read_file(validation), validation.string());
    return slab_report(folder, JsonReader(json, validation.string()));
  }
  const std::vector<fs::path> fits = folder_fits(folder);
  if (!fits.empty()) return fits_report(fits, command);
  throw Error(ExitCode::invalid_input, "neither result.json, summary.json, validation.json nor a fit is there",
              folder.string(), "name a folder that `lobefit refit`, `lobefit fit` or `lobefit slab validate` wrote");
}

}  // namespace

void add_report(CLI::App& app, Context& context) {
  CLI::App* verb =
      app.add_subcommand("report",
                         "One self-contained HTML page of a folder of results\n"
                         "  lobefit report out/proxima\n"
                         "  lobefit report out/fresnel -o fresnel.html\n"
                         "The page opens from a file and asks no network. Of refits (result.json), of fits to several\n"
                         "materials (summary.json), of single fits (any .json of `lobefit fit`), of `slab validate`\n"
                         "(validation.json). What the folder lacks, tables for the slices or shaders for the spheres,\n"
                         "is named on the page and here, and left out.");
  struct Arguments {
    std::string folder, output;
  };
  const auto a = std::make_shared<Arguments>();
  verb->add_option("DIR", a->folder, "Folder of results")->required();
  verb->add_option("-o,--output", a->output, "Page to write (default: DIR/report.html)");
  verb->callback([&context, a] {
    const fs::path folder = a->folder;
    const fs::path output = a->output.empty() ? folder / "report.html" : fs::path(a->output);
    const HtmlReport report = folder_report(folder, context.command);
    const std::string page = html_report(report);
    OutputFile file(output, context.force);
    file.write(page);
    file.commit();
    for (const std::string& remark : report.remarks) context.say(remark);
    if (context.json) {
      std::cout << Json{{"file", output.string()}, {"bytes", page.size()}, {"remarks", report.remarks}}.dump(2) << "\n";
    } else {
      fmt::print("{} ({:.2f} MB)\n", output.string(), static_cast<double>(page.size()) / 1e6);
    }
  });
}

}  // namespace lobefit
