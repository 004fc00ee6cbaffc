// Tables: read, made of arrays, rendered, looked into, compared, written.
#include <tbb/parallel_for.h>

#include <limits>
#include <optional>

#include "fit/fit.h"
#include "python/arrays.h"
#include "python/interruptible.h"
#include "python/module.h"
#include "reference/json_reader.h"
#include "reference/output_file.h"
#include "reference/render.h"
#include "reference/table_row.h"
#include "report/table_comparison.h"

namespace lobefit::python {

namespace {

using FloatArray = py::array_t<float, py::array::c_style | py::array::forcecast>;
using ByteArray = py::array_t<std::uint8_t, py::array::c_style | py::array::forcecast>;

std::vector<std::size_t> axis_sizes(const Table& table) {
  std::vector<std::size_t> sizes;
  for (const Axis& axis : table.parameter_axes) sizes.push_back(axis.size());
  for (const Axis* axis : {&table.grid.theta_o, &table.grid.theta_i, &table.grid.phi}) sizes.push_back(axis->size());
  return sizes;
}

/// A read-only view of a table's plane, which keeps the table alive: axes as they are, channels last.
template <class Number>
py::array view(const py::object& owner, const Table& table, const std::vector<Number>& plane,
               std::optional<std::size_t> channels) {
  std::vector<std::size_t> shape = axis_sizes(table), strides(shape.size());
  std::size_t stride = sizeof(Number);
  for (std::size_t i = shape.size(); i-- > 0; stride *= shape[i]) strides[i] = stride;
  if (channels) {
    shape.push_back(*channels);
    strides.push_back(stride);
  }
  py::array result(py::dtype::of<Number>(), shape, strides, plane.data(), owner);
  result.attr("setflags")(py::arg("write") = false);
  return result;
}

const Table& table_of(const py::object& file) { return file.cast<const BrdfFile&>().table; }

py::dict describe(const BrdfFile& file) {
  Json description = file.table.describe();
  description["format"] = file_format_names[static_cast<std::size_t>(file.format)];
  return to_python(description);
}

py::tuple entry_directions(const BrdfFile& file) {
  const Table& table = file.table;
  py::array_t<double> lights({table.entries(), std::size_t{3}}), views({table.entries(), std::size_t{3}});
  for (std::size_t entry = 0; entry < table.entries(); ++entry) {
    const Direction wi = table.wi(entry), wo = table.wo(entry);
    std::memcpy(lights.mutable_data() + 3 * entry, &wi, sizeof(wi));
    std::memcpy(views.mutable_data() + 3 * entry, &wo, sizeof(wo));
  }
  return py::make_tuple(lights, views);
}

std::size_t row_of(const Table& table, const py::dict& at) {
  std::vector<AxisValue> wanted;
  for (const auto& [axis, value] : at) wanted.push_back({py::str(axis).cast<std::string>(), value.cast<double>()});
  return find_row(table, wanted);
}

py::array evaluate(const BrdfFile& file, const py::array& wi, const py::array& wo, const py::dict& at) {
  const std::size_t row = row_of(file.table, at);
  const Directions lights(wi, "wi"), views(wo, "wo");
  py::array_t<double> result({lights.size(), std::size_t{3}});
  double* const out = result.mutable_data();
  run_interruptibly(py::none(), [&](Monitor& monitor) {
    const RowBrdf brdf = row_brdf(file);
    tbb::parallel_for(std::size_t{0}, lights.size(), [&](std::size_t i) {
      monitor.check();
      Direction light, view;
      lights.read(i, {&light, 1});
      views.read(i, {&view, 1});
      constexpr double nothing = std::numeric_limits<double>::quiet_NaN();
      const Rgb f = (brdf ? brdf(row, light, view) : std::nullopt).value_or(Rgb{nothing, nothing, nothing});
      std::memcpy(out + 3 * i, &f, sizeof(f));
    });
  });
  return result;
}

void write(const BrdfFile& file, const std::string& path, bool overwrite) {
  const FileFormat format = format_of_extension(path);
  OutputFile output(path, overwrite);
  write_brdf_file(file, format, output.temporary());
  output.commit();
}

py::dict report(const TableComparison& comparison, const std::string& weights, int sphere) {
  const Table& table = comparison.table();
  const std::vector<WeightFactor> factors = parse_weights(weights);
  Json result;
  run_interruptibly(py::none(), [&](Monitor&) {
    const MetricsReport metrics = metrics_report(comparison.pair(), {.sphere_size = sphere});
    for (std::size_t q = 0; q < quantity_names.size(); ++q) {
      const auto quantity = static_cast<Quantity>(q);
      result["metrics"][std::string(quantity_names[q])] =
          factors.empty()
              ? metrics.brdf.rms[q].uniform
              : rms_difference(table, comparison.values(), quantity, entry_weights(table, factors, quantity));
    }
    result["report"] = metrics.json(table);
  });
  return to_python(result);
}

/// `fit`: the JSON text of a fit of the model, whose values and mappings are taken; else "".
py::dict compare_model(const BrdfFile& file, const std::string& name, const std::string& fit,
                       const py::dict& parameters, const std::vector<std::string>& mappings, const std::string& weights,
                       int sphere) {
  const Model& model = find_model(name);
  ParameterValues values;
  std::vector<AxisMapping> all;
  if (fit.empty()) {
    values = with_table_parameters(model.defaults(), file.table);
  } else {
    const Fit fitted = Fit::from_json(parse_json(fit, "fit"), "fit");
    values = fitted.values();
    all = fitted.mappings;
  }
  set_parameters(values, parameters);
  for (const std::string& text : mappings) all.push_back(AxisMapping::parse(text));
  return report(TableComparison(file, model, values, all), weights, sphere);
}

py::dict compare_file(const BrdfFile& file, const BrdfFile& other, const std::string& weights, int sphere) {
  return report(TableComparison(file, other, "other"), weights, sphere);
}

Grid grid_of(const py::object& grid, bool sphere) {
  if (py::isinstance<py::str>(grid)) return Grid::named_or_file(grid.cast<std::string>(), sphere);
  const auto text = py::module_::import("json").attr("dumps")(grid).cast<std::string>();
  return Grid::from_json(parse_json(text, "grid"), "grid", sphere);
}

RenderOptions render_options(const py::dict& options) {
  RenderOptions result{.exact = options["exact"].cast<bool>(),
                       .orders = options["orders"].cast<bool>(),
                       .shared_facets = options["facets"].cast<std::string>() == "shared"};
  SamplingOptions& sampling = result.sampling;
  sampling.seed = counting_number(options["seed"], "seed");
  sampling.samples = counting_number(options["samples"], "samples");
  sampling.sampler = options["sampler"].cast<std::string>() == "sobol" ? Sampler::sobol : Sampler::philox;
  if (!(sampling.samples >= replicate_count && sampling.samples <= most_samples)) {
    throw Error(ExitCode::usage, "samples are out of range", "render",
                "choose from " + std::to_string(replicate_count) + " to " + std::to_string(most_samples));
  }
  if (!options["stderr"].is_none()) {
    sampling.stderr_target = options["stderr"].cast<double>();
    if (!(sampling.stderr_target > 0.0 && std::isfinite(sampling.stderr_target)))
      throw Error(ExitCode::usage, "the target must be a positive number", "stderr", "choose one such as 1e-4");
    sampling.samples = 1u << 10;
  }
  return result;
}

BrdfFile render_table(const std::string& name, const py::object& grid_name, const py::dict& parameters,
                      const py::dict& axis_values, const py::dict& options, const std::string& command,
                      const py::object& progress) {
  const Reference* const reference = find_reference_or_null(name);
  const Model* const model = reference ? nullptr : &find_model(name);
  const Grid grid = grid_of(grid_name, reference ? reference->sphere : is_hair(model->info->kind));
  ParameterValues values = reference ? reference->defaults() : model->defaults();
  set_parameters(values, parameters);
  std::vector<Axis> axes;
  for (const auto& [axis, list] : axis_values)
    axes.push_back({py::str(axis).cast<std::string>(), "", list.cast<std::vector<double>>(), false});
  const RenderOptions sampled = render_options(options);
  BrdfFile file;
  run_interruptibly(progress, [&](Monitor& monitor) {
    file.table = reference ? render(*reference, values, axes, grid, sampled, monitor)
                           : render(*model, values, axes, grid, monitor);
  });
  file.table.command = command;
  return file;
}

/// Values and errors, [entry][channel] in Python, [channel][entry] here.
void fill(Table& table, const FloatArray& values, const py::object& errors, const py::object& valid) {
  const auto channels = static_cast<std::size_t>(table.channels), count = table.entries();
  const auto transpose = [&](const FloatArray& from, std::vector<float>& to) {
    for (std::size_t i = 0; i < count * channels; ++i) to[i % channels * count + i / channels] = from.data()[i];
  };
  transpose(values, table.values);
  if (!errors.is_none()) transpose(errors.cast<FloatArray>(), table.stderr_values);
  if (!valid.is_none()) {
    const auto mask = valid.cast<ByteArray>();
    for (std::size_t i = 0; i < count; ++i) table.valid[i] = mask.data()[i] != 0 && table.valid[i] != 0 ? 1 : 0;
  }
  table.model = "measured";
  table.method = "measured";
  table.version = LOBEFIT_VERSION;
  table.mask_what_is_not_finite(0, count);
}

BrdfFile table_of_grid(const py::object& grid, int channels, const FloatArray& values, const py::object& errors,
                       const py::object& valid) {
  BrdfFile file;
  Table& table = file.table;
  table.grid = grid_of(grid, false);
  table.channels = channels;
  table.allocate();
  table.parameters = Json{{"format", "array"}};
  fill(table, values, errors, valid);
  return file;
}

BrdfFile table_of_directions(const py::array& wi, const py::array& wo, bool isotropic, int channels,
                             const FloatArray& values, const py::object& errors, const py::object& valid) {
  const Directions lights(wi, "wi"), views(wo, "wo");
  BrdfFile file;
  Table& table = file.table;
  table.coordinates = Coordinates::list;
  table.grid = {
      .theta_i = {"block", "", {0.0}, false}, .theta_o = {"file", "", {0.0}, false}, .phi = {"sample", "", {}, false}};
  for (std::size_t k = 0; k < lights.size(); ++k) table.grid.phi.values.push_back(static_cast<double>(k));
  table.channels = channels;
  table.allocate();
  for (std::size_t entry = 0; entry < table.entries(); ++entry) {
    Direction light, view;
    lights.read(entry, {&light, 1});
    views.read(entry, {&view, 1});
    table.set_directions(entry, light, view);
    table.valid[entry] = light.z > 0.0 && view.z > 0.0 ? 1 : 0;
    // Nothing says what an entry stands for: all alike.
    table.measure[entry] = static_cast<float>(measured_sine(light) * measured_sine(view));
  }
  table.parameters = Json{{"format", "array"}, {"isotropic", isotropic}};
  fill(table, values, errors, valid);
  return file;
}

}  // namespace

void add_tables(py::module_& module) {
  py::class_<BrdfFile>(module, "File")
      .def("describe", &describe)
      .def("values",
           [](const py::object& file) {
             const Table& table = table_of(file);
             return view(file, table, table.values, table.channels);
           })
      .def("stderr",
           [](const py::object& file) {
             const Table& table = table_of(file);
             return view(file, table, table.stderr_values, table.channels);
           })
      .def("valid",
           [](const py::object& file) { return view(file, table_of(file), table_of(file).valid, std::nullopt); })
      .def("directions", &entry_directions)
      .def("evaluate", &evaluate)
      .def("row", [](const BrdfFile& file, const py::dict& at) { return file.row_slice(row_of(file.table, at)); })
      .def("compare_model", &compare_model)
      .def("compare_file", &compare_file)
      .def("write", &write);
  module.def("read_file", [](const std::string& path, const std::string& material) {
    const py::gil_scoped_release released;
    return read_brdf_file(path, {.material = material});
  });
  module.def("render", &render_table);
  module.def("table_of_grid", &table_of_grid);
  module.def("table_of_directions", &table_of_directions);
}

}  // namespace lobefit::python
