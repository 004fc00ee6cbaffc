// One rough interface between two media: mirrors and, for dielectrics, refracting facets under a Smith surface.
//
// Directions point away from the surface, z is the normal, x the axis of alpha_x; both hemispheres are the interface's
// two sides. Smooth facets reflect (and refract) by Fresnel's equations; light may meet several of them (Heitz, Hanika,
// d'Eon, Dachsbacher 2016, Multiple-Scattering Microfacet BSDFs with the Smith Model).
//
// **Convention of transport.** evaluate(from, to) is f(from → to) in 1/sr of the flux that arrives from `from`:
// radiance leaving towards `to` per irradiance, so that ∫ f |cos θ_to| dω_to is the share of the flux that is not
// absorbed, 1 for a dielectric with all bounces. It is the BSDF in radiance with the light at `from` and the viewer at
// `to`; refraction compresses radiance, so transmission is not symmetric:
//
//   f(a → b) / n_b² = f(b → a) / n_a²,   n the refractive index on the side of each direction           (Veach 1997)
//
// A path that starts at the eye and multiplies the weights of sample(), or f(w → next) |cos θ_next|, carries radiance
// divided by n², which refraction leaves alone. Where eye and light are in the same medium that is all there is to do;
// otherwise multiply once by n²(eye) / n²(light).
#pragma once

#include <limits>
#include <optional>
#include <span>

#include "reference/sample_points.h"
#include "reference/specular/facets.h"

namespace lobefit {

enum class InterfaceMasking {
  correlated,  // height-correlated Smith: 1/(1 + Λi + Λo) on one side, the beta function B(1 + Λi, 1 + Λo) across
  separable,   // G1(wi) G1(wo)
  none,        // 1
};

/// G2/G1(from): the share of the light from `from` that, once it has met a facet, also gets away from it; `reflected`:
/// on the side it came from.
double masking_ratio(InterfaceMasking masking, double lambda_from, double lambda_to, bool reflected);

/// What a facet does.
class FacetReflectance {
 public:
  enum class Kind { schlick, conductor, dielectric };
  static FacetReflectance schlick(const Rgb& f0, const Rgb& f90);
  static FacetReflectance conductor(const Rgb& eta, const Rgb& k);
  /// `ior`: the index below the interface over the index above it.
  static FacetReflectance dielectric(double ior);

  Kind kind() const { return kind_; }
  bool transmits() const { return kind_ == Kind::dielectric; }
  /// One number for all channels.
  bool grey() const { return grey_; }
  /// The index below over the index above; 1 for opaque facets.
  double ior() const { return ior_; }
  /// `cosine` of the angle between light and facet; `eta`: index on the other side over the index on the light's.
  Rgb operator()(double cosine, double eta) const;

 private:
  FacetReflectance() = default;

  Kind kind_ = Kind::schlick;
  bool grey_ = true;
  Rgb first_, second_;  // f0 and f90, or eta and k
  double ior_ = 1.0;
};

struct InterfaceSample {
  Direction direction;
  Rgb weight;      // f |cos θ| / density; 0: lost between the facets, the direction means nothing
  bool reflected;  // leaves on the side it came from
};

class RoughInterface {
 public:
  /// `bounces` of all. Light that has not escaped by then is dropped; of four million walks at alpha = 1 and n = 1.5
  /// the longest had 19.
  static constexpr int all_bounces = 4096;

  /// Throws Error(usage) for several bounces without the correlated masking that their walk implies, and for facets
  /// that are neither smooth nor rough: both alphas are 0 or at least 1e-4.
  RoughInterface(const Facets& facets, const FacetReflectance& reflectance, int bounces = all_bounces,
                 InterfaceMasking masking = InterfaceMasking::correlated);

  const Facets& facets() const { return facets_; }
  const FacetReflectance& reflectance() const { return reflectance_; }
  int bounces() const { return bounces_; }
  InterfaceMasking masking() const { return masking_; }
  /// Smooth, or between equal indices: sample() gives one reflected or refracted direction, evaluate() and pdf() are 0.
  bool is_delta() const { return facets_.smooth() || (reflectance_.transmits() && reflectance_.ior() == 1.0); }

  /// Where light that arrives from `from` goes. One bounce: a visible normal, then reflection or refraction by chance.
  /// Otherwise the walk itself, so that a dielectric's weight is 1.
  InterfaceSample sample(const Direction& from, PathNumbers& numbers) const;
  /// f(from → to): an unbiased estimate; the first bounce is exact, further ones come from a walk at each end.
  Rgb evaluate(const Direction& from, const Direction& to, PathNumbers& numbers) const;
  /// The first bounce alone, in closed form.
  Rgb evaluate_single(const Direction& from, const Direction& to) const;
  /// A direction from a lobe akin to sample()'s, of known density: one bounce off visible normals and, with several
  /// bounces, a share of cosine lobes. Empty where that one bounce ends between the facets: count it as 0.
  std::optional<Direction> sample_lobe(const Direction& from, PathNumbers& numbers) const;
  /// Density per solid angle of the directions from sample_lobe(); integrates to 1 less what is lost. With one bounce
  /// it is that of sample() too, whose weight is f |cos θ| / pdf. The walk of several bounces has no closed form and
  /// needs none: multiple importance sampling stays unbiased when both strategies compute their weights from this lobe.
  double pdf(const Direction& from, const Direction& to) const;

  // ---- the walk, for those who connect it to many directions ----

  /// A place where light meets a facet.
  struct Vertex {
    int order;       // 1: the first bounce
    bool above;      // on which side
    Direction back;  // where it comes from, in the frame of its side, where that side's facets point up
    double depth;    // -ln of the share of facets that lie lower (on the other side: higher)
    Rgb weight;      // product of the reflectances so far; 1 for dielectrics
  };
  /// A direction to connect to, with what does not depend on the vertex.
  struct Target {
    explicit Target(const RoughInterface& interface, const Direction& to);
    Direction to;
    double lambda;
  };
  /// What a vertex sends to a target, times |cos θ_to|, were facets perfect mirrors; and the reflectance (or, across,
  /// transmittance) of the facet that does it.
  struct Connection {
    double geometry = 0.0;
    Rgb reflectance;
  };
  Connection connect(const Vertex& vertex, const Target& target) const;

  enum class Second {
    by_chance,  // light may escape after one bounce
    forced,     // it does not, and its weight is the chance of that
  };
  /// Calls visit(vertex) for every bounce until the light escapes; returns whether it did, and then where.
  template <class Visit>
  bool walk(const Direction& from, PathNumbers& numbers, InterfaceSample& result, Second second, Visit&& visit) const;

  /// Walks from `from` and connects the second and later bounces to every target: add(target's index, order, share,
  /// reflectance), with f(from → to) = first bounce + Σ share × reflectance. `share` is what mirrors would add.
  ///
  /// A connection is bright where it meets the facets that its light hardly sees, seldom but heavily. The same paths
  /// can be walked from the other end, where the connection is that of the first bounce. So every path is weighted by
  /// the balance heuristic between the two (as in the supplement of Heitz et al. 2016): an estimate of f needs one call
  /// from each end, turned by reverse_factor().
  template <class Add>
  void connect_walk(const Direction& from, std::span<const Target> targets, PathNumbers& numbers, Add&& add) const;
  /// f(from → to) / f(to → from) = n²(to) / n²(from).
  double reverse_factor(const Direction& from, const Direction& to) const {
    return squared_ior(to.z > 0.0) / squared_ior(from.z > 0.0);
  }

 private:
  double squared_ior(bool above) const { return above ? 1.0 : reflectance_.ior() * reflectance_.ior(); }
  /// The chance that a ray that leaves a facet at `depth` meets another one.
  double chance_to_meet(const Direction& travel, double depth) const {
    return travel.z > 0.0 ? -std::expm1(-facets_.lambda(travel) * depth) : 1.0;
  }
  /// The depth of a place as seen from the other side. Facets that are lower here are higher there: C1 becomes 1 - C1.
  static double other_depth(double depth) {
    // Two forms, each exact where it is used.
    return depth > 0.6931471805599453 ? -std::log1p(-std::exp(-depth)) : -std::log(-std::expm1(-depth));
  }
  /// Index beyond the facets over the index on this side.
  double relative_ior(bool above) const { return above ? reflectance_.ior() : 1.0 / reflectance_.ior(); }
  InterfaceSample sample_single(const Direction& from, PathNumbers& numbers) const;
  /// Densities of the light that visible normals send to `to` were they perfect mirrors (or windows), and the normal
  /// that does; in the frame of the light's side.
  double reflection_density(const Direction& from, const Direction& to, Direction& m) const;
  double transmission_density(const Direction& from, const Direction& to, double eta, Direction& m) const;

  Facets facets_;
  FacetReflectance reflectance_;
  int bounces_;
  InterfaceMasking masking_;
};

/// The direction that light from `w` is refracted to at the normal m, w·m = cosine > 0; `eta` as in FacetReflectance.
/// Below the critical angle only.
inline Direction refract(const Direction& w, const Direction& m, double cosine, double eta) {
  const double refracted = sqrt(1.0 - (1.0 - cosine * cosine) / (eta * eta));
  return normalize(m * (cosine / eta - refracted) - w / eta);
}

template <class Visit>
bool RoughInterface::walk(const Direction& from, PathNumbers& numbers, InterfaceSample& result, Second second,
                          Visit&& visit) const {
  // In the frame of a side its facets point up. The two frames are each other's point reflection, which leaves the
  // distribution of facets as it is, whatever the axes.
  const bool from_above = from.z >= 0.0;
  bool above = from_above;
  Direction travel = from_above ? -from : from;  // in the frame of the side
  double depth = 0.0;
  Rgb weight{1.0, 1.0, 1.0};
  for (int order = 1;; ++order) {
    const auto [depth_number, fresnel_number] = numbers.next_pair();
    // Free path by inversion (the paper's section 4.2): in -ln C1(h) the distribution of heights drops out.
    if (order == 2 && second == Second::forced) {
      const double meets = chance_to_meet(travel, depth);
      if (!(meets > 0.0)) return false;
      weight = weight * meets;
      depth += travel.z > 0.0 ? std::log1p(-depth_number * meets) / facets_.lambda(travel)
                              : -std::log(depth_number) / (1.0 + facets_.lambda(-travel));
    } else {
      const double log_number = std::log(depth_number);
      depth += travel.z > 0.0 ? log_number / facets_.lambda(travel) : -log_number / (1.0 + facets_.lambda(-travel));
      if (depth < 0.0) {
        result = {.direction = above ? travel : -travel, .weight = weight, .reflected = above == from_above};
        return true;
      }
    }
    if (order > bounces_) return false;
    // A first depth of exactly 0, at the horizon, would be infinitely deep on the other side.
    depth = max(depth, std::numeric_limits<double>::min());
    const Direction back = -travel;
    visit(Vertex{order, above, back, depth, weight});

    const Direction m = facets_.sample_visible(back, numbers.next_pair());
    const double cosine = min(max(dot(back, m), 0.0), 1.0), eta = relative_ior(above);
    const Rgb reflectance = reflectance_(cosine, eta);
    if (!reflectance_.transmits() || fresnel_number < reflectance.x) {
      travel = normalize(m * (2.0 * cosine) - back);
      if (!reflectance_.transmits()) weight = weight * reflectance;
    } else {
      travel = -refract(back, m, cosine, eta);
      above = !above;
      depth = other_depth(depth);
    }
  }
}

template <class Add>
void RoughInterface::connect_walk(const Direction& from, std::span<const Target> targets, PathNumbers& numbers,
                                  Add&& add) const {
  const bool opaque = !reflectance_.transmits();
  // f / n²(to) of the paths through this connection; it is the same from both ends.
  const auto symmetric = [&](const Connection& connection, const Direction& to) {
    return connection.geometry * (opaque ? 1.0 : connection.reflectance.x) / (abs(to.z) * squared_ior(to.z > 0.0));
  };
  Vertex first{};
  double reverse = 0.0, forced = 1.0;
  InterfaceSample ignored;
  walk(from, numbers, ignored, Second::forced, [&](const Vertex& vertex) {
    if (vertex.order == 1) {
      first = vertex;
      return;
    }
    if (vertex.order == 2) {
      // The first bounce met from its other end: light comes along what is now the second segment.
      const bool same_side = vertex.above == first.above;
      const Vertex met{.order = 0,
                       .above = vertex.above,
                       .back = -vertex.back,
                       .depth = same_side ? first.depth : other_depth(first.depth),
                       .weight = {}};
      reverse = symmetric(connect(met, Target(*this, from)), from);
      forced = chance_to_meet(met.back, met.depth);
    }
    const double reverse_forced = reverse * chance_to_meet(vertex.back, vertex.depth);
    for (std::size_t j = 0; j < targets.size(); ++j) {
      const Connection connection = connect(vertex, targets[j]);
      if (!(connection.geometry > 0.0)) continue;
      // Densities of a path from its two ends are as its connections, the other way round; forcing raises either.
      const double heuristic = reverse_forced / (reverse_forced + forced * symmetric(connection, targets[j].to));
      add(j, vertex.order, forced * connection.geometry * heuristic / abs(targets[j].to.z),
          vertex.weight / forced * connection.reflectance);
    }
  });
}

}  // namespace lobefit
