// Spheres of one BRDF.
#pragma once

#include <string>

#include "models/registry.h"
#include "report/sphere.h"

namespace lobefit {

inline SphereBrdf of_model(const std::string& name, double alpha) {
  const Model& model = find_model(name);
  ParameterValues values = model.defaults();
  values.set("alpha", alpha);
  return [&model, values](const Direction& wi, const Direction& wo) {
    return std::optional<Rgb>(model.evaluate(values.flat(), wi, wo));
  };
}

inline SphereImage render(const SphereBrdf& brdf, const Lighting& lighting, const SphereOptions& options) {
  return render_spheres({&brdf, 1}, lighting, options).front();
}

}  // namespace lobefit
