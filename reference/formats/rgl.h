// Measurements of the RGL material database (Dupuy and Jakob 2018, "An adaptive parameterization for efficient material
// acquisition and rendering"): tensor files `.bsdf`, RGB or spectral, isotropic or anisotropic.
//
// With the light wi, the view wo and m = normalise(wi + wo), the file's coordinates are u = (√(2 θ_m/π), (φ_m + π)/2π),
// φ_m counted from the light's azimuth where the material is isotropic, and s, the image of u under the cumulative
// distribution of the file's visible normals at this light. Data live on a grid in s:
//
//   f cos θ_o = data(s) ndf(u) / (4 sigma(u_i)),   dω_o = 4 (wi·m) sin θ_m 2π² u_x / vndf(u) ds.
//
// Where vndf is what ndf says it is, the integrand of the albedo is data(s) itself: integrals converge on its own grid.
#pragma once

#include <array>
#include <cstddef>
#include <string>
#include <vector>

#include "reference/albedo.h"
#include "reference/formats/tensor_file.h"
#include "reference/table.h"

namespace lobefit {

/// Densities over the unit square, linear between the nodes of a grid, at the nodes of up to two further parameters;
/// between those both the densities and what follows from them are mixed.
class SquareDensities {
 public:
  struct Mix {
    std::array<std::size_t, 4> slice;
    std::array<double, 4> weight;
  };
  struct Point {
    double x, y, density;
  };

  SquareDensities() = default;
  /// values[slice][y][x]; each slice is scaled to integrate to 1.
  SquareDensities(std::vector<float> values, std::size_t nx, std::size_t ny);
  /// From the square of equal masses into the density's own coordinates; its density there.
  Point sample(double s_x, double s_y, const Mix& mix) const;
  /// The inverse: s, and the density at (x, y).
  Point invert(double x, double y, const Mix& mix) const;

 private:
  double mixed(const std::vector<float>& values, std::size_t index, std::size_t slice_size, const Mix& mix) const;

  std::size_t nx_ = 0, ny_ = 0;
  std::vector<float> density_, row_sums_, line_sums_;  // [slice][y][x], [slice][y][x] along x, [slice][y] along y
};

class RglMaterial {
 public:
  /// Throws Error(invalid_input) for fields that are missing, of wrong shapes, or not finite.
  RglMaterial(TensorFile tensors, const std::string& place);

  /// BRDF in 1/sr, negative values as 0 like the database's own reader; 0 under the surface. wi is the light.
  Rgb evaluate(const Direction& wi, const Direction& wo) const;
  /// ∫ f cos θ_o dω_o with the light at `theta` (radians) and azimuth 0, in the file's own coordinates.
  Albedo albedo_of_light(double theta) const;
  /// The file's own grid as a list: lines are theta_i, columns s_y, s_x per phi_i. Negative values are kept.
  Table table() const;
  const TensorFile& tensors() const { return tensors_; }
  bool isotropic() const { return isotropic_; }

 private:
  struct Light {
    SquareDensities::Mix mix;
    double sigma;
    double phi;  // azimuth that normals are counted from
  };
  Light light_at(double theta, double phi) const;
  double ndf(double u_x, double u_y) const;
  /// Data at s, not yet scaled.
  Rgb data(double s_x, double s_y, const SquareDensities::Mix& mix) const;

  TensorFile tensors_;
  std::string description_;
  bool isotropic_ = true;
  int reduction_ = 1;  // the azimuths of the light cover 1 / reduction of the circle
  std::vector<float> theta_i_, phi_i_, sigma_, ndf_, rgb_;
  std::array<std::size_t, 2> sigma_size_, ndf_size_, data_size_;  // (x, y)
  SquareDensities vndf_;
};

/// Weights of samples of a spectrum for linear Rec.709 RGB under D65: [sample][channel], columns summing to 1, so that
/// a constant reflectance is grey. `wavelengths` in nm, increasing.
std::vector<std::array<double, 3>> spectrum_to_rgb(const std::vector<float>& wavelengths);

}  // namespace lobefit
