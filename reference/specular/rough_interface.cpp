#include "reference/specular/rough_interface.h"

#include <boost/math/special_functions/beta.hpp>

#include "models/error.h"
#include "models/microfacet/fresnel.h"

namespace lobefit {

namespace {

bool is_grey(const Rgb& value) { return value.x == value.y && value.y == value.z; }

/// With several bounces, the share of the cosine lobe in pdf(): about what single scattering loses (GGX, F = 1), and
/// never little, as further bounces go where the first does not.
double multiple_share(const Facets& facets) { return 0.1 + 0.4 * facets.alpha_x * facets.alpha_y; }

}  // namespace

double masking_ratio(InterfaceMasking masking, double lambda_from, double lambda_to, bool reflected) {
  switch (masking) {
    case InterfaceMasking::correlated:
      // The mean of visibility over the exponentially distributed depths at which light from `from` meets a facet.
      if (reflected) return (1.0 + lambda_from) / (1.0 + lambda_from + lambda_to);
      if (!(lambda_from < 1e100 && lambda_to < 1e100)) return 0.0;
      return (1.0 + lambda_from) * boost::math::beta(1.0 + lambda_from, 1.0 + lambda_to);
    case InterfaceMasking::separable: return 1.0 / (1.0 + lambda_to);
    case InterfaceMasking::none: break;
  }
  return 1.0 + lambda_from;
}

FacetReflectance FacetReflectance::schlick(const Rgb& f0, const Rgb& f90) {
  FacetReflectance result;
  result.kind_ = Kind::schlick;
  result.first_ = f0, result.second_ = f90;
  result.grey_ = is_grey(f0) && is_grey(f90);
  return result;
}

FacetReflectance FacetReflectance::conductor(const Rgb& eta, const Rgb& k) {
  FacetReflectance result;
  result.kind_ = Kind::conductor;
  result.first_ = eta, result.second_ = k;
  result.grey_ = is_grey(eta) && is_grey(k);
  return result;
}

FacetReflectance FacetReflectance::dielectric(double ior) {
  if (!(ior > 0.0 && std::isfinite(ior))) {
    throw Error(ExitCode::usage, "an index of refraction must be positive", "ior", "choose one such as 1.5");
  }
  FacetReflectance result;
  result.kind_ = Kind::dielectric;
  result.ior_ = ior;
  return result;
}

Rgb FacetReflectance::operator()(double cosine, double eta) const {
  switch (kind_) {
    case Kind::schlick: return SchlickFresnel::evaluate(cosine, first_, second_);
    case Kind::conductor: {
      const double x = ConductorFresnel::evaluate(cosine, first_.x, second_.x);
      if (grey_) return {x, x, x};
      return {x, ConductorFresnel::evaluate(cosine, first_.y, second_.y),
              ConductorFresnel::evaluate(cosine, first_.z, second_.z)};
    }
    case Kind::dielectric: break;
  }
  const double x = DielectricFresnel::evaluate(cosine, eta);
  return {x, x, x};
}

RoughInterface::RoughInterface(const Facets& facets, const FacetReflectance& reflectance, int bounces,
                               InterfaceMasking masking)
    : facets_(facets), reflectance_(reflectance), bounces_(bounces), masking_(masking) {
  const auto rough = [](double alpha) { return alpha >= 1e-4; };
  const bool smooth = facets.alpha_x == 0.0 && facets.alpha_y == 0.0;
  if (!smooth && !(rough(facets.alpha_x) && rough(facets.alpha_y))) {
    throw Error(ExitCode::usage, "alpha is neither 0 nor at least 1e-4", "alpha_x, alpha_y",
                "choose 0 for both, a smooth interface, or at least 1e-4 for both");
  }
  if (bounces < 1 || bounces > all_bounces) {
    throw Error(ExitCode::usage, "the number of bounces is out of range", "bounces", "choose one from 1 to 4096");
  }
  if (bounces > 1 && masking != InterfaceMasking::correlated) {
    throw Error(ExitCode::usage, "several bounces imply height-correlated Smith masking", "masking, bounces",
                "set masking=correlated, or bounces=1");
  }
}

double RoughInterface::reflection_density(const Direction& from, const Direction& to, Direction& m) const {
  const Direction sum = from + to;
  const double length2 = dot(sum, sum);
  if (!(length2 > 0.0)) return 0.0;
  m = sum / std::sqrt(length2);
  const double area = facets_.projected_area(from);
  return area > 0.0 ? facets_.density(m) / (4.0 * area) : 0.0;
}

double RoughInterface::transmission_density(const Direction& from, const Direction& to, double eta,
                                            Direction& m) const {
  const Direction sum = from + to * eta;
  const double length2 = dot(sum, sum);
  if (!(length2 > 0.0)) return 0.0;
  m = sum / (sum.z > 0.0 ? std::sqrt(length2) : -std::sqrt(length2));
  const double cosine_from = dot(from, m), cosine_to = -dot(to, m);
  const double area = facets_.projected_area(from);
  if (!(cosine_from > 0.0 && cosine_to > 0.0 && area > 0.0)) return 0.0;
  // (from·m + η to·m)² is the squared length of the sum (Walter et al. 2007, equation 17).
  return cosine_from * facets_.density(m) / area * (eta * eta * cosine_to / length2);
}

InterfaceSample RoughInterface::sample(const Direction& from, PathNumbers& numbers) const {
  if (is_delta() || bounces_ == 1) return sample_single(from, numbers);
  InterfaceSample result{.direction = from, .weight = {}, .reflected = true};
  walk(from, numbers, result, Second::by_chance, [](const Vertex&) {});
  return result;
}

InterfaceSample RoughInterface::sample_single(const Direction& from, PathNumbers& numbers) const {
  const Rgb one{1.0, 1.0, 1.0};
  InterfaceSample result{.direction = from, .weight = {}, .reflected = true};
  const bool above = from.z >= 0.0;
  const double eta = relative_ior(above);
  const Direction back = above ? from : -from;
  const std::array<double, 2> normal_numbers = numbers.next_pair();
  const double fresnel_number = numbers.next();
  const Direction m = is_delta() ? Direction{0.0, 0.0, 1.0} : facets_.sample_visible(back, normal_numbers);
  const double cosine = min(max(dot(back, m), 0.0), 1.0);
  const Rgb reflectance = reflectance_(cosine, eta);
  result.reflected = !reflectance_.transmits() || fresnel_number < reflectance.x;
  const Direction leaving =
      result.reflected ? normalize(m * (2.0 * cosine) - back) : -refract(back, m, cosine, eta);  // up, unless lost
  result.direction = above == result.reflected ? leaving : -leaving;
  if (!(leaving.z > 0.0)) return result;
  const double ratio =
      is_delta() ? 1.0 : masking_ratio(masking_, facets_.lambda(back), facets_.lambda(leaving), result.reflected);
  result.weight = (reflectance_.transmits() ? one : reflectance) * ratio;
  return result;
}

Rgb RoughInterface::evaluate_single(const Direction& from, const Direction& to) const {
  if (is_delta() || from.z == 0.0 || to.z == 0.0) return {};
  const bool above = from.z > 0.0, reflected = above == (to.z > 0.0);
  if (!reflected && !reflectance_.transmits()) return {};
  const double eta = relative_ior(above);
  const Direction a = above ? from : -from, b = above ? to : -to;
  Direction m;
  const double density = reflected ? reflection_density(a, b, m) : transmission_density(a, b, eta, m);
  if (!(density > 0.0)) return {};
  const Rgb reflectance = reflectance_(min(dot(a, m), 1.0), eta);
  const Rgb factor = reflected ? reflectance : Rgb{1.0, 1.0, 1.0} - reflectance;
  const double ratio = masking_ratio(masking_, facets_.lambda(a), facets_.lambda(reflected ? b : -b), reflected);
  return factor * (density * ratio / abs(to.z));
}

std::optional<Direction> RoughInterface::sample_lobe(const Direction& from, PathNumbers& numbers) const {
  const double share = bounces_ > 1 ? multiple_share(facets_) : 0.0;
  if (!(numbers.next() < share)) {
    const InterfaceSample result = sample_single(from, numbers);
    const bool kept = max(result.weight.x, max(result.weight.y, result.weight.z)) > 0.0;
    return kept ? std::optional(result.direction) : std::nullopt;
  }
  // Malley's method, on a random side where light gets across.
  const std::array<double, 2> disk = numbers.next_pair();
  const double radius = std::sqrt(disk[0]), azimuth = 2.0 * pi * disk[1];
  const double height = std::sqrt(1.0 - disk[0]);
  const bool up = reflectance_.transmits() ? numbers.next() < 0.5 : from.z >= 0.0;
  return Direction{radius * std::cos(azimuth), radius * std::sin(azimuth), up ? height : -height};
}

double RoughInterface::pdf(const Direction& from, const Direction& to) const {
  if (is_delta()) return 0.0;
  const bool above = from.z >= 0.0, transmits = reflectance_.transmits();
  const double eta = relative_ior(above);
  const Direction a = above ? from : -from, b = above ? to : -to;
  const bool reflected = b.z > 0.0;
  if (!reflected && !transmits) return 0.0;
  Direction m;
  double density = reflected ? reflection_density(a, b, m) : transmission_density(a, b, eta, m);
  if (transmits && density > 0.0) {
    const double reflectance = reflectance_(min(dot(a, m), 1.0), eta).x;
    density *= reflected ? reflectance : 1.0 - reflectance;
  }
  if (bounces_ == 1) return density;
  return lerp(density, abs(b.z) / pi * (transmits ? 0.5 : 1.0), multiple_share(facets_));
}

RoughInterface::Target::Target(const RoughInterface& interface, const Direction& direction)
    : to(direction), lambda(interface.facets().lambda(direction.z > 0.0 ? direction : -direction)) {}

RoughInterface::Connection RoughInterface::connect(const Vertex& vertex, const Target& target) const {
  const Direction to = vertex.above ? target.to : -target.to;
  const bool reflected = to.z > 0.0;
  if (!reflected && !reflectance_.transmits()) return {};
  const double eta = relative_ior(vertex.above);
  Direction m;
  const double density =
      reflected ? reflection_density(vertex.back, to, m) : transmission_density(vertex.back, to, eta, m);
  if (!(density > 0.0)) return {};
  const Rgb reflectance = reflectance_(min(dot(vertex.back, m), 1.0), eta);
  if (reflected) return {density * std::exp(-target.lambda * vertex.depth), reflectance};
  // On the other side, exp(-Λ depth') with exp(-depth') = 1 - exp(-depth).
  return {density * std::pow(-std::expm1(-vertex.depth), target.lambda), Rgb{1.0, 1.0, 1.0} - reflectance};
}

Rgb RoughInterface::evaluate(const Direction& from, const Direction& to, PathNumbers& numbers) const {
  if (is_delta() || from.z == 0.0 || to.z == 0.0) return {};
  Rgb sum = evaluate_single(from, to);
  if (bounces_ == 1) return sum;
  const Target here(*this, from), there(*this, to);
  const double factor = reverse_factor(from, to);
  connect_walk(from, {&there, 1}, numbers,
               [&](std::size_t, int, double share, const Rgb& reflectance) { sum = sum + reflectance * share; });
  connect_walk(to, {&here, 1}, numbers, [&](std::size_t, int, double share, const Rgb& reflectance) {
    sum = sum + reflectance * (share * factor);
  });
  return sum;
}

}  // namespace lobefit
