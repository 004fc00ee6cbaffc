#include "reference/layered/layered_surface.h"

#include <algorithm>
#include <limits>
#include <optional>

#include "models/instruction_sets.h"
#include "reference/specular/rough_interface.h"
#include "reference/visible_normals.h"

namespace lobefit {

namespace {

constexpr Rgb black{0.0, 0.0, 0.0}, white{1.0, 1.0, 1.0};

double largest(const Rgb& value) { return std::max({value.x, value.y, value.z}); }

/// Henyey, Greenstein 1941: density per solid angle at a cosine of the scattering angle.
double phase(double g, double cosine) {
  const double d = 1.0 + g * g - 2.0 * g * cosine;
  return (1.0 - g * g) / (4.0 * pi * d * std::sqrt(d));
}

/// The direction at `cosine` from the unit vector `axis`, at an azimuth of `turns`.
Direction around(const Direction& axis, double cosine, double turns) {
  // Duff et al. 2017, Building an Orthonormal Basis, Revisited.
  const double sign = axis.z >= 0.0 ? 1.0 : -1.0;
  const double a = -1.0 / (sign + axis.z), b = axis.x * axis.y * a;
  const Direction t{1.0 + sign * axis.x * axis.x * a, sign * b, -sign * axis.x};
  const Direction s{b, sign + axis.y * axis.y * a, -axis.y};
  const double sine = sqrt((1.0 - cosine) * (1.0 + cosine)), azimuth = 2.0 * pi * turns;
  return normalize(t * (sine * std::cos(azimuth)) + s * (sine * std::sin(azimuth)) + axis * cosine);
}

double sample_phase_cosine(double g, double u) {
  if (std::abs(g) < 1e-4) return 1.0 - 2.0 * u + 1.5 * g * (4.0 * u - 4.0 * u * u);
  const double s = (1.0 - g * g) / (1.0 + g - 2.0 * g * u);
  return min(max((1.0 + g * g - s * s) / (2.0 * g), -1.0), 1.0);
}

/// Rotations about the normal.
struct Turns {
  std::vector<double> cosine, sine;

  Direction operator()(const Direction& w, std::size_t k) const {
    return {cosine[k] * w.x - sine[k] * w.y, sine[k] * w.x + cosine[k] * w.y, w.z};
  }
};

/// A stream of its own, whose key is two numbers of another stream.
SamplePoints derived_points(const std::array<double, 2>& numbers) {
  const auto bits = [](double number) { return static_cast<std::uint64_t>(number * 0x1p32); };
  return {Sampler::sobol, {.seed = bits(numbers[0]) << 32 | bits(numbers[1]), .entry = 0x6c6179657265ull}};
}

/// A path of very many vertices would run out of numbers: from time to time it draws the key of a new stream.
void renew(int length, PathNumbers& numbers, std::optional<SamplePoints>& points) {
  if (length % 2048 != 0) return;
  points = derived_points(numbers.next_pair());
  numbers = PathNumbers(*points, 0);
}

/// sums[k] += weight × p/(1 + p·competing), p the phase at cosine constant + along cosine[k] + across sine[k].
LOBEFIT_CLONES [[gnu::noinline]] void add_phases(double g, double constant, double along, double across,
                                                 double competing, const Rgb& weight, std::size_t n,
                                                 const double* __restrict cosine, const double* __restrict sine,
                                                 double* __restrict r, double* __restrict green,
                                                 double* __restrict blue) {
  const double norm = (1.0 - g * g) / (4.0 * pi), square_sum = 1.0 + g * g;
#pragma GCC ivdep
  for (std::size_t k = 0; k < n; ++k) {
    const double d = square_sum - 2.0 * g * (constant + along * cosine[k] + across * sine[k]);
    const double value = norm / (d * std::sqrt(d) + norm * competing);
    r[k] += weight.x * value;
    green[k] += weight.y * value;
    blue[k] += weight.z * value;
  }
}

}  // namespace

/// One outcome of the coverage events, for all channels or one.
struct LayeredSurface::Scene {
  struct Boundary {
    enum class Kind { nothing, interface, diffuse };
    Kind kind = Kind::nothing;
    std::optional<RoughInterface> surface;  // interfaces and conductors
    Rgb albedo;                             // diffuse
    double alpha = 0.0;                     // diffuse
    double ior_above = 1.0, ior_below = 1.0;

    bool is_delta() const { return kind == Kind::nothing || (kind == Kind::interface && surface->is_delta()); }
    double ior(bool above) const { return above ? ior_above : ior_below; }
  };
  struct Region {
    double ior, depth;
    Rgb albedo;
    double g;
  };

  double probability;
  int channel;  // -1: all
  std::vector<Boundary> boundaries;
  std::vector<Region> regions;
  /// Scatterings of the light's path at most; crossing a smooth interface is none.
  static constexpr int most_light_scatterings = 7;
  int light_scatterings;

  Scene(const LayerEvent& event, int only_channel);

  int bottom() const { return static_cast<int>(boundaries.size()) - 1; }
  const Boundary& boundary(int index) const { return boundaries[static_cast<std::size_t>(index)]; }
  const Region& region(int index) const { return regions[static_cast<std::size_t>(index)]; }
};

LayeredSurface::Scene::Scene(const LayerEvent& event, int only_channel)
    : probability(event.probability), channel(only_channel) {
  const auto pick = [&](const Rgb& value) {
    const double x = channel == 0 ? value.x : channel == 1 ? value.y : value.z;
    return channel < 0 ? value : Rgb{x, x, x};
  };
  int rough = 0;
  for (const LayerEvent::Boundary& source : event.boundaries) {
    Boundary boundary;
    boundary.ior_above = source.ior_above, boundary.ior_below = source.ior_below;
    const auto set_surface = [&](double alpha, bool all_bounces, const FacetReflectance& reflectance) {
      boundary.kind = Boundary::Kind::interface;
      boundary.surface.emplace(Facets{Distribution::ggx, alpha, alpha}, reflectance,
                               all_bounces ? RoughInterface::all_bounces : 1);
      rough += boundary.is_delta() ? 0 : 1;
    };
    if (const auto* interface = std::get_if<InterfaceLayer>(&source.layer)) {
      set_surface(interface->alpha, interface->all_bounces,
                  FacetReflectance::dielectric(source.ior_below / source.ior_above));
    } else if (const auto* conductor = std::get_if<ConductorLayer>(&source.layer)) {
      set_surface(conductor->alpha, conductor->all_bounces,
                  conductor->by_f0 ? FacetReflectance::schlick(pick(conductor->f0), white)
                                   : FacetReflectance::conductor(pick(conductor->eta) / source.ior_above,
                                                                 pick(conductor->k) / source.ior_above));
    } else if (const auto* diffuse = std::get_if<DiffuseLayer>(&source.layer)) {
      boundary.kind = Boundary::Kind::diffuse;
      boundary.albedo = pick(diffuse->albedo);
      boundary.alpha = diffuse->alpha;
    }
    boundaries.push_back(boundary);
  }
  for (const LayerEvent::Region& source : event.regions) {
    regions.push_back({source.ior, pick(source.optical_depth).x, pick(source.albedo), source.g});
  }
  light_scatterings = std::min(rough, most_light_scatterings);
}

/// Samples the two paths of one scene and joins them.
class LayeredSurface::Estimator {
 public:
  Estimator(const Scene& scene, const Direction& wo, std::span<const Direction> wi);

  void add_sample(PathNumbers eye_numbers, const PathNumbers& light_numbers, const PathNumbers& join_numbers);
  /// Weight with which a path from wo leaves through the top.
  Rgb escape(PathNumbers numbers);
  /// Adds factor × the sum over samples to the value of every light.
  void add_to(double factor, std::span<Rgb> values) const;

 private:
  /// Where a path meets something. `order` sorts the places of a region from its top down, also where it has no depth.
  struct Vertex {
    int region = -1;   // of the flight that ends here; -1: the air above
    int boundary = 0;  // -1: in the medium
    double tau = 0.0, order = 0.0;
    Direction from;             // away from here, to where the path came from
    Rgb weight = white;         // of the path so far
    double density = 1.0;       // of this place on the flight
    double density_back = 1.0;  // of the flight's start, seen from here
    double choice = 0.5;        // a number for what happens here
  };
  /// What a vertex does to the path. Densities per dm; probabilities where there are no densities.
  struct Scattering {
    Direction to;
    Rgb weight = black;  // black: the path ends
    double density = 1.0, density_back = 1.0;
    bool delta = false;
  };
  struct Flight {
    int region = -1;
    double tau = 0.0, order = 0.0;
    bool from_medium = false;
    Direction travel;
  };
  /// A flight of the light's path, that vertices of the eye's path are joined to.
  struct Beam {
    Flight flight;
    Rgb weight;
    int scatterings;     // before it; smooth interfaces are none
    double competitors;  // Σ of the densities of the ways with shorter light paths, over this way's; without those of
                         // the flight's direction and start as the eye samples them
  };
  /// Lights of one polar angle.
  struct Lights {
    Direction first;  // at azimuth 0
    std::vector<std::size_t> index;
    Turns turns;
    std::vector<double> r, g, b;  // sums
    Rgb constant = black;         // sum of what does not depend on the azimuth
    std::vector<Beam> beams;
  };
  /// Σ of the densities of the ways with longer light paths, over that of the way at hand. Entry k: with at most k more
  /// scatterings on the light's path.
  using Competitors = std::array<double, Scene::most_light_scatterings + 1>;

  double ior(int region) const { return region < 0 ? 1.0 : scene_->region(region).ior; }
  bool is_delta(const Vertex& vertex) const {
    return vertex.boundary >= 0 && scene_->boundary(vertex.boundary).is_delta();
  }
  Scattering scatter(const Vertex& vertex, bool first, PathNumbers& numbers);
  Scattering cross_smooth(const Vertex& vertex, bool first) const;
  /// False: out of the layers.
  bool start_flight(const Vertex& vertex, const Direction& to, Flight& flight) const;
  /// False: the path was ended by Russian roulette.
  bool arrive(const Flight& flight, const Rgb& weight, PathNumbers& numbers, Vertex& vertex) const;

  void trace_light(Lights& lights, PathNumbers numbers);
  void join(const Vertex& vertex, const Competitors& competitors);
  bool reaches(const Flight& flight, const Vertex& vertex, double& distance) const;
  void join_medium(const Vertex& vertex, const Beam& beam, double transmittance, double longer, Lights& lights) const;
  void join_diffuse(const Vertex& vertex, const Beam& beam, double transmittance, double longer, Lights& lights) const;
  /// later_bounces_[k] = estimate of f(from → to turned by k) less its first bounce.
  void connect_later_bounces(const RoughInterface& surface, const Direction& from, const Direction& to,
                             const Turns& turns);
  void join_rough(const Vertex& vertex, const Beam& beam, double transmittance, double longer, Lights& lights);

  const Scene* scene_;
  Direction wo_;
  std::vector<Lights> lights_;
  // What the latest scatter() sampled, for join().
  Direction facet_;
  // For the walks between facets that join_rough() connects. The same for all vertices: a light's value must not depend
  // on how many others there are.
  std::optional<PathNumbers> join_numbers_;
  std::vector<RoughInterface::Target> targets_;
  std::vector<Rgb> later_bounces_;
};

LayeredSurface::Estimator::Estimator(const Scene& scene, const Direction& wo, std::span<const Direction> wi)
    : scene_(&scene), wo_(wo) {
  for (std::size_t j = 0; j < wi.size(); ++j) {
    if (!(wi[j].z > 0.0)) continue;
    const double sine = sqrt((1.0 - wi[j].z) * (1.0 + wi[j].z));
    auto lights = std::find_if(lights_.begin(), lights_.end(), [&](const Lights& l) { return l.first.z == wi[j].z; });
    if (lights == lights_.end()) {
      lights = lights_.insert(lights_.end(), Lights{.first = {sine, 0.0, wi[j].z}});
    }
    const double across = std::hypot(wi[j].x, wi[j].y);
    lights->index.push_back(j);
    lights->turns.cosine.push_back(across > 0.0 ? wi[j].x / across : 1.0);
    lights->turns.sine.push_back(across > 0.0 ? wi[j].y / across : 0.0);
  }
  for (Lights& lights : lights_) {
    for (std::vector<double>* sums : {&lights.r, &lights.g, &lights.b}) sums->assign(lights.index.size(), 0.0);
  }
}

void LayeredSurface::Estimator::add_to(double factor, std::span<Rgb> values) const {
  for (const Lights& lights : lights_) {
    for (std::size_t k = 0; k < lights.index.size(); ++k) {
      const Rgb sum = (Rgb{lights.r[k], lights.g[k], lights.b[k]} + lights.constant) * factor;
      Rgb& value = values[lights.index[k]];
      if (scene_->channel < 0 || scene_->channel == 0) value.x += sum.x;
      if (scene_->channel < 0 || scene_->channel == 1) value.y += sum.y;
      if (scene_->channel < 0 || scene_->channel == 2) value.z += sum.z;
    }
  }
}

bool LayeredSurface::Estimator::start_flight(const Vertex& vertex, const Direction& to, Flight& flight) const {
  flight.travel = to;
  flight.from_medium = vertex.boundary < 0;
  if (flight.from_medium) {
    flight.region = vertex.region, flight.tau = vertex.tau, flight.order = vertex.order;
    return true;
  }
  flight.region = to.z < 0.0 ? vertex.boundary : vertex.boundary - 1;
  if (flight.region < 0 || flight.region >= scene_->bottom()) return false;
  flight.tau = to.z < 0.0 ? 0.0 : scene_->region(flight.region).depth;
  flight.order = to.z < 0.0 ? -1.0 : flight.tau + 1.0;
  return true;
}

bool LayeredSurface::Estimator::arrive(const Flight& flight, const Rgb& weight, PathNumbers& numbers,
                                       Vertex& vertex) const {
  const auto [distance_number, choice] = numbers.next_pair();
  vertex.weight = weight;
  vertex.choice = choice;
  // Below a tenth paths are cut so that the rest weigh a tenth.
  const double survival = 10.0 * largest(weight);
  if (survival < 1.0) {
    if (choice >= survival) return false;
    vertex.weight = weight / survival;
    vertex.choice = choice / survival;
  }
  const double depth = scene_->region(flight.region).depth, cosine = abs(flight.travel.z);
  const bool down = flight.travel.z < 0.0;
  const double to_boundary = down ? depth - flight.tau : flight.tau;
  const double free = -std::log(distance_number) * cosine;
  vertex.region = flight.region;
  vertex.from = -flight.travel;
  const double travelled = min(free, to_boundary);
  const double transmittance = std::exp(-travelled / cosine);
  vertex.density = vertex.density_back = transmittance;
  if (free < to_boundary) {
    vertex.boundary = -1;
    vertex.tau = vertex.order = down ? flight.tau + free : flight.tau - free;
    vertex.density /= cosine;
  } else {
    vertex.boundary = down ? flight.region + 1 : flight.region;
    vertex.tau = down ? depth : 0.0;
    vertex.order = down ? depth + 1.0 : -1.0;
  }
  if (flight.from_medium) vertex.density_back /= cosine;
  return true;
}

LayeredSurface::Estimator::Scattering LayeredSurface::Estimator::cross_smooth(const Vertex& vertex, bool first) const {
  const Scene::Boundary& boundary = scene_->boundary(vertex.boundary);
  Scattering result{.weight = white, .delta = true};
  const Direction mirrored{-vertex.from.x, -vertex.from.y, vertex.from.z};
  if (boundary.kind == Scene::Boundary::Kind::nothing) {
    result.to = -vertex.from;
    return result;
  }
  const bool above = vertex.from.z > 0.0;
  const double cosine = min(abs(vertex.from.z), 1.0);
  const FacetReflectance& reflectance = boundary.surface->reflectance();
  const double eta = above ? reflectance.ior() : 1.0 / reflectance.ior();
  const Rgb reflected = reflectance(cosine, eta);
  if (!reflectance.transmits()) {
    result.to = mirrored;
    result.weight = reflected;
    return result;
  }
  // What the first interface reflects never reaches the layers.
  if (!first && vertex.choice < reflected.x) {
    result.to = mirrored;
    result.density = result.density_back = reflected.x;
    return result;
  }
  result.to = refract(vertex.from, {0.0, 0.0, above ? 1.0 : -1.0}, cosine, eta);
  if (first) {
    result.weight = white - reflected;
  } else {
    result.density = result.density_back = 1.0 - reflected.x;
  }
  return result;
}

LayeredSurface::Estimator::Scattering LayeredSurface::Estimator::scatter(const Vertex& vertex, bool first,
                                                                         PathNumbers& numbers) {
  const Direction& from = vertex.from;
  Scattering result;
  if (vertex.boundary < 0) {
    const Scene::Region& region = scene_->region(vertex.region);
    const auto [u, v] = numbers.next_pair();
    const double cosine = sample_phase_cosine(region.g, u);
    result.to = around(-from, cosine, v);
    result.weight = region.albedo;
    const double density = phase(region.g, cosine) / (region.ior * region.ior);
    result.density = density / abs(result.to.z);
    result.density_back = density / abs(from.z);
    return result;
  }
  const Scene::Boundary& boundary = scene_->boundary(vertex.boundary);
  if (boundary.is_delta()) return cross_smooth(vertex, first);
  if (boundary.kind == Scene::Boundary::Kind::diffuse) {
    facet_ = {0.0, 0.0, 1.0};
    if (boundary.alpha > 0.0) {
      facet_ = sample_visible_normal(Distribution::ggx, boundary.alpha, from, numbers.next_pair());
    }
    const auto [u, v] = numbers.next_pair();
    result.to = around(facet_, std::sqrt(u), v);
    if (!(result.to.z > 0.0)) return result;
    result.density = result.density_back = 1.0 / (pi * boundary.ior_above * boundary.ior_above);
    result.weight = boundary.albedo;
    if (boundary.alpha > 0.0) {
      const double lambda_from = smith_lambda(Distribution::ggx, boundary.alpha, from);
      const double lambda_to = smith_lambda(Distribution::ggx, boundary.alpha, result.to);
      result.weight = result.weight * ((1.0 + lambda_from) / (1.0 + lambda_from + lambda_to));
    }
    return result;
  }
  const RoughInterface& surface = *boundary.surface;
  const InterfaceSample sample = surface.sample(from, numbers);
  result.to = sample.direction;
  result.weight = sample.weight;
  if (!(largest(result.weight) > 0.0)) return result;
  const double ior_from = boundary.ior(from.z > 0.0), ior_to = boundary.ior(result.to.z > 0.0);
  result.density = surface.pdf(from, result.to) / (ior_to * ior_to * abs(result.to.z));
  result.density_back = surface.pdf(result.to, from) / (ior_from * ior_from * abs(from.z));
  return result;
}

void LayeredSurface::Estimator::trace_light(Lights& lights, PathNumbers numbers) {
  lights.beams.clear();
  Flight flight{.travel = -lights.first};
  lights.beams.push_back({flight, white, 0, 0.0});
  Vertex vertex{.from = lights.first};
  double competitors = 0.0;
  int scatterings = 0;
  for (bool first = true;; first = false) {
    if (!is_delta(vertex) && ++scatterings > scene_->light_scatterings) return;
    const Scattering next = scatter(vertex, first, numbers);
    const Rgb weight = vertex.weight * next.weight;
    if (!(largest(weight) > 0.0) || !start_flight(vertex, next.to, flight)) return;
    competitors = ((next.delta ? 0.0 : 1.0) + next.density_back * vertex.density_back * competitors) /
                  (next.density * vertex.density);
    lights.beams.push_back({flight, weight, scatterings, competitors});
    if (!arrive(flight, weight, numbers, vertex)) return;
  }
}

void LayeredSurface::Estimator::add_sample(PathNumbers eye_numbers, const PathNumbers& light_numbers,
                                           const PathNumbers& join_numbers) {
  join_numbers_ = join_numbers;
  for (Lights& lights : lights_) trace_light(lights, light_numbers);
  std::optional<SamplePoints> more_points;
  Vertex vertex{.from = wo_};
  Competitors competitors{};
  for (int length = 1;; ++length) {
    renew(length, eye_numbers, more_points);
    const Scattering next = scatter(vertex, length == 1, eye_numbers);
    if (!is_delta(vertex)) join(vertex, competitors);
    const Rgb weight = vertex.weight * next.weight;
    Flight flight;
    if (!(largest(weight) > 0.0) || !start_flight(vertex, next.to, flight)) return;
    if (!arrive(flight, weight, eye_numbers, vertex)) return;
    const double shift = 1.0 / (next.density * vertex.density), back = next.density_back * vertex.density_back;
    for (std::size_t k = competitors.size() - 1; k > 0; --k) {
      competitors[k] = shift * (next.delta ? back * competitors[k] : 1.0 + back * competitors[k - 1]);
    }
  }
}

Rgb LayeredSurface::Estimator::escape(PathNumbers numbers) {
  std::optional<SamplePoints> more_points;
  Vertex vertex{.from = wo_, .choice = numbers.next()};
  for (int length = 1;; ++length) {
    renew(length, numbers, more_points);
    const Scattering next = scatter(vertex, false, numbers);
    const Rgb weight = vertex.weight * next.weight;
    if (!(largest(weight) > 0.0)) return black;
    Flight flight;
    if (!start_flight(vertex, next.to, flight)) return flight.region < 0 ? weight : black;
    if (!arrive(flight, weight, numbers, vertex)) return black;
  }
}

bool LayeredSurface::Estimator::reaches(const Flight& flight, const Vertex& vertex, double& distance) const {
  const bool down = flight.travel.z < 0.0;
  if (vertex.boundary < 0) {
    distance = abs(vertex.tau - flight.tau);
    return flight.region == vertex.region && (down ? flight.order < vertex.order : flight.order > vertex.order);
  }
  if (flight.region != (down ? vertex.boundary - 1 : vertex.boundary)) return false;
  distance = flight.region < 0 ? 0.0 : down ? scene_->region(flight.region).depth - flight.tau : flight.tau;
  return true;
}

void LayeredSurface::Estimator::join(const Vertex& vertex, const Competitors& competitors) {
  const bool diffuse = vertex.boundary >= 0 && !scene_->boundary(vertex.boundary).surface;
  for (Lights& lights : lights_) {
    for (const Beam& beam : lights.beams) {
      double distance = 0.0;
      if (!reaches(beam.flight, vertex, distance)) continue;
      const double transmittance = std::exp(-distance / abs(beam.flight.travel.z));
      const double longer = competitors[static_cast<std::size_t>(scene_->light_scatterings - beam.scatterings)];
      if (vertex.boundary < 0) {
        join_medium(vertex, beam, transmittance, longer, lights);
      } else if (diffuse) {
        join_diffuse(vertex, beam, transmittance, longer, lights);
      } else {
        join_rough(vertex, beam, transmittance, longer, lights);
      }
    }
  }
}

void LayeredSurface::Estimator::join_medium(const Vertex& vertex, const Beam& beam, double transmittance, double longer,
                                            Lights& lights) const {
  const Scene::Region& region = scene_->region(vertex.region);
  const Direction& travel = beam.flight.travel;
  const Direction& from = vertex.from;
  const double cosine = abs(travel.z), ior2 = region.ior * region.ior;
  const double start_density = beam.flight.from_medium ? transmittance / cosine : transmittance;
  const double competing =
      (start_density * beam.competitors / cosine + transmittance / cosine * longer / abs(from.z)) / ior2;
  const Rgb weight = vertex.weight * beam.weight * region.albedo * (transmittance / (ior2 * cosine));
  if (region.g == 0.0) {
    constexpr double isotropic = 1.0 / (4.0 * pi);
    lights.constant = lights.constant + weight * (isotropic / (1.0 + isotropic * competing));
    return;
  }
  add_phases(region.g, travel.z * from.z, travel.x * from.x + travel.y * from.y, travel.x * from.y - travel.y * from.x,
             competing, weight, lights.index.size(), lights.turns.cosine.data(), lights.turns.sine.data(),
             lights.r.data(), lights.g.data(), lights.b.data());
}

void LayeredSurface::Estimator::join_diffuse(const Vertex& vertex, const Beam& beam, double transmittance,
                                             double longer, Lights& lights) const {
  const Scene::Boundary& boundary = scene_->boundary(vertex.boundary);
  const Direction& travel = beam.flight.travel;
  const double cosine = abs(travel.z), kernel = 1.0 / (pi * boundary.ior_above * boundary.ior_above);
  const double start_density = beam.flight.from_medium ? transmittance / cosine : transmittance;
  const double competing = kernel * (start_density * beam.competitors + transmittance * longer);
  const Rgb weight = vertex.weight * beam.weight * boundary.albedo * (transmittance * kernel / (1.0 + competing));
  if (boundary.alpha == 0.0) {
    lights.constant = lights.constant + weight;
    return;
  }
  // The mean over the facets that `from` sees of (m·to)⁺ G2/G1(from) / cos θ_to (Heitz, Dupuy 2015).
  const double lambda_from = smith_lambda(Distribution::ggx, boundary.alpha, vertex.from);
  const double lambda_to = smith_lambda(Distribution::ggx, boundary.alpha, -travel);
  const double ratio = (1.0 + lambda_from) / (1.0 + lambda_from + lambda_to) / cosine;
  for (std::size_t k = 0; k < lights.index.size(); ++k) {
    const double value = max(-dot(facet_, lights.turns(travel, k)), 0.0) * ratio;
    lights.r[k] += weight.x * value, lights.g[k] += weight.y * value, lights.b[k] += weight.z * value;
  }
}

void LayeredSurface::Estimator::join_rough(const Vertex& vertex, const Beam& beam, double transmittance, double longer,
                                           Lights& lights) {
  const Scene::Boundary& boundary = scene_->boundary(vertex.boundary);
  const RoughInterface& surface = *boundary.surface;
  const Direction& from = vertex.from;
  const bool to_above = beam.flight.travel.z < 0.0;
  if (!to_above && !surface.reflectance().transmits()) return;
  const double cosine_to = abs(beam.flight.travel.z), cosine_from = abs(from.z);
  const double ior_to = boundary.ior(to_above), ior_from = boundary.ior(from.z > 0.0);
  const double start_density = beam.flight.from_medium ? transmittance / cosine_to : transmittance;
  const double shorter = start_density * beam.competitors / (ior_to * ior_to * cosine_to);
  longer *= transmittance / (ior_from * ior_from * cosine_from);
  const Rgb weight = vertex.weight * beam.weight * (transmittance / (ior_to * ior_to));
  connect_later_bounces(surface, from, -beam.flight.travel, lights.turns);
  for (std::size_t k = 0; k < lights.index.size(); ++k) {
    const Direction to = -lights.turns(beam.flight.travel, k);
    Rgb value = surface.evaluate_single(from, to) + later_bounces_[k];
    double competing = 0.0;
    if (shorter > 0.0) competing += shorter * surface.pdf(from, to);
    if (longer > 0.0) competing += longer * surface.pdf(to, from);
    value = value * weight / (1.0 + competing);
    lights.r[k] += value.x, lights.g[k] += value.y, lights.b[k] += value.z;
  }
}

void LayeredSurface::Estimator::connect_later_bounces(const RoughInterface& surface, const Direction& from,
                                                      const Direction& to, const Turns& turns) {
  const std::size_t n = turns.cosine.size();
  later_bounces_.assign(n, black);
  if (surface.bounces() == 1) return;
  PathNumbers numbers = *join_numbers_;
  // One walk from each end. That from the light serves all azimuths too: the viewer turns the other way.
  const RoughInterface::Target light(surface, to), viewer(surface, from);
  targets_.assign(n, light);
  for (std::size_t k = 0; k < n; ++k) targets_[k].to = turns(to, k);
  surface.connect_walk(from, targets_, numbers, [&](std::size_t k, int, double share, const Rgb& reflectance) {
    later_bounces_[k] = later_bounces_[k] + reflectance * share;
  });
  const double factor = surface.reverse_factor(from, to);
  targets_.assign(n, viewer);
  for (std::size_t k = 0; k < n; ++k) {
    targets_[k].to = {turns.cosine[k] * from.x + turns.sine[k] * from.y,
                      turns.cosine[k] * from.y - turns.sine[k] * from.x, from.z};
  }
  surface.connect_walk(to, targets_, numbers, [&](std::size_t k, int, double share, const Rgb& reflectance) {
    later_bounces_[k] = later_bounces_[k] + reflectance * (share * factor);
  });
}

LayeredSurface::LayeredSurface(const LayerStack& stack) {
  for (const LayerEvent& event : stack.events()) {
    if (!event.grey()) channels_ = 3;
    if (event.shared_extinction()) {
      scenes_.emplace_back(event, -1);
    } else {
      for (int channel = 0; channel < 3; ++channel) scenes_.emplace_back(event, channel);
    }
  }
}

LayeredSurface::~LayeredSurface() = default;

void LayeredSurface::sample_row(const Direction& wo, std::span<const Direction> wi, const SamplePoints& points,
                                std::uint32_t samples, bool, const Line& line) const {
  std::fill(line.values.begin(), line.values.end(), black);
  if (!(wo.z > 0.0)) return;
  const std::uint32_t last = std::numeric_limits<std::uint32_t>::max();
  const SamplePoints light_points = derived_points(points.pair(last, 32767));
  const SamplePoints join_points = derived_points(points.pair(last, 32766));
  for (const Scene& scene : scenes_) {
    Estimator estimator(scene, wo, wi);
    for (std::uint32_t k = 0; k < samples; ++k) {
      PathNumbers light_numbers(light_points, k), join_numbers(join_points, k);
      // Pair 0 has the order of the indices in every stream: used by two, it would tie them together.
      light_numbers.next_pair();
      join_numbers.next_pair();
      estimator.add_sample(PathNumbers(points, k), light_numbers, join_numbers);
    }
    estimator.add_to(scene.probability / samples, line.values);
  }
}

Rgb LayeredSurface::sample_albedo(const Direction& wo, const SamplePoints& points, std::uint32_t samples) const {
  Rgb result = black;
  for (const Scene& scene : scenes_) {
    Estimator estimator(scene, wo, {});
    Rgb sum = black;
    for (std::uint32_t k = 0; k < samples; ++k) sum = sum + estimator.escape(PathNumbers(points, k));
    sum = sum * (scene.probability / samples);
    if (scene.channel < 0 || scene.channel == 0) result.x += sum.x;
    if (scene.channel < 0 || scene.channel == 1) result.y += sum.y;
    if (scene.channel < 0 || scene.channel == 2) result.z += sum.z;
  }
  return result;
}

std::unique_ptr<const Integrator> make_layered(const LayerStack& stack) {
  return std::make_unique<LayeredSurface>(stack);
}

}  // namespace lobefit
