#include "fit/substrate_rules.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <numeric>

#include "fit/dual.h"
#include "reference/output_file.h"
#include "reference/substrate/tree_albedo.h"

namespace lobefit {

namespace {

constexpr int constant_count = 13;
static_assert(sizeof(RuleConstants) == constant_count * sizeof(double));
using RuleDual = Dual<constant_count>;

double value_of(double x) { return x; }
double value_of(const RuleDual& x) { return x.value; }

template <class T>
FittedBlend::Constants<T> constants_from(std::span<const T> x) {
  FittedBlend::Constants<T> constants{};
  std::size_t slot = 0;
  FittedBlend::describe(constants, [&](T& member, const ParameterInfo&) { member = x[slot++]; });
  return constants;
}

template <class T>
Slab::Parameters<T> promoted(const SlabValues& slab) {
  SlabValues from = slab;
  std::vector<double> flat;
  Slab::describe(from, [&](auto& member, const ParameterInfo&) {
    if constexpr (is_vector<std::remove_cvref_t<decltype(member)>>) {
      flat.push_back(member.x), flat.push_back(member.y), flat.push_back(member.z);
    } else {
      flat.push_back(member);
    }
  });
  return unflatten<Slab, T, double>(flat);
}

/// The directions of pair_grid() and a quadrature for bodies, which are smooth.
struct Directions {
  std::vector<Direction> views, lights, body;
  static const Directions& get() {
    static const Directions directions = [] {
      Directions d;
      const Grid grid = pair_grid();
      for (const double theta : grid.theta_o.values) d.views.push_back(direction(radians(theta), 0.0));
      for (const double theta : grid.theta_i.values) {
        for (const double phi : grid.phi.values) d.lights.push_back(direction(radians(theta), radians(phi)));
      }
      constexpr int rings = 8, sectors = 6;  // half the circle: the other half is its mirror image
      for (int i = 0; i < rings; ++i) {
        for (int j = 0; j < sectors; ++j) {
          d.body.push_back(direction(std::acos(std::sqrt((i + 0.5) / rings)), pi * (j + 0.5) / sectors));
        }
      }
      return d;
    }();
    return directions;
  }
};

/// BRDF of an opaque slab. One copy of it: with that many derivatives, inlined everywhere, it compiles for minutes.
template <class T>
[[gnu::noinline]] Vec3<T> opaque_brdf(const Slab::Parameters<T>& slab, const Direction& wi, const Direction& wo) {
  const Geometry<double> geometry = make_geometry(wi, wo);
  switch (choice_number(value_of(slab.diffuse_model), static_cast<int>(slab_diffuse_choices.size()))) {
    case 0: return Slab::Variant<0>::evaluate(slab, geometry);
    case 1: return Slab::Variant<2>::evaluate(slab, geometry);
    default: return Slab::Variant<4>::evaluate(slab, geometry);
  }
}

template <LobeMerge merge, class T>
[[gnu::noinline]] Slab::Parameters<T> layered_slab(const Slab::Parameters<T>& top, const Slab::Parameters<T>& bottom,
                                                   double cos_theta_o, const FittedBlend::Constants<T>& c) {
  return FittedBlend::vertical<merge>(top, bottom, cos_theta_o, c);
}
template <LobeMerge merge, class T>
[[gnu::noinline]] Slab::Parameters<T> mixed_slab(const Slab::Parameters<T>& background,
                                                 const Slab::Parameters<T>& foreground, const T& mix,
                                                 double cos_theta_o, const FittedBlend::Constants<T>& c) {
  return FittedBlend::horizontal<merge>(background, foreground, mix, cos_theta_o, c);
}

/// What a mix looks like: the mix of both. [view][light]
std::vector<Rgb> mix_truth(const SlabValues& background, const SlabValues& foreground, double mix) {
  std::vector<Rgb> truth;
  const Directions& directions = Directions::get();
  for (const Direction& wo : directions.views) {
    for (const Direction& wi : directions.lights) {
      truth.push_back(lerp(opaque_brdf<double>(background, wi, wo), opaque_brdf<double>(foreground, wi, wo), mix));
    }
  }
  return truth;
}

/// Directional albedo of an opaque slab: the interface by its table, the body by quadrature.
template <class T>
Vec3<T> slab_albedo(const Slab::Parameters<T>& slab, const Direction& wo) {
  Slab::Parameters<T> body = slab;
  body.f0 = {T(0.0), T(0.0), T(0.0)};
  body.fuzz_amount = T(0.0);
  Vec3<T> sum{T(0.0), T(0.0), T(0.0)};
  const Directions& directions = Directions::get();
  for (const Direction& wi : directions.body) sum = sum + opaque_brdf<T>(body, wi, wo);
  const Vec3<T> specular = Slab::specular_albedo(slab, wo.z);
  return specular + sum * (pi / static_cast<double>(directions.body.size())) * (1.0 - specular);
}

/// Pseudo-Huber as a residual: its square grows like |x| beyond the scale.
template <class T>
T bent(const T& x) {
  constexpr double scale = 0.1;
  const T ratio = x / scale;
  const T magnitude = scale * sqrt(2.0 * (sqrt(1.0 + ratio * ratio) - 1.0) + 1e-24);
  return value_of(x) < 0.0 ? T(-magnitude) : magnitude;
}

constexpr double log_scale = 20.0;

/// Everything of one problem: which entries of which pair count, their truth and weight.
class RuleProblem {
 public:
  RuleProblem(const RulePairs& pairs, const RuleFitOptions& options) : pairs_(pairs), options_(options) {
    const Directions& directions = Directions::get();
    const std::size_t views = directions.views.size(), lights = directions.lights.size();
    for (std::size_t i = 0; i < pairs.layers.size(); ++i) {
      first_.push_back(count_);
      count_ += variants * 3 * (views + (uses_brdf(pairs.layers[i]) ? views * lights : 0));
    }
    for (const MixedPair& pair : pairs.mixes) {
      first_.push_back(count_);
      count_ += variants * 3 * views * lights;
      mix_truths_.push_back(mix_truth(prepared(pair.background), prepared(pair.foreground), pair.mix));
    }
    first_.push_back(count_);
  }

  std::size_t residual_count() const { return count_; }
  std::size_t pair_count() const { return first_.size() - 1; }
  std::size_t first(std::size_t pair) const { return first_[pair]; }

  template <class T>
  void residuals(std::size_t pair, const FittedBlend::Constants<T>& c, T* out) const {
    if (pair < pairs_.layers.size()) {
      layer_residuals<LobeMerge::mean, T>(pair, c, out);
      layer_residuals<LobeMerge::both, T>(pair, c, out);
    } else {
      mix_residuals<LobeMerge::mean, T>(pair - pairs_.layers.size(), c, out);
      mix_residuals<LobeMerge::both, T>(pair - pairs_.layers.size(), c, out);
    }
  }

 private:
  static constexpr std::size_t variants = 2;  // one lobe, two lobes

  static bool uses_brdf(const LayeredPair& pair) { return !(pair.smooth && pair.conductor); }
  SlabValues prepared(SlabValues slab) const {
    slab.diffuse_model = options_.diffuse_model;
    return slab;
  }

  template <class T>
  static void compare(const Vec3<T>& f, const Rgb& truth, double cosine, double weight, T*& out) {
    const auto one = [&](const T& model, double reference) {
      const T difference = log(1.0 + log_scale * cosine * max(model, 0.0)) -
                           std::log(1.0 + log_scale * cosine * std::max(reference, 0.0));
      *out++ = weight * bent(difference);
    };
    one(f.x, truth.x), one(f.y, truth.y), one(f.z, truth.z);
  }

  template <LobeMerge merge, class T>
  void layer_residuals(std::size_t number, const FittedBlend::Constants<T>& c, T*& out) const {
    const LayeredPair& pair = pairs_.layers[number];
    const Slab::Parameters<T> top = promoted<T>(prepared(pair.top)), bottom = promoted<T>(prepared(pair.bottom));
    std::vector<Slab::Parameters<T>> slabs;
    for (const Direction& wo : Directions::get().views) {
      slabs.push_back(layered_slab<merge, T>(top, bottom, wo.z, c));
    }
    const Directions& directions = Directions::get();
    const std::size_t views = directions.views.size(), lights = directions.lights.size();
    const double weight = std::sqrt((1.0 - options_.brdf_weight) / static_cast<double>(3 * views));
    for (std::size_t v = 0; v < views; ++v) {
      const Vec3<T> albedo = slab_albedo(slabs[v], directions.views[v]);
      const std::size_t entry = number * views + v;
      const auto one = [&](const T& model, float truth) {
        const double reference = std::max(static_cast<double>(truth), 1e-3);
        *out++ = weight * bent(T((model - reference) / reference));
      };
      one(albedo.x, pairs_.albedo.value(entry, 0));
      one(albedo.y, pairs_.albedo.value(entry, 1));
      one(albedo.z, pairs_.albedo.value(entry, 2));
    }
    if (!uses_brdf(pair)) return;
    const double brdf_weight = std::sqrt(options_.brdf_weight / static_cast<double>(3 * views * lights));
    for (std::size_t v = 0; v < views; ++v) {
      for (std::size_t l = 0; l < lights; ++l) {
        const Direction &wi = directions.lights[l], &wo = directions.views[v];
        const Direction half = normalize(wi + wo);
        if (pair.smooth && half.z > 0.99) {  // the truth's mirror image has no place in a table
          out[0] = out[1] = out[2] = T(0.0);
          out += 3;
          continue;
        }
        const std::size_t entry = (number * views + v) * lights + l;
        const Rgb truth{pairs_.brdf.value(entry, 0), pairs_.brdf.value(entry, 1), pairs_.brdf.value(entry, 2)};
        compare(opaque_brdf<T>(slabs[v], wi, wo), truth, wi.z, brdf_weight, out);
      }
    }
  }

  template <LobeMerge merge, class T>
  void mix_residuals(std::size_t number, const FittedBlend::Constants<T>& c, T*& out) const {
    const MixedPair& pair = pairs_.mixes[number];
    const SlabValues background = prepared(pair.background), foreground = prepared(pair.foreground);
    const Slab::Parameters<T> a = promoted<T>(background), b = promoted<T>(foreground);
    const Directions& directions = Directions::get();
    const double weight = std::sqrt(1.0 / static_cast<double>(3 * directions.views.size() * directions.lights.size()));
    auto truth = mix_truths_[number].begin();
    for (const Direction& wo : directions.views) {
      const Slab::Parameters<T> slab = mixed_slab<merge, T>(a, b, T(pair.mix), wo.z, c);
      for (const Direction& wi : directions.lights) {
        compare(opaque_brdf<T>(slab, wi, wo), *truth++, wi.z, weight, out);
      }
    }
  }

  const RulePairs& pairs_;
  RuleFitOptions options_;
  std::vector<std::vector<Rgb>> mix_truths_;
  std::vector<std::size_t> first_;
  std::size_t count_ = 0;
};

bool evaluate_problem(const RuleProblem& problem, std::span<const double> x, std::span<double> residuals,
                      double* jacobian) {
  tbb::parallel_for(std::size_t{0}, problem.pair_count(), [&](std::size_t pair) {
    const std::size_t first = problem.first(pair), count = problem.first(pair + 1) - first;
    if (!jacobian) {
      problem.residuals<double>(pair, constants_from<double>(x), residuals.data() + first);
      return;
    }
    std::vector<RuleDual> variables(x.size()), results(count);
    for (std::size_t k = 0; k < x.size(); ++k) variables[k] = RuleDual::variable(x[k], static_cast<int>(k));
    problem.residuals<RuleDual>(pair, constants_from<RuleDual>(variables), results.data());
    for (std::size_t r = 0; r < count; ++r) {
      residuals[first + r] = results[r].value;
      for (std::size_t k = 0; k < x.size(); ++k) jacobian[(first + r) * x.size() + k] = results[r].derivative[k];
    }
  });
  return std::all_of(residuals.begin(), residuals.end(), [](double r) { return std::isfinite(r); });
}

}  // namespace

RulePairs RulePairs::draw(std::uint64_t seed, std::uint32_t first, std::uint32_t count) {
  RulePairs pairs;
  for (std::uint32_t i = first; i < first + count; ++i) {
    pairs.layers.push_back(LayeredPair::draw(seed, i));
    pairs.mixes.push_back(MixedPair::draw(seed, i));
  }
  return pairs;
}

LeastSquaresSolution fit_rules(const RulePairs& pairs, const RuleFitOptions& options, Monitor& monitor) {
  const RuleProblem problem(pairs, options);
  LeastSquaresProblem least_squares;
  least_squares.residual_count = problem.residual_count();
  RuleConstants initial{};
  FittedBlend::describe(initial, [&](double&, const ParameterInfo& info) {
    least_squares.names.emplace_back(info.name);
    least_squares.start.push_back(info.initial);
    least_squares.lower.push_back(info.lower);
    least_squares.upper.push_back(info.upper);
  });
  least_squares.evaluate = [&](std::span<const double> x, std::span<double> residuals, double* jacobian) {
    monitor.check();
    return evaluate_problem(problem, x, residuals, jacobian);
  };
  // Pairs are drawn independently: the covariance of Jᵀr is the sum of the pairs' own (Jᵀr)(Jᵀr)ᵀ.
  least_squares.gradient_covariance = [&](std::span<const double> x) {
    std::vector<double> residuals(problem.residual_count()), jacobian(residuals.size() * x.size());
    evaluate_problem(problem, x, residuals, jacobian.data());
    std::vector<double> covariance(x.size() * x.size(), 0.0), gradient(x.size());
    for (std::size_t pair = 0; pair < problem.pair_count(); ++pair) {
      std::fill(gradient.begin(), gradient.end(), 0.0);
      for (std::size_t r = problem.first(pair); r < problem.first(pair + 1); ++r) {
        for (std::size_t k = 0; k < x.size(); ++k) gradient[k] += jacobian[r * x.size() + k] * residuals[r];
      }
      for (std::size_t a = 0; a < x.size(); ++a) {
        for (std::size_t b = 0; b < x.size(); ++b) covariance[a * x.size() + b] += gradient[a] * gradient[b];
      }
    }
    return covariance;
  };
  least_squares.maximum_iterations = 60;
  least_squares.tolerance = 1e-7;
  return solve(least_squares, monitor);
}

RuleConstants constants_of(const LeastSquaresSolution& solution) {
  std::vector<double> x;
  for (const FittedVariable& variable : solution.variables) x.push_back(variable.value);
  return constants_from<double>(x);
}

ErrorQuantiles ErrorQuantiles::of(std::vector<double> errors) {
  if (errors.empty()) return {};
  std::sort(errors.begin(), errors.end());
  const auto at = [&](double share) {
    return errors[static_cast<std::size_t>(share * static_cast<double>(errors.size() - 1))];
  };
  return {errors.size(), at(0.5), at(0.9), errors.back()};
}

std::vector<RuleScore> score_rules(const RulePairs& pairs, const RuleConstants& constants,
                                   const RuleFitOptions& options) {
  const Directions& directions = Directions::get();
  const std::size_t views = directions.views.size();
  enum { baseline, tree, fitted, fitted_haze, ways };
  // errors[pair][way]
  std::vector<std::array<std::vector<double>, ways>> errors(pairs.layers.size());
  tbb::parallel_for(std::size_t{0}, pairs.layers.size(), [&](std::size_t i) {
    LayeredPair pair = pairs.layers[i];
    pair.top.diffuse_model = pair.bottom.diffuse_model = options.diffuse_model;
    const std::vector<Closure> closures = walk(pair.tree());
    const SlabValues blended = BaselineBlend::vertical(pair.top, pair.bottom);  // whatever the view
    for (std::size_t v = 0; v < views; ++v) {
      const Direction& wo = directions.views[v];
      const SlabValues slabs[] = {blended,
                                  layered_slab<LobeMerge::mean, double>(pair.top, pair.bottom, wo.z, constants),
                                  layered_slab<LobeMerge::both, double>(pair.top, pair.bottom, wo.z, constants)};
      const Rgb shown[ways] = {slab_albedo(slabs[0], wo), directional_albedo(closures, wo), slab_albedo(slabs[1], wo),
                               slab_albedo(slabs[2], wo)};
      for (int way = 0; way < ways; ++way) {
        const double channels[] = {shown[way].x, shown[way].y, shown[way].z};
        for (int channel = 0; channel < 3; ++channel) {
          const double truth = std::max(static_cast<double>(pairs.albedo.value(i * views + v, channel)), 1e-3);
          errors[i][static_cast<std::size_t>(way)].push_back(std::abs(channels[channel] - truth) / truth);
        }
      }
    }
  });
  std::vector<RuleScore> scores;
  for (const char* bottom : {"diffuse", "conductor"}) {
    for (const char* medium : {"all", "clear+absorbing", "clear", "absorbing", "scattering"}) {
      for (const char* interface : {"all", "smooth", "rough"}) {
        std::array<std::vector<double>, ways> selected;
        for (std::size_t i = 0; i < pairs.layers.size(); ++i) {
          const LayeredPair& pair = pairs.layers[i];
          const std::string name(pair_medium_names[static_cast<std::size_t>(pair.medium)]);
          if (pair.conductor != (std::string(bottom) == "conductor")) continue;
          if (std::string(medium) != "all" && std::string(medium).find(name) == std::string::npos) continue;
          if (std::string(interface) != "all" && pair.smooth != (std::string(interface) == "smooth")) continue;
          for (std::size_t way = 0; way < ways; ++way) {
            selected[way].insert(selected[way].end(), errors[i][way].begin(), errors[i][way].end());
          }
        }
        scores.push_back({bottom, medium, interface, ErrorQuantiles::of(selected[baseline]),
                          ErrorQuantiles::of(selected[tree]), ErrorQuantiles::of(selected[fitted]),
                          ErrorQuantiles::of(selected[fitted_haze])});
      }
    }
  }
  return scores;
}

MixScore score_mixes(const RulePairs& pairs, const RuleConstants& constants, const RuleFitOptions& options) {
  const Directions& directions = Directions::get();
  std::array<std::vector<double>, 3> rms;
  for (const MixedPair& drawn : pairs.mixes) {
    MixedPair pair = drawn;
    pair.background.diffuse_model = pair.foreground.diffuse_model = options.diffuse_model;
    const SlabValues &a = pair.background, &b = pair.foreground;
    const std::vector<Rgb> truths = mix_truth(a, b, pair.mix);
    for (std::size_t way = 0; way < 3; ++way) {
      double sum = 0.0;
      std::size_t count = 0;
      auto truth = truths.begin();
      for (const Direction& wo : directions.views) {
        const SlabValues slab = way == 0   ? BaselineBlend::horizontal(a, b, pair.mix)
                                : way == 1 ? mixed_slab<LobeMerge::mean, double>(a, b, pair.mix, wo.z, constants)
                                           : mixed_slab<LobeMerge::both, double>(a, b, pair.mix, wo.z, constants);
        for (const Direction& wi : directions.lights) {
          const Rgb shown = opaque_brdf<double>(slab, wi, wo);
          const auto add = [&](double model, double reference) {
            const auto value = [&](double f) { return std::log1p(log_scale * wi.z * std::max(f, 0.0)); };
            sum += square(value(model) - value(reference));
            ++count;
          };
          add(shown.x, truth->x), add(shown.y, truth->y), add(shown.z, truth->z);
          ++truth;
        }
      }
      rms[way].push_back(std::sqrt(sum / static_cast<double>(count)));
    }
  }
  return {ErrorQuantiles::of(rms[0]), ErrorQuantiles::of(rms[1]), ErrorQuantiles::of(rms[2])};
}

Json rules_json(const LeastSquaresSolution& solution) {
  Json constants = Json::object();
  std::size_t k = 0;
  RuleConstants described{};
  FittedBlend::describe(described, [&](double&, const ParameterInfo& info) {
    const FittedVariable& variable = solution.variables[k++];
    constants[std::string(info.name)] = {{"symbol", info.symbol},
                                         {"value", variable.value},
                                         {"stderr", variable.standard_error},
                                         {"ci95", {variable.ci_low, variable.ci_high}},
                                         {"at_bound", variable.at_bound},
                                         {"identifiable", variable.identifiable},
                                         {"doc", info.doc}};
  });
  return {{"constants", constants}};
}

RuleConstants read_rules(const std::filesystem::path& path) {
  const Json json = parse_json(read_file(path), path.string());
  const JsonReader reader(json, path.string());
  RuleConstants constants{};
  const JsonReader list = reader.at("constants");
  FittedBlend::describe(constants, [&](double& member, const ParameterInfo& info) {
    const JsonReader entry = list.at(info.name);
    const JsonReader value = entry.value().is_object() ? entry.at("value") : entry;
    member = value.number();
    if (!(member >= info.lower && member <= info.upper)) {
      throw value.error(fmt::format("{} is out of range", member),
                        fmt::format("choose a number from {} to {}", info.lower, info.upper));
    }
  });
  return constants;
}

}  // namespace lobefit
