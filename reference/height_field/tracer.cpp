#include "reference/height_field/tracer.h"

#include <cmath>
#include <limits>

#include "models/error.h"

#if defined(LOBEFIT_EMBREE)
#include <embree3/rtcore.h>
#endif

namespace lobefit {

namespace {

// Coordinates are floats in Embree, at most 1024 cells from the centre: rounded by at most 6e-5 cells. New rays start
// `lift` above their facet, so rounding leaves them above it. Neither should they slip under a neighbour across a
// concave edge: points are drawn towards the facet's centroid by the fraction `inset`, 2e-4 cells off the nearest edge
// or more. Both shift what is seen by a thousandth of a cell.
constexpr double lift = 2e-4;
constexpr double inset = 1e-3;
static_assert(lift > 6e-5 * 1.8);

}  // namespace

Direction HeightFieldTracer::point_above(std::uint32_t facet, double u, double v) const {
  const int cells = surface_.cells();
  const int cell = static_cast<int>(facet / 2);
  const int column = cell % cells, row = cell / cells;
  const auto corners = HeightField::corners(column, row, static_cast<int>(facet % 2));
  u = lerp(u, 1.0 / 3.0, inset);
  v = lerp(v, 1.0 / 3.0, inset);
  const std::array<double, 3> weights{1.0 - u - v, u, v};
  Direction point = surface_.normal(facet) * lift;
  for (std::size_t k = 0; k < 3; ++k) {
    const int x = column + corners[k][0], y = row + corners[k][1];
    point = point + weights[k] * Direction{x - 0.5 * cells, y - 0.5 * cells, surface_.height(x, y)};
  }
  return point;
}

#if defined(LOBEFIT_EMBREE)

namespace {

constexpr int most_cells = 2048;
constexpr int most_segments = 100000;

struct ReleaseDevice {
  void operator()(RTCDevice device) const { rtcReleaseDevice(device); }
};
struct ReleaseScene {
  void operator()(RTCScene scene) const { rtcReleaseScene(scene); }
};

RTCRay make_ray(const Direction& origin, const Direction& direction, double length) {
  RTCRay ray{};
  ray.org_x = static_cast<float>(origin.x);
  ray.org_y = static_cast<float>(origin.y);
  ray.org_z = static_cast<float>(origin.z);
  ray.dir_x = static_cast<float>(direction.x);
  ray.dir_y = static_cast<float>(direction.y);
  ray.dir_z = static_cast<float>(direction.z);
  ray.tnear = 0.0f;
  ray.tfar = static_cast<float>(length);
  ray.mask = ~0u;
  return ray;
}

/// A ray in pieces, each within the patch.
class Segments {
 public:
  Segments(const HeightField& surface, const Direction& origin, const Direction& direction)
      : half_(0.5 * surface.cells()),
        lowest_(surface.lowest()),
        highest_(surface.highest()),
        origin_(origin),
        direction_(direction) {
    origin_.x -= 2.0 * half_ * std::floor((origin_.x + half_) / (2.0 * half_));
    origin_.y -= 2.0 * half_ * std::floor((origin_.y + half_) / (2.0 * half_));
    find_exit();
  }

  const Direction& origin() const { return origin_; }
  /// To half a cell beyond the patch, where the mesh overlaps its own repetition: no gap at the seam.
  double length() const { return min(exit_ + beyond_, end_); }
  /// Whether the ray leaves the surface's range of heights before the edge of the patch.
  bool is_last() const { return end_ <= exit_; }

  /// On to the next piece.
  void wrap() {
    origin_ = origin_ + exit_ * direction_;
    (leaves_along_x_ ? origin_.x : origin_.y) =
        leaves_along_x_ ? std::copysign(half_, -direction_.x) : std::copysign(half_, -direction_.y);
    find_exit();
  }

 private:
  void find_exit() {
    constexpr double never = std::numeric_limits<double>::infinity();
    const auto along = [&](double from, double slope) {
      return slope == 0.0 ? never : max((std::copysign(half_, slope) - from) / slope, 0.0);
    };
    const double x = along(origin_.x, direction_.x), y = along(origin_.y, direction_.y);
    leaves_along_x_ = x < y;
    exit_ = min(x, y);
    beyond_ = std::isinf(exit_) ? 0.0 : 0.5 / max(std::abs(direction_.x), std::abs(direction_.y));
    const double limit = direction_.z > 0.0 ? highest_ + 1.0 : lowest_ - 1.0;
    end_ = direction_.z == 0.0 ? never : max((limit - origin_.z) / direction_.z, 0.0);
  }

  double half_, lowest_, highest_;
  Direction origin_, direction_;
  double exit_ = 0.0, beyond_ = 0.0, end_ = 0.0;
  bool leaves_along_x_ = false;
};

}  // namespace

struct HeightFieldTracer::Scene {
  std::unique_ptr<RTCDeviceTy, ReleaseDevice> device;
  std::unique_ptr<RTCSceneTy, ReleaseScene> scene;
};

bool HeightFieldTracer::available() { return true; }

HeightFieldTracer::HeightFieldTracer(const HeightField& surface)
    : surface_(surface), scene_(std::make_unique<Scene>()) {
  if (surface.cells() > most_cells) {
    throw Error(ExitCode::usage, "a patch of " + std::to_string(surface.cells()) + " cells is too wide for floats",
                "height field", "choose at most " + std::to_string(most_cells));
  }
  scene_->device.reset(rtcNewDevice(nullptr));
  if (!scene_->device) {
    throw Error(ExitCode::missing_part, "Embree found no way to run here", "height field", "check the processor");
  }
  scene_->scene.reset(rtcNewScene(scene_->device.get()));
  rtcSetSceneFlags(scene_->scene.get(), RTC_SCENE_FLAG_ROBUST);

  // The patch and one cell more all around.
  const int cells = surface.cells(), points = cells + 3;
  const RTCGeometry geometry = rtcNewGeometry(scene_->device.get(), RTC_GEOMETRY_TYPE_TRIANGLE);
  auto* vertex =
      static_cast<float*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                                  3 * sizeof(float), static_cast<std::size_t>(points) * points));
  auto* corner = static_cast<unsigned*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                                                3 * sizeof(unsigned),
                                                                2 * static_cast<std::size_t>(cells + 2) * (cells + 2)));
  if (vertex == nullptr || corner == nullptr) throw std::bad_alloc();
  for (int row = -1; row <= cells + 1; ++row) {
    for (int column = -1; column <= cells + 1; ++column) {
      *vertex++ = static_cast<float>(column - cells / 2);
      *vertex++ = static_cast<float>(row - cells / 2);
      *vertex++ = surface.height(column, row);
    }
  }
  for (int row = -1; row <= cells; ++row) {
    for (int column = -1; column <= cells; ++column) {
      for (int half = 0; half < 2; ++half) {
        for (const auto& [x, y] : HeightField::corners(column, row, half)) {
          *corner++ = static_cast<unsigned>((row + 1 + y) * points + column + 1 + x);
        }
      }
    }
  }
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(scene_->scene.get(), geometry);
  rtcReleaseGeometry(geometry);
  rtcCommitScene(scene_->scene.get());
  if (rtcGetDeviceError(scene_->device.get()) != RTC_ERROR_NONE) {
    throw Error(ExitCode::failure, "Embree could not build its tree", "height field", "check the free memory");
  }
}

HeightFieldTracer::~HeightFieldTracer() = default;

Encounter HeightFieldTracer::trace(const Direction& origin, const Direction& direction) const {
  Segments segments(surface_, origin, direction);
  for (int count = 0; count < most_segments; ++count, segments.wrap()) {
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    RTCRayHit query{};
    query.ray = make_ray(segments.origin(), direction, segments.length());
    query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    rtcIntersect1(scene_->scene.get(), &context, &query);
    if (query.hit.geomID != RTC_INVALID_GEOMETRY_ID) {
      const int across = surface_.cells() + 2, cell = static_cast<int>(query.hit.primID / 2);
      const std::uint32_t facet =
          surface_.facet(cell % across - 1, cell / across - 1, static_cast<int>(query.hit.primID % 2));
      const Direction normal = surface_.normal(facet);
      if (dot(normal, direction) >= 0.0) return {Encounter::What::lost};
      return {Encounter::What::facet, facet, normal, point_above(facet, query.hit.u, query.hit.v)};
    }
    if (segments.is_last()) return {direction.z > 0.0 ? Encounter::What::sky : Encounter::What::lost};
  }
  return {Encounter::What::lost};
}

bool HeightFieldTracer::sees_sky(const Direction& origin, const Direction& direction) const {
  Segments segments(surface_, origin, direction);
  for (int count = 0; count < most_segments; ++count, segments.wrap()) {
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    RTCRay ray = make_ray(segments.origin(), direction, segments.length());
    rtcOccluded1(scene_->scene.get(), &context, &ray);
    if (ray.tfar < 0.0f) return false;
    if (segments.is_last()) return direction.z > 0.0;
  }
  return false;
}

#else

struct HeightFieldTracer::Scene {};

bool HeightFieldTracer::available() { return false; }

HeightFieldTracer::HeightFieldTracer(const HeightField& surface) : surface_(surface) {
  throw Error(ExitCode::missing_part, "this build has no Embree to trace rays with", "height field",
              "install Debian's package libembree-dev and build again");
}

HeightFieldTracer::~HeightFieldTracer() = default;

Encounter HeightFieldTracer::trace(const Direction&, const Direction&) const { return {Encounter::What::lost}; }

bool HeightFieldTracer::sees_sky(const Direction&, const Direction&) const { return false; }

#endif

}  // namespace lobefit
