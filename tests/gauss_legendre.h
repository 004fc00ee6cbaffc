// Gauss-Legendre quadrature, for the integrals that tests hold models to.
#pragma once

#include <cmath>
#include <numbers>
#include <vector>

namespace lobefit {

struct QuadraturePoint {
  double x, weight;
};

/// Points and weights of the n-point rule on [lower, upper]; exact for polynomials up to degree 2n - 1.
inline std::vector<QuadraturePoint> gauss_legendre(int n, double lower, double upper) {
  std::vector<QuadraturePoint> points;
  for (int k = 0; k < n; ++k) {
    // Newton's iteration on P_n from Tricomi's estimate of its root; quadratic, so ten steps are plenty.
    double x = std::cos(std::numbers::pi * (k + 0.75) / (n + 0.5)), slope = 1.0;
    for (int step = 0; step < 10; ++step) {
      double previous = 1.0, value = x;
      for (int degree = 2; degree <= n; ++degree) {
        const double next = ((2 * degree - 1) * x * value - (degree - 1) * previous) / degree;
        previous = value;
        value = next;
      }
      slope = n * (x * value - previous) / (x * x - 1.0);
      x -= value / slope;
    }
    const double half = 0.5 * (upper - lower);
    points.push_back({lower + half * (1.0 + x), half * 2.0 / ((1.0 - x * x) * slope * slope)});
  }
  return points;
}

}  // namespace lobefit
