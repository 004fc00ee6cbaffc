// Rays over a periodic height field, by Embree (Wald et al. 2014, Embree: A Kernel Framework for Efficient CPU Ray
// Tracing).
#pragma once

#include <memory>

#include "reference/height_field/height_field.h"

namespace lobefit {

/// What a ray met.
struct Encounter {
  enum class What { facet, sky, lost };

  What what;
  std::uint32_t facet = 0;
  Direction normal{};  // of the facet
  Direction point{};   // just above it, where the next ray may start
};

/// Threads share it.
class HeightFieldTracer {
 public:
  /// Whether this build can trace rays.
  static bool available();

  /// Throws Error(missing_part) in a build without Embree.
  explicit HeightFieldTracer(const HeightField& surface);
  ~HeightFieldTracer();
  HeightFieldTracer(const HeightFieldTracer&) = delete;
  HeightFieldTracer& operator=(const HeightFieldTracer&) = delete;

  /// The first facet along a ray, or the sky. The origin lies above the surface, anywhere over the plane. A ray is lost
  /// if it meets the back of a facet, or nothing though it points down: rounding put it below the surface.
  Encounter trace(const Direction& origin, const Direction& direction) const;
  /// Whether nothing lies between a point above the surface and the sky.
  bool sees_sky(const Direction& origin, const Direction& direction) const;

  /// A point just above a facet, at barycentric coordinates (1 - u - v, u, v).
  Direction point_above(std::uint32_t facet, double u, double v) const;

  const HeightField& surface() const { return surface_; }

 private:
  struct Scene;

  const HeightField& surface_;
  std::unique_ptr<Scene> scene_;
};

}  // namespace lobefit
