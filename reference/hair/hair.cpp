#include "reference/hair/hair.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace lobefit {

namespace {

constexpr int lobe_count = 3;

Inclination inclination(const Direction& w) { return {w.z, std::hypot(w.x, w.y)}; }

/// θ - angle; past the pole the azimuth would turn over, but only its cosine's size is asked for (S3 does the same).
Inclination lowered(const Inclination& theta, double angle) {
  const double s = std::sin(angle), c = std::cos(angle);
  return {theta.sine * c - theta.cosine * s, std::abs(theta.cosine * c + theta.sine * s)};
}

/// The inclination of which a mirror, whose normal is `angle` above the normal plane and `cos_half_phi` from the view
/// in azimuth, makes θ: minus that of the mirrored ray 2(w·n)n - w.
Inclination mirrored(const Inclination& theta, double angle, double cos_half_phi) {
  const double s = std::sin(angle), c = std::cos(angle);
  const double along_normal = cos_half_phi * c * theta.cosine + s * theta.sine;
  const double sine = std::clamp(theta.sine - 2.0 * s * along_normal, -1.0, 1.0);
  // The part of the mirrored ray in the normal plane, from its own components: along the normal's azimuth and across.
  const double sin_half_phi = sqrt((1.0 - cos_half_phi) * (1.0 + cos_half_phi));
  return {sine, std::hypot(2.0 * along_normal * c - theta.cosine * cos_half_phi, theta.cosine * sin_half_phi)};
}

}  // namespace

FibrePair fibre_pair(const Direction& wi, const Direction& wo) {
  const Inclination light = inclination(wi), view = inclination(wo);
  return {.light = light,
          .view = view,
          .phi = std::abs(std::atan2(wi.x * wo.y - wi.y * wo.x, wi.x * wo.x + wi.y * wo.y)),
          .cos_theta_d = std::min(1.0, 0.5 * std::hypot(light.cosine + view.cosine, light.sine + view.sine)),
          .half_vector_cosine = std::min(1.0, 0.5 * std::hypot(wi.x + wo.x, wi.y + wo.y, wi.z + wo.z))};
}

HairFibre::HairFibre(const ParameterValues& values) {
  const auto p = unflatten<Hair, double>(values.flat());
  base_color_ = p.base_color;
  ior_ = p.ior;
  azimuthal_width_ = p.azimuthal_width;
  width_ = {p.width_r, p.width_tt, p.width_trt};
  for (double& beta : width_) beta *= p.roughness * p.roughness;
  tilt_ = {p.tilt_r * p.shift, p.tilt_tt * p.shift, p.tilt_trt * p.shift};
  lobes_ = static_cast<HairLobes>(p.lobes);
  form_ = static_cast<HairForm>(p.form);
  fresnel_ = static_cast<HairFresnel>(p.fresnel);
  absorption_ = static_cast<HairAbsorption>(p.absorption);
  detector_ = static_cast<HairDetector>(p.azimuthal);
}

int HairFibre::channels() const {
  const bool grey = base_color_.x == base_color_.y && base_color_.x == base_color_.z;
  return grey || lobes_ == HairLobes::r ? 1 : 3;
}

double HairFibre::longitudinal(int lobe, const FibrePair& pair) const {
  const auto p = static_cast<std::size_t>(lobe);
  if (lobe == 0 && form_ == HairForm::unreal_reference) {
    const double cos_half_phi = std::cos(0.5 * pair.phi);
    return longitudinal_scattering(square(width_[p] * cos_half_phi) * 2.0, pair.light,
                                   mirrored(pair.view, tilt_[p], cos_half_phi));
  }
  return longitudinal_scattering(square(width_[p]), pair.light, lowered(pair.view, tilt_[p]));
}

AzimuthalLobe HairFibre::azimuthal(int lobe, const FibrePair& pair) const {
  const double outer_sine =
      form_ == HairForm::unreal_reference ? pair.light.sine : sqrt((1.0 - pair.cos_theta_d) * (1.0 + pair.cos_theta_d));
  const double inner_sine = outer_sine / ior_;
  AzimuthalLobe result{.lobe = lobe,
                       .ior = ior_,
                       .cos_theta_d = pair.cos_theta_d,
                       .cos_theta_t = sqrt((1.0 - inner_sine) * (1.0 + inner_sine)),
                       .deviation = azimuthal_width_ * width_[static_cast<std::size_t>(lobe)],
                       .fresnel = fresnel_,
                       .absorption = absorption_,
                       .detector = detector_};
  if (lobe == 0 && form_ == HairForm::unreal_reference) result.half_vector_cosine = pair.half_vector_cosine;
  return result;
}

void HairFibre::exact_row(const Direction& wo, std::span<const Direction> wi, const Line& line) const {
  for (std::size_t j = 0; j < wi.size(); ++j) {
    const FibrePair pair = fibre_pair(wi[j], wo);
    Rgb sum{};
    for (int lobe = 0; lobe < lobe_count; ++lobe) {
      if (!has(lobe)) continue;
      const double m = longitudinal(lobe, pair);
      if (m > 0.0) sum = sum + m * azimuthal_scattering(azimuthal(lobe, pair), base_color_, pair.phi);
    }
    line.values[j] = sum;
  }
}

void HairFibre::sample_row(const Direction& wo, std::span<const Direction> wi, const SamplePoints& points,
                           std::uint32_t samples, bool, const Line& line) const {
  struct Term {
    std::size_t light;
    double longitudinal, phi;
    AzimuthalLobe lobe;
    Rgb sum;
  };
  std::vector<Term> terms;
  for (std::size_t j = 0; j < wi.size(); ++j) {
    const FibrePair pair = fibre_pair(wi[j], wo);
    for (int lobe = 0; lobe < lobe_count; ++lobe) {
      const double m = has(lobe) ? longitudinal(lobe, pair) : 0.0;
      if (m > 0.0) terms.push_back({j, m, pair.phi, azimuthal(lobe, pair), {}});
    }
  }
  // The offsets are uniform over the width of the fibre; every lobe and light shares them.
  std::array<double, 256> u, unused;
  for (std::uint32_t first = 0; first < samples; first += static_cast<std::uint32_t>(u.size())) {
    const std::size_t count = std::min<std::size_t>(u.size(), samples - first);
    points.fill(first, std::span(u).first(count), std::span(unused).first(count));
    for (Term& term : terms) {
      for (const double x : std::span(u).first(count)) {
        term.sum = term.sum + azimuthal_sample(term.lobe, base_color_, term.phi, 2.0 * x - 1.0);
      }
    }
  }
  std::fill(line.values.begin(), line.values.end(), Rgb{});
  for (const Term& term : terms) {
    line.values[term.light] = line.values[term.light] + term.longitudinal / samples * term.sum;
  }
}

Reference hair_reference() {
  return {.name = Hair::name,
          .doc = Hair::doc,
          .source = Hair::source,
          .parameters = describe_parameters<Hair>(),
          .sphere = true,
          .fibre = true,
          .make = [](const ParameterValues& values) -> std::unique_ptr<const Integrator> {
            return std::make_unique<HairFibre>(values);
          }};
}

}  // namespace lobefit
