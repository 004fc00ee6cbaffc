// Fits, as their JSON documents.
#include "fit/fit_settings.h"
#include "python/arrays.h"
#include "python/interruptible.h"
#include "python/module.h"
#include "reference/json_reader.h"
#include "reference/output_file.h"
#include "report/fit_text.h"
#include "report/shader_text.h"

namespace lobefit::python {

namespace {

FitSettings settings_of(const Model& model, const py::dict& given) {
  FitSettings settings{.model = &model};
  const auto take = [&]<class Member>(const char* name, Member& member) {
    try {
      member = given[name].cast<Member>();
    } catch (const py::cast_error&) {
      throw Error(ExitCode::usage, "'" + py::repr(given[name]).cast<std::string>() + "' has the wrong type", name,
                  "see help(lobefit.fit)");
    }
  };
  take("tier", settings.tier);
  take("metric", settings.metric);
  take("weights", settings.weights);
  take("loss", settings.loss);
  take("grid", settings.grid);
  take("intervals", settings.intervals);
  take("free", settings.free);
  take("fix", settings.fix);
  take("bounds", settings.bounds);
  take("map", settings.mappings);
  take("starts", settings.starts);
  take("directions", settings.directions);
  take("holdout", settings.holdout);
  take("prior", settings.prior);
  take("lobes", settings.lobes);
  take("compare_tiers", settings.compare_tiers);
  take("hops", settings.hops);
  if (!given["staged"].is_none()) {
    settings.staged = given["staged"].cast<bool>();
    settings.not_staged = !settings.staged;
  }
  return settings;
}

/// The document and its text for people.
py::tuple fit_table_to(const std::string& name, const BrdfFile& file, const py::dict& given, const py::object& seed,
                       const std::string& command, const std::string& path, const py::object& progress) {
  const FitSettings settings = settings_of(find_model(name), given);
  const std::uint64_t first_seed = counting_number(seed, "seed");
  const std::string sha256 = path.empty() ? "" : sha256_of_file(path);
  TableFit result;
  std::string grid;
  run_interruptibly(progress, [&](Monitor& monitor) {
    const FitTable taken = fit_table(file, settings.grid, settings.weights);
    grid = taken.grid;
    result = fit_as_set(settings, taken, first_seed, monitor);
  });
  Json document = result.fit.json(command, sha256);
  if (!path.empty()) document["provenance"]["table"] = path;
  document["provenance"]["grid"] = grid;
  if (!result.tiers.empty()) document["tiers"] = tiers_json(result.tiers);
  return py::make_tuple(document.dump(2), fit_text(result.fit));
}

/// Parameters of a fit's document, ready for evaluate(): numbers, colours, choices. Throws Error(invalid_input).
py::dict fitted_values(const std::string& text, const std::string& place) {
  const Fit fit = Fit::from_json(parse_json(text, place), place);
  const ParameterValues values = fit.values();
  py::dict result;
  for (const FitParameter& parameter : fit.parameters) {
    const ParameterInfo& info = values.info(parameter.name.substr(0, parameter.name.find('.')));
    const py::str key{std::string(info.name)};
    const std::span<const double> slots = values.components(info);
    if (!info.choices.empty()) {
      result[key] = std::string(values.choice(info.name));
    } else if (slots.size() == 1 || parameter.name == info.name) {
      result[key] = slots[0];
    } else {
      result[key] = py::make_tuple(slots[0], slots[1], slots[2]);
    }
  }
  return result;
}

/// With the intervals of what was fitted.
std::string shader_of_fit(const std::string& text, const std::string& language) {
  const Fit fit = Fit::from_json(parse_json(text, "fit"), "fit");
  return shader_text(find_model(fit.model), fit.values(), &fit, language, "lobefit.Fit.shader", "");
}

}  // namespace

void add_fits(py::module_& module) {
  module.def("fit", &fit_table_to);
  module.def("fitted_values", &fitted_values);
  module.def("shader_of_fit", &shader_of_fit);
  module.def("read_text", [](const std::string& path) { return read_file(path); });
  module.def("write_text", [](const std::string& text, const std::string& path, bool overwrite) {
    OutputFile file(path, overwrite);
    file.write(text);
    file.commit();
  });
}

}  // namespace lobefit::python
