// Facets whose roughness depends on the azimuth: an isotropic slope distribution of unit roughness, stretched by
// alpha_x along x and alpha_y along y (Heitz 2014, section 5.3). Directions may come from below the horizon, as rays
// between facets do.
#pragma once

#include <array>

#include "models/geometry.h"
#include "models/microfacet/distribution.h"

namespace lobefit {

struct Facets {
  Distribution distribution = Distribution::ggx;
  double alpha_x = 0.5, alpha_y = 0.5;  // both 0: a smooth plane

  bool smooth() const { return alpha_x == 0.0; }

  /// D(m): facet normals per solid angle and unit of macro-surface area; 0 where m points down.
  double density(const Direction& m) const;
  /// Smith's Λ of a direction above the horizon; infinite at it.
  double lambda(const Direction& w) const;
  /// σ(w) = ∫ (w·m)⁺ D dm, the area that all facets show to w, hidden or not: cosθ (1 + Λ(w)) above the horizon,
  /// |cosθ| Λ(-w) below (Heitz et al. 2016, section 4.1).
  double projected_area(const Direction& w) const;
  /// A normal of density (w·m)⁺ D(m) / σ(w). Any unit w, though straight down sees nothing. GGX: a spherical cap
  /// (Dupuy, Benyoub 2023, Sampling Visible GGX Normals with Spherical Caps); Beckmann: visible_normals.h.
  Direction sample_visible(const Direction& w, const std::array<double, 2>& u) const;

 private:
  Direction stretched(const Direction& w) const { return {alpha_x * w.x, alpha_y * w.y, w.z}; }
};

}  // namespace lobefit
