#include "report/sphere.h"

#include <tbb/parallel_for.h>

#include <cmath>
#include <cstdint>
#include <map>

#include "models/error.h"
#include "models/microfacet/sampling.h"
#include "models/sampling.h"
#include "reference/half_vector_rule.h"
#include "reference/sample_points.h"

namespace lobefit {

namespace {

/// Axes of the surface in the world.
struct Frame {
  Direction x, y, z;

  Direction to_world(const Direction& w) const { return x * w.x + y * w.y + z * w.z; }
  Direction to_local(const Direction& w) const { return {dot(x, w), dot(y, w), dot(z, w)}; }
};

constexpr Direction to_viewer{0.0, 0.0, 1.0};

Frame frame_at(const Direction& normal, bool isotropic) {
  const double radius = std::hypot(normal.x, normal.y);
  Direction x{1.0, 0.0, 0.0};
  if (!isotropic) {
    // Eastwards. On the visible half z > 0, so that there is no pole.
    x = normalize(cross(Direction{0.0, 1.0, 0.0}, normal));
  } else if (radius > 0.0) {
    // The view at azimuth 0: samples at one radius share what their BRDFs say.
    x = Direction{-normal.x * normal.z / radius, -normal.y * normal.z / radius, radius};
  }
  return {x, cross(normal, x), normal};
}

/// Samples of the picture at one radius, all alike to an isotropic BRDF; single ones where BRDFs are not.
struct Ring {
  std::vector<std::size_t> samples;
  std::vector<Direction> normals;
};

std::vector<Ring> make_rings(int n, bool isotropic) {
  std::map<long, Ring> by_radius;
  std::vector<Ring> rings;
  for (int line = 0; line < n; ++line) {
    for (int column = 0; column < n; ++column) {
      // Twice the offset from the centre, in samples: radii compare exactly.
      const long across = 2 * column + 1 - n, up = n - 1 - 2 * line;
      const long radius2 = across * across + up * up;
      if (radius2 >= static_cast<long>(n) * n) continue;
      Ring& ring = isotropic ? by_radius[radius2] : rings.emplace_back();
      const double x = static_cast<double>(across) / n, y = static_cast<double>(up) / n;
      ring.samples.push_back(static_cast<std::size_t>(line) * static_cast<std::size_t>(n) +
                             static_cast<std::size_t>(column));
      ring.normals.push_back({x, y, std::sqrt(1.0 - static_cast<double>(radius2) / (static_cast<double>(n) * n))});
    }
  }
  for (auto& [radius2, ring] : by_radius) rings.push_back(std::move(ring));
  return rings;
}

/// Values of all BRDFs; false if one has none, or none that is finite.
bool evaluate(std::span<const SphereBrdf> brdfs, const Direction& wi, const Direction& wo, Rgb* values) {
  for (std::size_t k = 0; k < brdfs.size(); ++k) {
    const std::optional<Rgb> value = brdfs[k](wi, wo);
    if (!value || !std::isfinite(value->x + value->y + value->z)) return false;
    values[k] = *value;
  }
  return true;
}

class Renderer {
 public:
  Renderer(std::span<const SphereBrdf> brdfs, const Lighting& lighting, const SphereOptions& options, Monitor& monitor)
      : brdfs_(brdfs),
        lighting_(lighting),
        options_(options),
        isotropic_(options.isotropic),
        rule_(options.resolution),
        n_(static_cast<std::size_t>(options.size * options.antialiasing)),
        radiance_(brdfs.size(), std::vector<Rgb>(n_ * n_)),
        covered_(n_ * n_, 0) {
    if (lighting.sampled) noise_.assign(brdfs.size(), std::vector<double>(n_ * n_));
    if (options_.proposals.empty()) options_.proposals.push_back(any_lobe_proposal());
    const std::vector<Ring> rings = make_rings(static_cast<int>(n_), isotropic_);
    monitor.begin("sphere", n_ * n_);
    tbb::parallel_for(std::size_t{0}, rings.size(), [&](std::size_t k) {
      monitor.check();
      shade(rings[k]);
      monitor.advance(rings[k].samples.size());
    });
    monitor.end();
  }

  SphereImage image(std::size_t brdf, const SphereOptions& options) const {
    const auto size = static_cast<std::size_t>(options.size), s = static_cast<std::size_t>(options.antialiasing);
    SphereImage result{options.size, std::vector<float>(3 * size * size), std::vector<float>(size * size)};
    const double share = 1.0 / static_cast<double>(s * s);
    for (std::size_t pixel = 0; pixel < size * size; ++pixel) {
      Rgb sum;
      double cover = 0.0, variance = 0.0;
      for (std::size_t k = 0; k < s * s; ++k) {
        const std::size_t sample = (pixel / size * s + k / s) * n_ + pixel % size * s + k % s;
        sum = sum + radiance_[brdf][sample];
        cover += covered_[sample];
        if (lighting_.sampled) variance += square(noise_[brdf][sample]);
      }
      result.rgb[3 * pixel] = static_cast<float>(share * sum.x);
      result.rgb[3 * pixel + 1] = static_cast<float>(share * sum.y);
      result.rgb[3 * pixel + 2] = static_cast<float>(share * sum.z);
      result.cover[pixel] = static_cast<float>(share * cover);
      if (lighting_.sampled) result.noise.push_back(static_cast<float>(share * std::sqrt(variance)));
    }
    return result;
  }

 private:
  void shade(const Ring& ring) {
    const Direction wo = frame_at(ring.normals.front(), isotropic_).to_local(to_viewer);
    std::vector<LightNode> nodes;
    std::vector<Rgb> values;  // of all BRDFs at each node
    if (lighting_.has_environment()) {
      nodes = rule_.lights(wo);
      values.resize(nodes.size() * brdfs_.size());
      for (std::size_t k = 0; k < nodes.size(); ++k) {
        nodes[k].weight *= nodes[k].wi.z;
        // A weight below 0 marks a light without a value.
        if (!evaluate(brdfs_, nodes[k].wi, wo, &values[k * brdfs_.size()])) nodes[k].weight *= -1.0;
      }
    }
    for (std::size_t k = 0; k < ring.samples.size(); ++k) {
      const Frame frame = frame_at(ring.normals[k], isotropic_);
      std::vector<Rgb> sum(brdfs_.size());
      const bool covered = add_environment(frame, nodes, values, sum) && add_lights(frame, wo, sum) &&
                           add_sampled(frame, wo, ring.samples[k], sum);
      covered_[ring.samples[k]] = covered ? 1 : 0;
      for (std::size_t b = 0; covered && b < brdfs_.size(); ++b) radiance_[b][ring.samples[k]] = sum[b];
    }
  }

  bool add_environment(const Frame& frame, const std::vector<LightNode>& nodes, const std::vector<Rgb>& values,
                       std::vector<Rgb>& sum) const {
    double lost = 0.0, total = 0.0;
    for (std::size_t k = 0; k < nodes.size(); ++k) {
      const Rgb light = lighting_.radiance(frame.to_world(nodes[k].wi)) * std::abs(nodes[k].weight);
      const double amount = light.x + light.y + light.z;
      total += amount;
      if (nodes[k].weight < 0.0) {
        lost += amount;
        continue;
      }
      for (std::size_t b = 0; b < sum.size(); ++b) sum[b] = sum[b] + values[k * sum.size() + b] * light;
    }
    return lost <= most_lost * total;
  }

  bool add_lights(const Frame& frame, const Direction& wo, std::vector<Rgb>& sum) const {
    std::vector<Rgb> values(brdfs_.size());
    for (const DirectionalLight& light : lighting_.lights) {
      const Direction wi = frame.to_local(light.towards);
      if (!(wi.z > 0.0)) continue;
      if (!evaluate(brdfs_, wi, wo, values.data())) return false;
      for (std::size_t b = 0; b < sum.size(); ++b) sum[b] = sum[b] + values[b] * light.irradiance * wi.z;
    }
    return true;
  }

  /// Mean density of the proposals.
  double proposed(const Direction& wi, const Direction& wo) const {
    double sum = 0.0;
    for (const LightProposal& proposal : options_.proposals) sum += proposal.pdf(wi, wo);
    return sum / static_cast<double>(options_.proposals.size());
  }

  /// Half of the directions by the light, half by the proposals; the two halves of their sequences tell the noise.
  bool add_sampled(const Frame& frame, const Direction& wo, std::size_t sample, std::vector<Rgb>& sum) {
    if (!lighting_.sampled) return true;
    const SampledLight& light = *lighting_.sampled;
    const std::size_t proposals = options_.proposals.size();
    const auto wanted =
        static_cast<std::size_t>(std::max(2, options_.light_samples / (options_.antialiasing * options_.antialiasing)));
    // The mean density is that of the directions only if all proposals have as many.
    const std::size_t each = (wanted + proposals - 1) / proposals, n = each * proposals;
    std::array<std::vector<Rgb>, 2> halves{std::vector<Rgb>(sum.size()), std::vector<Rgb>(sum.size())};
    std::vector<Rgb> values(sum.size());
    double lost = 0.0, total = 0.0;
    const auto add = [&](const Direction& wi, const Direction& world, std::vector<Rgb>& half) {
      if (!(wi.z > 0.0)) return;
      const ArrivingLight arriving = light.at(world);
      const double amount = arriving.radiance.x + arriving.radiance.y + arriving.radiance.z;
      if (!(amount > 0.0)) return;
      const double weight = wi.z / (static_cast<double>(n) * (arriving.pdf + proposed(wi, wo)));
      total += weight * amount;
      if (!evaluate(brdfs_, wi, wo, values.data())) {
        lost += weight * amount;
        return;
      }
      for (std::size_t b = 0; b < sum.size(); ++b) half[b] = half[b] + values[b] * arriving.radiance * weight;
    };
    std::vector<double> u(n), v(n);
    const auto draw = [&](std::uint32_t way, std::size_t count, const auto& add_drawn) {
      const SamplePoints points(Sampler::sobol, {.seed = options_.seed, .entry = sample, .replicate = way});
      points.fill(0, std::span(u).first(count), std::span(v).first(count));
      for (std::size_t k = 0; k < count; ++k) add_drawn({u[k], v[k]}, halves[2 * k < count ? 0 : 1]);
    };
    using Point = std::array<double, 2>;
    draw(0, n, [&](const Point& point, std::vector<Rgb>& half) {
      const Direction world = light.sample(point);
      add(frame.to_local(world), world, half);
    });
    // A sequence each: every second point of one lies in one half of the square.
    for (std::size_t p = 0; p < proposals; ++p) {
      draw(static_cast<std::uint32_t>(p + 1), each, [&](const Point& point, std::vector<Rgb>& half) {
        const Direction wi = options_.proposals[p].sample(wo, point);
        add(wi, frame.to_world(wi), half);
      });
    }
    for (std::size_t b = 0; b < sum.size(); ++b) {
      const Rgb difference = halves[0][b] - halves[1][b];
      noise_[b][sample] = std::abs(difference.x + difference.y + difference.z) / 3.0;
      sum[b] = sum[b] + halves[0][b] + halves[1][b];
    }
    return lost <= most_lost * total;
  }

  static constexpr double most_lost = 0.1;

  std::span<const SphereBrdf> brdfs_;
  const Lighting& lighting_;
  SphereOptions options_;
  bool isotropic_;
  HalfVectorRule rule_;
  std::size_t n_;  // samples across
  std::vector<std::vector<Rgb>> radiance_;
  std::vector<std::uint8_t> covered_;
  std::vector<std::vector<double>> noise_;  // of the mean of the channels, for each BRDF
};

}  // namespace

std::size_t pixels_of_sphere(int size) { return make_rings(size, /*isotropic=*/false).size(); }

LightProposal any_lobe_proposal() {
  static constexpr std::array alphas{0.1, 0.4};
  return {.sample = [](const Direction& wo, const std::array<double, 2>& u) -> Direction {
            std::array<double, 2> rest = u;
            const std::size_t lobe = pick_lobe(std::array{1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0}, rest);
            return lobe == 2 ? sample_cosine(rest)
                             : sample_visible_reflection(Distribution::ggx, alphas[lobe], wo, rest);
          },
          .pdf =
              [](const Direction& wi, const Direction& wo) {
                double sum = cosine_density(wi);
                for (const double alpha : alphas) sum += visible_reflection_density(Distribution::ggx, alpha, wi, wo);
                return sum / 3.0;
              }};
}

std::vector<SphereImage> render_spheres(std::span<const SphereBrdf> brdfs, const Lighting& lighting,
                                        const SphereOptions& options) {
  Monitor silent;
  return render_spheres(brdfs, lighting, options, silent);
}

std::vector<SphereImage> render_spheres(std::span<const SphereBrdf> brdfs, const Lighting& lighting,
                                        const SphereOptions& options, Monitor& monitor) {
  if (options.size < 1 || options.antialiasing < 1 || options.resolution < 1) {
    throw Error(ExitCode::usage, "a picture without pixels", "sphere", "choose sizes from 1 on");
  }
  const Renderer renderer(brdfs, lighting, options, monitor);
  std::vector<SphereImage> images;
  for (std::size_t k = 0; k < brdfs.size(); ++k) images.push_back(renderer.image(k, options));
  return images;
}

}  // namespace lobefit
