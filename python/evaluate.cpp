// Models and references at arrays of directions.
#include <tbb/parallel_for.h>

#include <algorithm>

#include "evaluate/description.h"
#include "evaluate/float_model.h"
#include "python/arrays.h"
#include "python/interruptible.h"
#include "python/module.h"
#include "reference/albedo.h"
#include "reference/references.h"
#include "report/shader_text.h"

namespace lobefit::python {

namespace {

constexpr std::size_t block_size = 512;  // pairs; their directions and values stay in the nearest cache
/// So many pairs are over before anybody would stop them: a million take milliseconds in float.
template <class Number>
constexpr std::size_t short_work = std::is_same_v<Number, float> ? 1 << 22 : 1 << 16;

/// Flat parameters, of which some differ from pair to pair.
class PairParameters {
 public:
  /// `varying` are (n, components) arrays by name.
  PairParameters(const Model& model, const py::dict& constant, const py::dict& varying) : values_(model.defaults()) {
    set_parameters(values_, constant);
    for (const auto& [key, value] : varying) add(py::str(key).cast<std::string>(), py::cast<Rows>(value));
  }

  std::vector<double> flat() const { return {values_.flat().begin(), values_.flat().end()}; }
  /// How many pairs from `first` on, `most` at most, have the same parameters.
  std::size_t run(std::size_t first, std::size_t most) const {
    if (varying_.empty()) return most;
    std::size_t length = 1;
    while (length < most && same(first, first + length)) ++length;
    return length;
  }
  void set(std::size_t pair, std::vector<double>& flat) const {
    for (const Varying& v : varying_) std::copy_n(v.data + pair * v.components, v.components, flat.data() + v.offset);
  }

 private:
  using Rows = py::array_t<double, py::array::c_style | py::array::forcecast>;
  struct Varying {
    Rows keep;
    const double* data;
    std::size_t offset, components;
  };

  void add(const std::string& name, Rows rows) {
    const ParameterInfo& info = values_.info(name);
    if (!info.choices.empty())
      throw Error(ExitCode::usage, "a choice is the same for all pairs", name, "give one name");
    const auto components = static_cast<std::size_t>(info.components);
    const std::span<const double> all(rows.data(), static_cast<std::size_t>(rows.size()));
    const auto outside = std::ranges::find_if(all, [&](double x) { return !(x >= info.lower && x <= info.upper); });
    ParameterValues(values_).set(name, outside == all.end() ? info.initial : *outside);  // throws what it throws of one
    varying_.push_back({rows, rows.data(), static_cast<std::size_t>(info.offset), components});
  }
  bool same(std::size_t a, std::size_t b) const {
    return std::ranges::all_of(varying_, [&](const Varying& v) {
      return std::equal(v.data + a * v.components, v.data + (a + 1) * v.components, v.data + b * v.components);
    });
  }

  ParameterValues values_;
  std::vector<Varying> varying_;
};

/// Pairs first, …, first + n - 1 to n × 3 numbers: in double.
void evaluate_block(const Model& model, const PairParameters& parameters, const Directions& wi, const Directions& wo,
                    std::size_t first, std::size_t n, double* out) {
  thread_local std::vector<Direction> lights(block_size), views(block_size);
  thread_local std::vector<Rgb> values(block_size);
  const std::span<Direction> light(lights.data(), n), view(views.data(), n);
  wi.read(first, light);
  wo.read(first, view);
  std::vector<double> flat = parameters.flat();
  for (std::size_t begin = 0; begin < n;) {
    const std::size_t run = parameters.run(first + begin, n - begin);
    parameters.set(first + begin, flat);
    model.evaluate_all(flat, light.subspan(begin, run), view.subspan(begin, run),
                       std::span(values).subspan(begin, run));
    begin += run;
  }
  std::memcpy(out, values.data(), n * sizeof(Rgb));
}

/// By the vectorised float batch.
void evaluate_block(const FloatModel& model, const PairParameters& parameters, const Directions& wi,
                    const Directions& wo, std::size_t first, std::size_t n, float* out) {
  thread_local FloatPairs pairs(block_size);
  thread_local FloatRgb values(block_size);
  const auto all = [n](std::vector<float>& component) { return std::span(component).first(n); };
  wi.read(first, all(pairs.wi_x), all(pairs.wi_y), all(pairs.wi_z));
  wo.read(first, all(pairs.wo_x), all(pairs.wo_y), all(pairs.wo_z));
  std::vector<double> flat = parameters.flat();
  for (std::size_t begin = 0; begin < n;) {
    const std::size_t end = begin + parameters.run(first + begin, n - begin);
    parameters.set(first + begin, flat);
    model.evaluate(std::vector<float>(flat.begin(), flat.end()), pairs, begin, end, values);
    begin = end;
  }
  join_channels(all(values.r), all(values.g), all(values.b), out);
}

/// `model`: a Model for double, a FloatModel for float.
template <class Number, class AnyModel>
py::array evaluate_in(const AnyModel& model, const PairParameters& parameters, const Directions& wi,
                      const Directions& wo) {
  const std::size_t count = wi.size();
  py::array_t<Number> result({count, std::size_t{3}});
  Number* const out = result.mutable_data();
  const auto work = [&](Monitor& monitor) {
    tbb::parallel_for(std::size_t{0}, (count + block_size - 1) / block_size, [&](std::size_t block) {
      monitor.check();
      const std::size_t first = block * block_size, n = std::min(block_size, count - first);
      evaluate_block(model, parameters, wi, wo, first, n, out + 3 * first);
    });
  };
  if (count > short_work<Number>) {
    run_interruptibly(py::none(), work);
  } else {
    const py::gil_scoped_release released;
    Monitor silent;
    work(silent);
  }
  return result;
}

py::array evaluate_model(const std::string& name, const py::array& wi, const py::array& wo, const py::dict& constant,
                         const py::dict& varying, bool single) {
  const Model& model = find_model(name);
  const PairParameters parameters(model, constant, varying);
  const Directions lights(wi, "wi"), views(wo, "wo");
  return single ? evaluate_in<float>(find_float_model(name), parameters, lights, views)
                : evaluate_in<double>(model, parameters, lights, views);
}

std::shared_ptr<const Integrator> make_integrator(const std::string& name, const py::dict& parameters) {
  const Reference& reference = find_reference(name);
  ParameterValues values = reference.defaults();
  set_parameters(values, parameters);
  return reference.make(values);
}

py::array evaluate_reference(const std::string& name, const py::array& wi, const py::array& wo,
                             const py::dict& parameters, const py::object& progress) {
  const auto integrator = make_integrator(name, parameters);
  const Directions lights(wi, "wi"), views(wo, "wo");
  py::array_t<double> result({lights.size(), std::size_t{3}});
  double* const out = result.mutable_data();
  run_interruptibly(progress, [&](Monitor& monitor) {
    monitor.begin("evaluate " + name, lights.size());
    tbb::parallel_for(std::size_t{0}, lights.size(), [&](std::size_t i) {
      monitor.check();
      Direction light, view;
      lights.read(i, {&light, 1});
      views.read(i, {&view, 1});
      const Rgb f = integrator->exact(light, view);
      std::memcpy(out + 3 * i, &f, sizeof(f));
      monitor.advance(1);
    });
  });
  return result;
}

/// Throws Error(usage) unless `theta`, in degrees, is one; `above` the surface: below 90.
void check_polar_angle(double theta, bool above) {
  if (theta >= 0.0 && (above ? theta < 90.0 : theta <= 180.0)) return;
  throw Error(ExitCode::usage, "theta = " + number_text(theta) + " is out of range", "",
              above ? "choose an angle from 0 to below 90 degrees: directions lie above the surface"
                    : "choose an angle from 0 to 180 degrees");
}

/// Values and errors, (angles, 3) each.
py::tuple albedo(const std::function<Rgb(const Direction&, const Direction&)>& brdf, const std::vector<double>& angles,
                 bool fixed_light, AlbedoDomain domain) {
  for (const double theta : angles) check_polar_angle(theta, domain == AlbedoDomain::hemisphere);
  py::array_t<double> value({angles.size(), std::size_t{3}}), error({angles.size(), std::size_t{3}});
  double *const values = value.mutable_data(), *const errors = error.mutable_data();
  run_interruptibly(py::none(), [&](Monitor& monitor) {
    for (std::size_t i = 0; i < angles.size(); ++i) {
      const Albedo found = directional_albedo(
          brdf, radians(angles[i]), fixed_light ? FixedDirection::light : FixedDirection::view, domain, 1e-6, &monitor);
      std::memcpy(values + 3 * i, &found.value, sizeof(Rgb));
      std::memcpy(errors + 3 * i, &found.error, sizeof(Rgb));
    }
  });
  return py::make_tuple(value, error);
}

AlbedoDomain domain_of(bool fibre, bool sphere) {
  return fibre ? AlbedoDomain::fibre : sphere ? AlbedoDomain::sphere : AlbedoDomain::hemisphere;
}

py::tuple albedo_of_model(const std::string& name, const std::vector<double>& angles, const py::dict& parameters,
                          bool fixed_light) {
  const Model& model = find_model(name);
  ParameterValues values = model.defaults();
  set_parameters(values, parameters);
  return albedo([&](const Direction& wi, const Direction& wo) { return model.evaluate(values.flat(), wi, wo); }, angles,
                fixed_light, domain_of(is_hair(model.info->kind), model.info->transmits));
}

py::tuple albedo_of_reference(const std::string& name, const std::vector<double>& angles, const py::dict& parameters,
                              bool fixed_light) {
  const Reference& reference = find_reference(name);
  const auto integrator = make_integrator(name, parameters);
  return albedo([&](const Direction& wi, const Direction& wo) { return integrator->exact(wi, wo); }, angles,
                fixed_light, domain_of(reference.fibre, reference.sphere));
}

py::array directions(const py::array_t<double, py::array::c_style>& theta,
                     const py::array_t<double, py::array::c_style>& phi) {
  const auto count = static_cast<std::size_t>(theta.size());
  py::array_t<double> result({count, std::size_t{3}});
  for (std::size_t i = 0; i < count; ++i) {
    check_polar_angle(theta.data()[i], false);
    if (!std::isfinite(phi.data()[i]))
      throw Error(ExitCode::usage, "phi is not finite", "directions", "give angles in degrees");
    const Direction w = direction(radians(theta.data()[i]), radians(phi.data()[i]));
    std::memcpy(result.mutable_data() + 3 * i, &w, sizeof(w));
  }
  return result;
}

std::string shader(const std::string& name, const std::string& language, const py::dict& parameters) {
  const Model& model = find_model(name);
  ParameterValues values = model.defaults();
  set_parameters(values, parameters);
  return shader_text(model, values, nullptr, language, "lobefit.shader", "");
}

}  // namespace

void add_evaluation(py::module_& module) {
  module.def("model_names", [] {
    std::vector<std::string> names;
    for (const Model& model : models()) names.emplace_back(model.info->name);
    return names;
  });
  module.def("reference_names", [] {
    std::vector<std::string> names;
    for (const Reference& reference : references()) names.emplace_back(reference.name);
    return names;
  });
  module.def("describe_model", [](const std::string& name) { return to_python(model_json(find_model(name))); });
  module.def("describe_reference",
             [](const std::string& name) { return to_python(reference_json(find_reference(name))); });
  module.def("evaluate_model", &evaluate_model);
  module.def("evaluate_reference", &evaluate_reference);
  module.def("albedo_of_model", &albedo_of_model);
  module.def("albedo_of_reference", &albedo_of_reference);
  module.def("directions", &directions);
  module.def("shader", &shader);
}

}  // namespace lobefit::python
