// What simplifying a Substrate tree costs: for every stage its bytes, closures and errors, against the full tree
// (simplification) and against the layers as matter (model).
#pragma once

#include <map>
#include <string>
#include <vector>

#include "models/substrate/simplify.h"
#include "reference/monitor.h"
#include "reference/substrate/physical_surface.h"
#include "reference/table.h"
#include "report/sphere.h"

namespace lobefit {

/// Differences of BRDFs over a grid of directions, and of directional albedos at its views, all channels alike.
struct TreeErrors {
  double brdf_rms_log = 0.0;         // of log(1 + 20 f cos θ_i)
  double brdf_mean_relative = 0.0;   // Σ |Δf| cos θ_i / Σ f cos θ_i
  double albedo_rms_relative = 0.0;  // of albedos below 1 %, relative to 1 %
  double albedo_largest_relative = 0.0;
  double sphere_delta_e_itp = -1.0;  // mean over a lit sphere; below 0: not made

  /// What orders of collapsing are chosen by: the rms of brdf_rms_log and albedo_rms_relative.
  double error() const;
  Json json() const;
};

struct ValidationOptions {
  DiffuseReading reading = DiffuseReading::in_air;
  std::uint64_t brdf_samples = 1024, albedo_paths = 16384;  // of the layered integrator: per entry, per view
  std::uint64_t seed = 1;
  bool spheres = true;
};

/// A tree, what it is as matter, and judgement of its simplifications.
class TreeJudge {
 public:
  /// Renders the truth. Throws what the tree's events ask too much.
  TreeJudge(SlabTree tree, const FittedBlend::Constants<double>& constants, const ValidationOptions& options,
            Monitor& monitor);

  const SlabTree& tree() const { return tree_; }
  TreeErrors simplification(std::span<const SimplifyStep> steps) const;
  TreeErrors model(std::span<const SimplifyStep> steps) const;
  /// Of the exact statistics, all coverage events apart: against the one virtual slab of the full tree, and against
  /// matter.
  struct ExactStatistics {
    std::size_t closures = 0;
    TreeErrors difference, model;
  };
  ExactStatistics exact_statistics() const;
  /// model(steps).error(), with fewer directions behind the albedos.
  double quick_error(std::span<const SimplifyStep> steps) const;
  /// rms of the truth's standard errors, of albedos relative: what no error can be told below.
  double truth_error() const { return truth_error_; }
  /// The same of a sphere of matter: half the mean ΔE_ITP between those of either half of the samples. 0 without
  /// spheres.
  double sphere_truth_error() const { return sphere_truth_error_; }

 private:
  struct View {
    Direction wo;
    std::vector<Rgb> brdf;
    Rgb albedo;
  };
  std::vector<View> shown(std::span<const SimplifyStep> steps, int albedo_steps,
                          const WalkOptions& walk_options = {}) const;
  TreeErrors compare(const std::vector<View>& shown, const std::vector<View>& truth) const;
  void render_matter_sphere(const PhysicalSurface& matter, Monitor& monitor);
  /// From the sphere's samples, the first half of them in this share.
  SphereBrdf matter_brdf(double first_half) const;
  SphereBrdf brdf_of(std::span<const SimplifyStep> steps) const;
  /// Mean ΔE_ITP of lit spheres; below 0 where they share no pixel.
  double sphere_difference(const SphereBrdf& a, const SphereBrdf& b) const;

  SlabTree tree_;
  FittedBlend::Constants<double> constants_;
  ValidationOptions options_;
  std::vector<Direction> views_, lights_;
  std::vector<View> truth_, full_;
  /// f of matter where the sphere's pixels look, by wi and wo: of either half of the samples.
  std::map<std::array<double, 6>, std::array<Rgb, 2>> matter_;
  bool smooth_ = false;
  double truth_error_ = 0.0, sphere_truth_error_ = 0.0;
};

struct ValidatedStage {
  SimplifiedTree stage;
  TreeErrors simplification, model;
};

/// One way from the full tree to the plainest.
struct ValidatedStrategy {
  std::string name;  // "baseline", "fitted", "error_driven"
  std::vector<ValidatedStage> stages;

  /// Least model error of all stages of at most so many bytes; nothing where none is as small.
  const ValidatedStage* best(int bytes) const;
};

struct SlabValidation {
  std::vector<ValidatedStrategy> strategies;
  std::vector<std::string> notes;
  double truth_error = 0.0, sphere_truth_error = 0.0;
  SlabTree tree;
  TreeJudge::ExactStatistics exact;

  /// contract.md's {"levels": …}: those of the fitted rules in Substrate's order; the other strategies beside them.
  Json json(const Json& provenance) const;
  std::string page(const std::string& title, const std::string& command) const;
  /// A gnuplot program: error against bytes.
  std::string figure(const std::string& title) const;
};

SlabValidation validate_tree(const SlabTree& tree, const FittedBlend::Constants<double>& constants,
                             const ValidationOptions& options, Monitor& monitor);

}  // namespace lobefit
