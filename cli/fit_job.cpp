#include "cli/fit_job.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "reference/json_reader.h"
#include "reference/output_file.h"
#include "report/material_figure.h"

namespace lobefit {

namespace {

/// Pictures of both, one parameter row; none where one of them has no values between its entries.
std::vector<SphereImage> sphere_pair(const BrdfPair& pair) {
  if (!pair.truth || !pair.other || pair.table->parameter_rows() > 1 || no_hemisphere(*pair.table)) return {};
  const auto first_row = [](const RowBrdf& brdf) -> SphereBrdf {
    return [&brdf](const Direction& wi, const Direction& wo) { return brdf(0, wi, wo); };
  };
  const std::array<SphereBrdf, 2> brdfs{first_row(pair.truth), first_row(pair.other)};
  return render_spheres(brdfs, Lighting::three_lights(), {.size = 160, .antialiasing = 2, .isotropic = pair.isotropic});
}

}  // namespace

std::string FitSource::name() const {
  return material.empty() ? std::filesystem::path(path).stem().string() : material;
}

FitTable read_fit_table(const FitSource& source, const std::string& grid, const std::string& weights) {
  return fit_table(read_brdf_file(source.path, {.material = source.material}), grid, weights);
}

FitProvenance fit_provenance(const std::string& path) {
  const Json json = parse_json(read_file(path), path);
  const JsonReader reader(json, path);
  FitProvenance result;
  if (reader.has("solver")) {
    const JsonReader solver = reader.at("solver");
    if (solver.has("metric")) result.metric = solver.at("metric").text();
    if (solver.has("weights")) {
      for (const JsonReader& weight : solver.at("weights").elements())
        result.weights += (result.weights.empty() ? "" : ",") + weight.text();
      if (result.weights.empty()) result.weights = "uniform";
    }
  }
  if (reader.has("provenance")) {
    const JsonReader provenance = reader.at("provenance");
    if (provenance.has("grid")) result.grid = provenance.at("grid").text();
    if (provenance.has("material")) result.material = provenance.at("material").text();
    if (provenance.has("table")) result.table = provenance.at("table").text();
    if (provenance.has("table_sha256")) result.table_sha256 = provenance.at("table_sha256").text();
  }
  try {
    parse_quantity(result.metric);
    if (!result.weights.empty()) parse_weights(result.weights);
  } catch (const Error& error) {
    throw error.inside(ExitCode::invalid_input, path + ", $.solver");
  }
  return result;
}

FitJob run_fit(const FitJobSettings& settings, const FitSource& source, const Context& context, Monitor& monitor) {
  const FitTable taken = read_fit_table(source, settings.grid, settings.weights);
  const Table& table = taken.file.table;
  TableFit result = fit_as_set(settings, taken, context.seed, monitor);
  FitJob job{.fit = std::move(result.fit), .tiers = std::move(result.tiers), .grid = taken.grid};
  job.document = job.fit.json(context.command, sha256_of_file(source.path));
  job.document["provenance"]["table"] = source.path;
  if (!source.material.empty()) job.document["provenance"]["material"] = source.material;
  job.document["provenance"]["grid"] = job.grid;
  if (!job.tiers.empty()) job.document["tiers"] = tiers_json(job.tiers);
  const TableModel on_table(*settings.model, job.fit.values(), table, job.fit.mappings);
  const Table fitted = on_table.render();
  job.report = metrics_report(model_pair(taken.file, on_table, fitted.values), {.sphere_size = settings.sphere});
  job.document["report"] = job.report.json(table);
  if (settings.figure) {
    const auto rms = std::ranges::find(job.fit.metrics, settings.metric, &FitMetric::name);
    job.figure = material_figure(table, fitted.values, sphere_pair(model_pair(taken.file, on_table, fitted.values)),
                                 source.name() + " and " + job.fit.model,
                                 fmt::format("points: {}; lines: fit, rms {} {:.4g}",
                                             taken.dense ? "measured" : "table", settings.metric, rms->value));
  }
  return job;
}

}  // namespace lobefit
