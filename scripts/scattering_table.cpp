// Writes models/substrate/thin_scattering_entries.h to standard output; scripts/scattering_table runs it.
//
// Adding-doubling gives f of isotropic slabs, and so P(i, o) = 4π (μi + μo) f/ω = (S(i) D(o) + D(i) S(o))/2 over a
// grid. P is the same for S c and D/c: P(i, i) = S(i) D(i) and P(i, o)² = P(i, i) P(o, o) cosh²(½ ln of the quotient of
// S/D at i and at o) leave c open, which the smallest cosine fixes: σ and δ vanish with μ.
#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <Eigen/Core>
#include <Eigen/QR>
#include <cmath>
#include <vector>

#include "models/substrate/thin_scattering.h"
#include "reference/layered/adding_doubling.h"

namespace lobefit {
namespace {

struct SlabData {
  IsotropicSlab<double> slab;
  std::vector<double> symmetric, antisymmetric;  // σ and δ at the cosines
};

/// From 1e-3, evenly over √μ.
std::vector<double> grid_cosines() {
  std::vector<double> cosines{1e-3};
  for (int k = 0; k < 14; ++k) cosines.push_back((k + 0.6) / 14 * ((k + 0.6) / 14));
  cosines.push_back(1.0);
  return cosines;
}

SlabData solve(double absorption, double depth, const std::vector<double>& cosines) {
  const double albedo = 1.0 - absorption;
  LayerStack stack;
  stack.layers.push_back(MediumLayer{.albedo = {albedo, albedo, albedo}, .thickness = depth});
  stack.bottom = DiffuseLayer{};
  const AddingDoubling exact(stack, cosines, cosines, {.streams = 48, .modes = 1});
  const auto p = [&](std::size_t i, std::size_t o) {
    return 4.0 * pi * (cosines[i] + cosines[o]) * exact.azimuthal_mean(i, o).x / albedo;
  };
  SlabData data{.slab = IsotropicSlab<double>::make(albedo, absorption, depth)};
  for (std::size_t i = 0; i < cosines.size(); ++i) {
    const double tanh = std::tanh(0.5 * depth / cosines[i]);
    // √(S/D tanh(x/2)) = √((1 + σ)/(1 + δ)), 1 at the smallest cosine.
    const double quotient = std::exp(std::acosh(std::max(p(i, 0) / std::sqrt(p(i, i) * p(0, 0)), 1.0))) *
                            std::sqrt(tanh / std::tanh(0.5 * depth / cosines[0]));
    // P(i, i) = (1 - e²) (1 + σ)(1 + δ).
    const double mean = std::sqrt(p(i, i) / -std::expm1(-2.0 * depth / cosines[i]));
    data.symmetric.push_back(mean * quotient - 1.0);
    data.antisymmetric.push_back(mean / quotient - 1.0);
  }
  return data;
}

/// Coefficients of the correction that minimises the relative errors of 1 + `truth`.
template <class Truth, class Approximation>
std::string fitted(const char* name, const std::vector<SlabData>& grid, const std::vector<double>& cosines,
                   Truth&& truth, Approximation&& approximation) {
  const auto rows = static_cast<Eigen::Index>(grid.size() * cosines.size());
  Eigen::MatrixXd matrix(rows, scattering_terms);
  Eigen::VectorXd right(rows);
  Eigen::Index row = 0;
  for (const SlabData& data : grid) {
    const double x = 2.0 * data.slab.gamma - 1.0, y = 2.0 * data.slab.depth_coordinate - 1.0;
    for (std::size_t c = 0; c < cosines.size(); ++c, ++row) {
      const double z = 2.0 * data.slab.direction_coordinate(cosines[c]) - 1.0;
      const double exact = truth(data)[c], weight = 1.0 / (1.0 + exact);
      const double first = approximation(data.slab, cosines[c], CothExcess::evaluate(data.slab.depth / cosines[c]));
      Eigen::Index column = 0;
      // Highest powers first, as SlabCorrection reads them.
      for (int m = scattering_mu_terms; m-- > 0;) {
        for (int j = scattering_gamma_terms; j-- > 0;) {
          for (int k = scattering_depth_terms; k-- > 0;) {
            matrix(row, column++) = weight * first * std::pow(z, m) * std::pow(x, j) * std::pow(y, k);
          }
        }
      }
      right(row) = weight * exact;
    }
  }
  const Eigen::VectorXd solution = matrix.colPivHouseholderQr().solve(right);
  const Eigen::VectorXd error = matrix * solution - right;
  fmt::print(stderr, "{}: rms {:.1e}, worst {:.1e}, largest coefficient {:.3g}\n", name,
             std::sqrt(error.squaredNorm() / static_cast<double>(rows)), error.cwiseAbs().maxCoeff(),
             solution.cwiseAbs().maxCoeff());
  std::string text = fmt::format("inline constexpr std::array<float, scattering_terms> {}{{\n", name);
  for (const double coefficient : solution) text += fmt::format("{:#.9g}f, ", coefficient);
  return text + "};\n";
}

std::string entries() {
  const std::vector<double> cosines = grid_cosines();
  struct Place {
    double absorption, depth;
  };
  std::vector<Place> places;
  for (int j = 0; j <= 8; ++j) {
    const double gamma = 0.5 * (1.0 - std::cos(pi * j / 8.0));
    const double absorption = std::min(gamma * gamma, 0.999);  // P is defined, and independent of ω, in the limit
    for (int k = 0; k <= 24; ++k) places.push_back({absorption, std::pow(10.0, -2.5 + 4.2 * k / 24.0)});
    // As good as infinite, but for ω = 1, where the solver's rounding makes light.
    if (j > 0) places.push_back({absorption, 1000.0});
  }
  std::vector<SlabData> grid(places.size());
  tbb::parallel_for(std::size_t{0}, places.size(),
                    [&](std::size_t k) { grid[k] = solve(places[k].absorption, places[k].depth, cosines); });
  return fitted(
             "scattering_symmetric_entries", grid, cosines, [](const SlabData& d) { return d.symmetric; },
             [](const auto& slab, double mu, double excess) { return slab.symmetric(mu, excess); }) +
         fitted(
             "scattering_antisymmetric_entries", grid, cosines, [](const SlabData& d) { return d.antisymmetric; },
             [](const auto& slab, double mu, double excess) { return slab.antisymmetric(mu, excess); });
}

}  // namespace
}  // namespace lobefit

int main() {
  using namespace lobefit;
  fmt::print(R"(// Written by scripts/scattering_table: the coefficients that thin_scattering.h reads.
#pragma once

#include <array>

namespace lobefit {{

inline constexpr int scattering_mu_terms = {}, scattering_gamma_terms = {}, scattering_depth_terms = {};
inline constexpr int scattering_terms = scattering_mu_terms * scattering_gamma_terms * scattering_depth_terms;
{}
}}  // namespace lobefit
)",
             scattering_mu_terms, scattering_gamma_terms, scattering_depth_terms, entries());
}
