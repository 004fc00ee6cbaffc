// How far apart two pictures look.
//
// ΔE_ITP of ITU-R BT.2124: linear Rec.709 → Rec.2020 → LMS → PQ → I, T = Ct/2, P; 720 times the distance, so that 1 is
// what the keenest eye just sees. Radiance 1 is shown at 203 cd/m², BT.2408's reference white; PQ ends at 10,000 cd/m²,
// where highlights are cut as displays cut them.
//
// ꟻLIP (flip.h) of the pictures as a display shows them, cut at radiance 1, over the same pixels.
#pragma once

#include <optional>

#include "models/scalar.h"
#include "report/sphere.h"

namespace lobefit {

/// cd/m² of radiance 1.
inline constexpr double white_luminance = 203.0;
/// A 0.7 m wide screen of 3840 pixels at 0.7 m, what FLIP's authors assume.
inline constexpr double pixels_per_degree = 67.0;

/// I, T and P of a linear Rec.709 colour in cd/m²; negative cone signals count as 0.
Rgb itp_of_rec709(const Rgb& luminance);
double delta_e_itp(const Rgb& itp_a, const Rgb& itp_b);

struct ImageDifference {
  double delta_e_itp_mean, delta_e_itp_p95;  // 95 % of the pixels are at or below the latter
  double flip_mean;
};

/// Over the pixels that both show in full; nothing where there are none. Throws Error(usage) for pictures of different
/// sizes.
std::optional<ImageDifference> image_difference(const SphereImage& a, const SphereImage& b);

}  // namespace lobefit
