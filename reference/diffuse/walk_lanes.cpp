#include "reference/diffuse/walk_lanes.h"

#include <algorithm>
#include <numbers>

#include "models/float_functions.h"
#include "models/instruction_sets.h"

namespace lobefit {

namespace {

constexpr std::size_t block = 256;  // facets summed in float before the sum moves to double
constexpr std::size_t pack = 8;     // facets that pass while a sum is in its register; divides block
constexpr std::size_t lanes = 16;   // floats in the widest vector

std::size_t round_up(std::size_t n, std::size_t to) { return (n + to - 1) / to * to; }

/// sums[j] += Σ over facets of (m · wi_j)⁺. Lanes are directions; the order of facets is the order of additions.
/// `facets` is a multiple of `pack`.
LOBEFIT_CLONES [[gnu::noinline]] void add_visible_cosines(const float* __restrict mx, const float* __restrict my,
                                                          const float* __restrict mz, std::size_t facets,
                                                          const float* __restrict x, const float* __restrict y,
                                                          const float* __restrict z, std::size_t n,
                                                          float* __restrict sums) {
  for (std::size_t first = 0; first < facets; first += pack) {
    for (std::size_t j = 0; j < n; ++j) {
      float sum = sums[j];
#pragma GCC unroll 8
      for (std::size_t k = 0; k < pack; ++k) {
        const float cosine = mx[first + k] * x[j] + my[first + k] * y[j] + mz[first + k] * z[j];
        sum += cosine > 0.0f ? cosine : 0.0f;
      }
      sums[j] = sum;
    }
  }
}

/// Facets shortened by the share of light that reaches them: (s m)·wi⁺ = s (m·wi)⁺.
LOBEFIT_CLONES [[gnu::noinline]] void shadow(const float* __restrict mx, const float* __restrict my,
                                             const float* __restrict mz, const float* __restrict tau, float rate,
                                             std::size_t n, float* __restrict x, float* __restrict y,
                                             float* __restrict z) {
#pragma GCC ivdep
  for (std::size_t i = 0; i < n; ++i) {
    const float lit = float_exp2(rate * tau[i]);
    x[i] = lit * mx[i], y[i] = lit * my[i], z[i] = lit * mz[i];
  }
}

/// Directions of density cosine/π about the facets: the facet plus a point of the unit sphere.
LOBEFIT_CLONES [[gnu::noinline]] void scatter(std::size_t n, const float* __restrict mx, const float* __restrict my,
                                              const float* __restrict mz, const float* __restrict u,
                                              const float* __restrict v, float* __restrict wx, float* __restrict wy,
                                              float* __restrict wz) {
#pragma GCC ivdep
  for (std::size_t i = 0; i < n; ++i) {
    float cosine, sine;
    float_cosine_and_sine_of_turns(v[i], cosine, sine);
    const float radius = 2.0f * __builtin_sqrtf(u[i] * (1.0f - u[i]));
    const float x = mx[i] + radius * cosine, y = my[i] + radius * sine, z = mz[i] + (1.0f - 2.0f * u[i]);
    const float squared = x * x + y * y + z * z;
    const float scale = 1.0f / __builtin_sqrtf(squared > 1e-12f ? squared : 1e-12f);
    wx[i] = x * scale, wy[i] = y * scale, wz[i] = z * scale;
  }
}

/// Depths of the next facets: τ - E/Λ(w), E from the exponential distribution; negative above the surface.
LOBEFIT_CLONES [[gnu::noinline]] void fly(std::size_t n, float alpha_x, float alpha_y, const float* __restrict wx,
                                          const float* __restrict wy, const float* __restrict wz,
                                          const float* __restrict u, float* __restrict tau) {
#pragma GCC ivdep
  for (std::size_t i = 0; i < n; ++i) {
    const float exponential = -std::numbers::ln2_v<float> * float_log2(u[i]);
    const float x = alpha_x * wx[i], y = alpha_y * wy[i], c = wz[i];
    const float s2 = x * x + y * y;
    const float r = __builtin_sqrtf(s2 + c * c);
    // Λ = (r - c)/(2c), for rising and falling rays alike; r - c without cancellation where c is near r.
    const float difference = c > 0.0f ? s2 / (r + c) : r - c;
    tau[i] -= exponential * (2.0f * c / difference);
  }
}

/// Facets that the reverse of w sees: sample_visible_normal()'s GGX, in float and for a direction per lane.
LOBEFIT_CLONES [[gnu::noinline]] void meet(std::size_t n, float alpha_x, float alpha_y, const float* __restrict wx,
                                           const float* __restrict wy, const float* __restrict wz,
                                           const float* __restrict u, const float* __restrict v, float* __restrict mx,
                                           float* __restrict my, float* __restrict mz) {
#pragma GCC ivdep
  for (std::size_t i = 0; i < n; ++i) {
    const float dx = -alpha_x * wx[i], dy = -alpha_y * wy[i], dz = -wz[i];
    const float across2 = dx * dx + dy * dy;
    const float scale = 1.0f / __builtin_sqrtf(across2 + dz * dz);
    const float ex = dx * scale, ey = dy * scale, ez = dz * scale;
    const bool vertical = across2 < 1e-30f;
    const float inverse = 1.0f / __builtin_sqrtf(vertical ? 1.0f : across2);
    const float t1x = vertical ? 1.0f : -dy * inverse;
    const float t1y = vertical ? 0.0f : dx * inverse;
    const float t2x = -ez * t1y, t2y = ez * t1x, t2z = ex * t1y - ey * t1x;
    float cosine, sine;
    float_cosine_and_sine_of_turns(v[i], cosine, sine);
    const float radius = __builtin_sqrtf(u[i]);
    const float p1 = radius * cosine;
    const float s = 0.5f * (1.0f + ez);
    const float left = 1.0f - p1 * p1;
    const float p2 = (1.0f - s) * __builtin_sqrtf(left > 0.0f ? left : 0.0f) + s * radius * sine;
    const float rest = left - p2 * p2;
    const float p3 = __builtin_sqrtf(rest > 0.0f ? rest : 0.0f);
    const float z = t2z * p2 + ez * p3;
    const float x = alpha_x * (t1x * p1 + t2x * p2 + ex * p3);
    const float y = alpha_y * (t1y * p1 + t2y * p2 + ey * p3);
    const float up = z > 0.0f ? z : 0.0f;
    const float squared = x * x + y * y + up * up;
    const float length = 1.0f / __builtin_sqrtf(squared > 1e-30f ? squared : 1e-30f);
    mx[i] = x * length, my[i] = y * length, mz[i] = up * length;
  }
}

/// Moves the lanes that are kept to the front: kept[k] ≥ k, so that no lane is overwritten before it has moved.
LOBEFIT_CLONES [[gnu::noinline]] void compact(std::size_t n, const std::uint32_t* __restrict kept,
                                              float* __restrict wx, float* __restrict wy, float* __restrict wz,
                                              float* __restrict tau, std::uint32_t* __restrict index) {
#pragma GCC ivdep
  for (std::size_t k = 0; k < n; ++k) {
    const std::uint32_t i = kept[k];
    const float x = wx[i], y = wy[i], z = wz[i], depth = tau[i];
    const std::uint32_t number = index[i];
    wx[k] = x, wy[k] = y, wz[k] = z, tau[k] = depth, index[k] = number;
  }
}

/// Depth where a ray from above first meets a facet.
LOBEFIT_CLONES [[gnu::noinline]] void enter(std::size_t n, float inverse_rate, const float* __restrict u,
                                            float* __restrict tau) {
#pragma GCC ivdep
  for (std::size_t i = 0; i < n; ++i) tau[i] = -std::numbers::ln2_v<float> * inverse_rate * float_log2(u[i]);
}

}  // namespace

LightLanes::LightLanes(Distribution distribution, Alpha alpha, std::span<const Direction> wi) {
  const auto push = [](const Direction& w, std::vector<float>& x, std::vector<float>& y, std::vector<float>& z) {
    x.push_back(static_cast<float>(w.x)), y.push_back(static_cast<float>(w.y)), z.push_back(static_cast<float>(w.z));
  };
  const auto pad = [](std::vector<float>& x, std::vector<float>& y, std::vector<float>& z) {
    for (std::vector<float>* component : {&x, &y, &z}) component->resize(round_up(component->size(), lanes));
  };
  for (std::size_t j = 0; j < wi.size(); ++j) {
    const auto lambda = static_cast<float>(smith_lambda(distribution, alpha, wi[j]));
    if (groups_.empty() || groups_.back().lambda != lambda) {
      pad(gx_, gy_, gz_);
      groups_.push_back({gx_.size(), 0, j, 0, lambda});
    }
    push(wi[j], x_, y_, z_);
    push(wi[j], gx_, gy_, gz_);
    ++groups_.back().lights;
  }
  pad(x_, y_, z_);
  pad(gx_, gy_, gz_);
  for (Group& group : groups_) group.lanes = round_up(group.lights, lanes);
  lane_sums_.resize(std::max(x_.size(), gx_.size()));
}

void LightLanes::add(std::span<const float> mx, std::span<const float> my, std::span<const float> mz,
                     std::span<const float> tau, std::span<double> sums) {
  for (std::vector<float>* scaled : {&scaled_x_, &scaled_y_, &scaled_z_}) scaled->assign(block, 0.0f);
  for (std::size_t first = 0; first < mx.size(); first += block) {
    const std::size_t count = std::min(block, mx.size() - first), whole = round_up(count, pack);
    // A facet of zeros adds nothing.
    const auto clear_rest = [&] {
      for (std::vector<float>* scaled : {&scaled_x_, &scaled_y_, &scaled_z_}) {
        std::fill(scaled->begin() + static_cast<std::ptrdiff_t>(count),
                  scaled->begin() + static_cast<std::ptrdiff_t>(whole), 0.0f);
      }
    };
    std::fill(lane_sums_.begin(), lane_sums_.end(), 0.0f);
    if (tau.empty()) {
      std::copy_n(mx.begin() + static_cast<std::ptrdiff_t>(first), count, scaled_x_.begin());
      std::copy_n(my.begin() + static_cast<std::ptrdiff_t>(first), count, scaled_y_.begin());
      std::copy_n(mz.begin() + static_cast<std::ptrdiff_t>(first), count, scaled_z_.begin());
      clear_rest();
      add_visible_cosines(scaled_x_.data(), scaled_y_.data(), scaled_z_.data(), whole, x_.data(), y_.data(), z_.data(),
                          x_.size(), lane_sums_.data());
      for (std::size_t j = 0; j < sums.size(); ++j) sums[j] += static_cast<double>(lane_sums_[j]);
      continue;
    }
    for (const Group& group : groups_) {
      shadow(mx.data() + first, my.data() + first, mz.data() + first, tau.data() + first,
             -std::numbers::log2e_v<float> * group.lambda, count, scaled_x_.data(), scaled_y_.data(), scaled_z_.data());
      clear_rest();
      float* group_sums = lane_sums_.data() + group.first;
      add_visible_cosines(scaled_x_.data(), scaled_y_.data(), scaled_z_.data(), whole, gx_.data() + group.first,
                          gy_.data() + group.first, gz_.data() + group.first, group.lanes, group_sums);
      for (std::size_t j = 0; j < group.lights; ++j) {
        sums[group.first_light + j] += static_cast<double>(group_sums[j]);
      }
    }
  }
}

void WalkLanes::resize(std::size_t n) {
  if (index_.size() >= n) return;
  index_.resize(n);
  kept_.resize(n);
  for (std::vector<float>* array : {&mx_, &my_, &mz_, &wx_, &wy_, &wz_, &tau_, &spare_, &u_, &v_, &s_, &t_}) {
    array->resize(n);
  }
}

void WalkLanes::start(std::uint32_t first, std::span<const float> mx, std::span<const float> my,
                      std::span<const float> mz, double lambda) {
  count_ = mx.size();
  resize(count_);
  pair_ = 1;
  for (std::size_t i = 0; i < count_; ++i) index_[i] = first + static_cast<std::uint32_t>(i);
  std::copy(mx.begin(), mx.end(), mx_.begin());
  std::copy(my.begin(), my.end(), my_.begin());
  std::copy(mz.begin(), mz.end(), mz_.begin());
  const std::span<const std::uint32_t> indices = std::span(index_).first(count_);
  points_->fill(pair_++, indices, u_, v_);
  enter(count_, static_cast<float>(1.0 / (1.0 + lambda)), u_.data(), tau_.data());
  // v_ holds the numbers of the first flight.
}

std::size_t WalkLanes::advance() {
  const auto alpha_x = static_cast<float>(alpha_.x), alpha_y = static_cast<float>(alpha_.y);
  const std::span<const std::uint32_t> indices = std::span(index_).first(count_);
  points_->fill(pair_++, indices, s_, t_);
  scatter(count_, mx_.data(), my_.data(), mz_.data(), s_.data(), t_.data(), wx_.data(), wy_.data(), wz_.data());
  fly(count_, alpha_x, alpha_y, wx_.data(), wy_.data(), wz_.data(), v_.data(), tau_.data());
  std::size_t left = 0;
  for (std::size_t i = 0; i < count_; ++i) {
    kept_[left] = static_cast<std::uint32_t>(i);
    left += tau_[i] >= 0.0f ? 1 : 0;
  }
  count_ = left;
  compact(count_, kept_.data(), wx_.data(), wy_.data(), wz_.data(), tau_.data(), index_.data());
  const std::span<const std::uint32_t> survivors = std::span(index_).first(count_);
  points_->fill(pair_++, survivors, s_, t_);
  meet(count_, alpha_x, alpha_y, wx_.data(), wy_.data(), wz_.data(), s_.data(), t_.data(), mx_.data(), my_.data(),
       mz_.data());
  // One number for the next flight; its twin is left over.
  points_->fill(pair_++, survivors, v_, u_);
  return count_;
}

}  // namespace lobefit
