// Light that bounces between facets more than once, put back onto a lobe that has one bounce. Any specular lobe: what
// is needed of it is its directional albedo E(μ) for F = 1, as the loss 1 - E, and what Fresnel makes of that.
//
//   Vec3<T> f = fresnel * lobe, average = average_schlick(p.f0);
//   f = f * turquin_scale(p.f0, loss_o);                                                   // or
//   f = f + kulla_conty_lobe(average * average, average, loss_i, loss_o, average_loss);    // or
//   f = f + fdez_aguera_lobe(average, albedo_o, loss_o);
//
// With F = 1 all three return the light that falls in: directional albedo 1 with the view fixed. Only Kulla and Conty's
// is reciprocal.
#pragma once

#include "models/scalar.h"

namespace lobefit {

/// Mean 2 ∫ F μ dμ of Schlick's Fresnel factor with f90 = 1.
template <class T>
LOBEFIT_TEXT Vec3<T> average_schlick(const Vec3<T>& f0) {
  return (20.0 * f0 + 1.0) / 21.0;
}

/// Turquin 2019, Practical Multiple Scattering Compensation for Microfacet Models: 1 + F0 (1 - E)/E at the view. The
/// lost light leaves in the shape of the lobe.
template <class T>
LOBEFIT_TEXT Vec3<T> turquin_scale(const Vec3<T>& f0, const T& loss_o) {
  return 1.0 + f0 * (loss_o / (1.0 - loss_o));
}

/// Kulla, Conty 2017, Revisiting Physically Based Shading at Imageworks: a lobe that returns what is lost, coloured by
/// `colour` E_avg/(1 - F_avg (1 - E_avg)). `colour` is F_avg²: light of two bounces has met the Fresnel factor twice,
/// and the sum over the bounces is F_avg² E_avg (1 + F_avg (1 - E_avg) + …). The slides first had F_avg there, as
/// copies still do.
template <class T>
LOBEFIT_TEXT Vec3<T> kulla_conty_lobe(const Vec3<T>& colour, const Vec3<T>& average_fresnel, const T& loss_i,
                                      const T& loss_o, const T& average_loss) {
  const T lobe = let("lobe", loss_i * loss_o / (pi * max(average_loss, 1e-9)));
  return colour * (1.0 - average_loss) / (1.0 - average_fresnel * average_loss) * lobe;
}

/// Fdez-Agüera 2019, A Multiple-Scattering Microfacet Model for Real-Time Image-based Lighting: F_ms E_ms, with
/// E_F F_avg/(1 - F_avg (1 - E)) for F_ms. Derived for environments, where it multiplies the cosine-weighted
/// irradiance; on a single light it is therefore a constant lobe, F_ms E_ms/π, that knows the view alone. `albedo_o` is
/// E_F.
template <class T>
LOBEFIT_TEXT Vec3<T> fdez_aguera_lobe(const Vec3<T>& average_fresnel, const Vec3<T>& albedo_o, const T& loss_o) {
  return albedo_o * average_fresnel / (1.0 - average_fresnel * loss_o) * (loss_o / pi);
}

}  // namespace lobefit
