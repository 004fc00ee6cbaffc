// Substrate's specular profile: a tint of a slab's specular reflection by view and light (S2, slide "Specular LUT").
//
// An engine samples the table as a texture and hands the slab's shader its value, `specular_tint`; so does a closure
// here. What the tint takes away is absorbed: the body gets no more light for it.
#pragma once

#include <algorithm>
#include <memory>
#include <vector>

#include "models/scalar.h"

namespace lobefit {

struct SpecularProfile {
  /// By view, then by light; each at cosines 0, 1/(n - 1) … 1 to the normal, one entry holding for all.
  std::size_t views = 1, lights = 1;
  std::vector<Rgb> tints{{1.0, 1.0, 1.0}};

  const Rgb& entry(std::size_t view, std::size_t light) const { return tints[view * lights + light]; }

  /// Bilinear in the cosines.
  Rgb tint(double cos_theta_o, double cos_theta_i) const {
    const Place view = place(views, cos_theta_o), light = place(lights, cos_theta_i);
    return lerp(lerp(entry(view.below, light.below), entry(view.below, light.above), light.share),
                lerp(entry(view.above, light.below), entry(view.above, light.above), light.share), view.share);
  }

  /// The product of a ramp over the view's cosine and one over the light's.
  static SpecularProfile of_ramps(const std::vector<Rgb>& view, const std::vector<Rgb>& light) {
    SpecularProfile profile{view.size(), light.size(), {}};
    for (const Rgb& v : view) {
      for (const Rgb& l : light) profile.tints.push_back(v * l);
    }
    return profile;
  }

 private:
  struct Place {
    std::size_t below, above;
    double share;
  };
  static Place place(std::size_t count, double cosine) {
    const double at = std::clamp(cosine, 0.0, 1.0) * static_cast<double>(count - 1);
    const auto below = std::min(static_cast<std::size_t>(at), count - 1);
    return {below, std::min(below + 1, count - 1), at - static_cast<double>(below)};
  }
};

/// Null tints nothing.
using SpecularProfilePointer = std::shared_ptr<const SpecularProfile>;

/// Of two lobes that reflect light in the proportion 1 - share : share, on the finer of either grid.
inline SpecularProfilePointer mixed(const SpecularProfilePointer& a, const SpecularProfilePointer& b, double share) {
  if (a == b || share <= 0.0) return a;
  if (share >= 1.0) return b;
  const SpecularProfile white;
  const SpecularProfile &first = a ? *a : white, &second = b ? *b : white;
  SpecularProfile result{std::max(first.views, second.views), std::max(first.lights, second.lights), {}};
  const auto cosine = [](std::size_t i, std::size_t count) {
    return count > 1 ? static_cast<double>(i) / static_cast<double>(count - 1) : 1.0;
  };
  for (std::size_t view = 0; view < result.views; ++view) {
    for (std::size_t light = 0; light < result.lights; ++light) {
      const double o = cosine(view, result.views), i = cosine(light, result.lights);
      result.tints.push_back(lerp(first.tint(o, i), second.tint(o, i), share));
    }
  }
  return std::make_shared<const SpecularProfile>(std::move(result));
}

}  // namespace lobefit
