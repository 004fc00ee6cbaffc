// All bounces of light between Lambertian Smith microfacets, without random numbers.
//
// In the Smith model of multiple scattering (Heitz, Hanika, d'Eon, Dachsbacher 2016) the distribution of heights C1
// drops out once depth is measured by τ = -ln C1: a ray of direction w meets facets at rate |Λ(w)| per unit of τ, with
// Λ of a falling ray = -1 - Λ(-w). What is left is a half space of facets that scatters light from -a to b with rate
// κ(a, b)/a_z, κ(a, b) = 1/π ∫ (a·m)⁺ (b·m)⁺ D(m) dm. Adding a thin layer to a half space changes nothing
// (Ambartsumian), so order n of its BRDF f follows from the orders before it, with no integral over depth:
//
//   (1 + Λo + Λi) μo μi f_n(o, i) = [n = 1] κ(o, i) + μi ∫ κ(o, -u) f_{n-1}(u, i) du + μo ∫ f_{n-1}(o, u) κ(-u, i) du
//                                 + μo μi Σ_{j+k=n-1} ∫∫ f_j(o, u) κ(-u, -v) f_k(v, i) du dv.
//
// Azimuths are Fourier modes, in which all of these are matrix products. κ needs no double integral either: the modes
// of (a·m)⁺ over the azimuth of m are closed forms, and the modes of κ are sums of their products over the slope of m.
#pragma once

#include <Eigen/Core>
#include <map>
#include <memory>
#include <mutex>
#include <span>
#include <vector>

#include "models/geometry.h"
#include "models/microfacet/distribution.h"

namespace lobefit {

class SmithOrders {
 public:
  /// How fine the solution is: polar angles per hemisphere, Fourier modes, points per interval of facet slopes.
  struct Resolution {
    int polar = 40, modes = 32, slopes = 8;
  };

  /// Solves for the orders from 2 up to `most_orders`, fewer if what is left falls below 1e-10 of the light.
  SmithOrders(Distribution distribution, double alpha, int most_orders, const Resolution& resolution);
  SmithOrders(Distribution distribution, double alpha, int most_orders)
      : SmithOrders(distribution, alpha, most_orders, Resolution()) {}

  /// Highest order that was solved for.
  int orders() const { return orders_; }
  /// f_n per unit albedo^n for n = 1, …, orders(); order 1 is left at 0, its own quadrature is more exact
  /// (shared_visibility).
  std::vector<double> evaluate(const Direction& wi, const Direction& wo) const;
  /// The same for a line of lights: [order][light]. Lights of one polar angle share nearly all of the work.
  std::vector<double> evaluate(std::span<const Direction> wi, const Direction& wo) const;
  /// Directional albedo of every order for light from polar cosine `mu`.
  std::vector<double> albedo(double mu) const;

 private:
  using Matrix = Eigen::MatrixXd;
  using Vector = Eigen::VectorXd;

  /// Modes of (a·m)⁺, times the root of the weights of the facet slopes: a row per direction.
  struct SlopeRule {
    std::vector<double> x, weight;
  };
  struct Mode {
    Matrix down_up;            // κ(-u, i): rows falling u, columns i
    Matrix down_down;          // κ(-u, -v)
    std::vector<Matrix> f;     // f[n]: order n, over grid × grid
    std::vector<Matrix> back;  // back[n] = κ(-u, -v) f_n(v, i), summed over v
  };
  /// What the solution needs of one direction off the grid.
  struct Row {
    double mu = 0.0, lambda = 0.0;
    std::vector<Vector> down_up;  // [mode] κ(x, -u) over the grid
    std::vector<Matrix> f;        // [mode] f_n(x, i): grid × order, column 0 unused
    std::vector<Matrix> back;     // [mode] κ(-u, -v) f_n(v, x), summed over v
  };

  double scale(double mu_a, double lambda_a, double mu_b, double lambda_b) const;
  std::shared_ptr<const Row> row(double mu) const;
  /// Fourier modes of f_n, n = 2, 3, …, between two polar cosines: mode × order.
  Matrix azimuthal_modes(double mu_a, double mu_b) const;
  SlopeRule slope_rule(double extra_knot) const;
  /// [mode] modes of (a·m)⁺ for a of polar cosine `mu` at the slopes of `rule`, as columns of slopes.
  Matrix visible_modes(double mu, const SlopeRule& rule) const;

  Distribution distribution_;
  double alpha_;
  Resolution resolution_;
  int orders_ = 0;
  Vector mu_, weight_, lambda_;  // the grid of polar angles; weights of ∫ dμ dφ
  std::vector<double> knots_;
  std::vector<Mode> modes_;
  mutable std::mutex mutex_;
  mutable std::map<double, std::shared_ptr<const Row>> rows_;
};

}  // namespace lobefit
