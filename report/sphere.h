// Pictures of lit spheres: orthographic, without shadows or interreflection.
//
//   const SphereBrdf brdf = [&](const Direction& wi, const Direction& wo) { return model.evaluate(flat, wi, wo); };
//   const SphereImage image = render_spheres({&brdf, 1}, find_lighting("environment"), {.size = 256}).front();
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "reference/monitor.h"
#include "report/lighting.h"

namespace lobefit {

/// A BRDF in 1/sr, nothing where it has no value; z is the normal. Called from several threads at once.
using SphereBrdf = std::function<std::optional<Rgb>(const Direction& wi, const Direction& wo)>;

/// Directions to the light with a density per solid angle, where a SampledLight is not drawn itself. Called from
/// several threads at once.
struct LightProposal {
  std::function<Direction(const Direction& wo, const std::array<double, 2>& u)> sample;
  std::function<double(const Direction& wi, const Direction& wo)> pdf;
};
/// For BRDFs whose lobes are not known: by the cosine and by two GGX lobes.
LightProposal any_lobe_proposal();

struct SphereOptions {
  int size = 64;          // pixels across
  int antialiasing = 1;   // samples per pixel along each side
  int resolution = 1;     // of an environment: HalfVectorRule's n
  bool isotropic = true;  // BRDFs that do not change when turned; else x runs along circles of latitude
  /// Under a sampled light: drawn of the light, and as many of proposals, in each pixel; at least two in each of the
  /// pixel's own samples.
  int light_samples = 64;
  std::uint64_t seed = 1;
  std::vector<LightProposal> proposals = {};  // none: any_lobe_proposal()
};

struct SphereImage {
  int size = 0;
  std::vector<float> rgb;    // [y][x][channel], top line first: linear Rec.709, black outside
  std::vector<float> cover;  // [y][x]: share of the pixel that shows the sphere where all BRDFs have a value
  std::vector<float> noise;  // [y][x]: standard error of the mean of the channels; empty without a sampled light

  std::size_t pixels() const { return cover.size(); }
};

/// Pixels of a picture whose middles lie on the sphere.
std::size_t pixels_of_sphere(int size);

/// One picture per BRDF, with one mask: a light and view at which any of them has no value is left out of all. A
/// directional light without a value leaves the sample black and uncovered, an environment does so where more than a
/// tenth of its light is lost. A sampled light is drawn by itself and by the proposals, weighted by Veach's balance
/// heuristic. The same bits for any number of threads. Throws Error(usage) for no pixels.
std::vector<SphereImage> render_spheres(std::span<const SphereBrdf> brdfs, const Lighting& lighting,
                                        const SphereOptions& options, Monitor& monitor);
/// Without a word.
std::vector<SphereImage> render_spheres(std::span<const SphereBrdf> brdfs, const Lighting& lighting,
                                        const SphereOptions& options);

}  // namespace lobefit
