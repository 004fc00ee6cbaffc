// What every reference looks like to those who render, estimate or compare.
#pragma once

#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "models/geometry.h"
#include "models/parameter.h"
#include "reference/sample_points.h"

namespace lobefit {

/// Results for a line of lights: a BRDF each, and what each order of scattering adds to it.
struct Line {
  std::span<Rgb> values;       // [light]
  std::span<double> orders{};  // [order][light], per unit of albedo to the power of the order; empty: not wanted
};

/// A reference with its parameters, ready to be integrated. Threads share it: const means it.
class Integrator {
 public:
  virtual ~Integrator() = default;

  /// 1 if red, green and blue are always the same number, else 3.
  virtual int channels() const { return 1; }
  /// Orders of scattering that can be kept apart; 0: none.
  virtual int orders() const { return 0; }
  /// Whether exact_row() has an answer.
  virtual bool has_exact() const { return false; }
  /// BRDFs by deterministic means; throws Error(usage) where there are none.
  virtual void exact_row(const Direction& wo, std::span<const Direction> wi, const Line& line) const;
  /// Means over `samples` numbers of one stream of the BRDFs of a line of lights, which may share what is sampled.
  /// `fast`: in float, vectorised over the lights, where the reference has that.
  virtual void sample_row(const Direction& wo, std::span<const Direction> wi, const SamplePoints& points,
                          std::uint32_t samples, bool fast, const Line& line) const = 0;

  Rgb exact(const Direction& wi, const Direction& wo) const {
    Rgb value;
    exact_row(wo, {&wi, 1}, {.values = {&value, 1}});
    return value;
  }
};

/// A registered kind of reference: ground truth by integration.
struct Reference {
  std::string_view name, doc, source;
  std::vector<ParameterInfo> parameters;
  bool sphere = false;  // light and view may come from below the surface too
  bool fibre = false;   // z is a fibre's axis, f carries its own cosine
  /// Throws Error(usage) for parameters that do not go together, Error(invalid_input) for what is wrong in a document.
  std::unique_ptr<const Integrator> (*make)(const ParameterValues& values);

  ParameterValues defaults() const { return ParameterValues(parameters, std::string(name)); }
};

// One maker per reference.
Reference microfacet_diffuse_reference();
Reference microfacet_specular_reference();
Reference layered_reference();
Reference hair_reference();

}  // namespace lobefit
