#include "reference/formats/rgl.h"

#include <algorithm>
#include <cmath>

#include "models/error.h"

namespace lobefit {

namespace {

/// Where `value` lies between the nodes of an increasing axis; outside them at its ends.
struct Between {
  std::size_t below, above;
  double fraction;
};
Between locate(const std::vector<float>& axis, double value) {
  const auto above = static_cast<std::size_t>(std::upper_bound(axis.begin(), axis.end(), value) - axis.begin());
  if (above == 0) return {0, 0, 0.0};
  if (above == axis.size()) return {above - 1, above - 1, 0.0};
  return {above - 1, above, (value - axis[above - 1]) / (double{axis[above]} - axis[above - 1])};
}

/// Cell and fraction of a coordinate in [0, 1] on a grid of n > 1 nodes.
struct Cell {
  std::size_t index;
  double fraction;
};
Cell cell(double x, std::size_t n) {
  const double scaled = std::clamp(x, 0.0, 1.0) * static_cast<double>(n - 1);
  const std::size_t index = std::min(static_cast<std::size_t>(scaled), n - 2);
  return {index, scaled - static_cast<double>(index)};
}

double bilinear(const float* values, std::size_t nx, std::size_t ny, double x, double y) {
  const Cell i = cell(x, nx), j = cell(y, ny);
  const float* corner = values + j.index * nx + i.index;
  return (1.0 - j.fraction) * ((1.0 - i.fraction) * corner[0] + i.fraction * corner[1]) +
         j.fraction * ((1.0 - i.fraction) * corner[nx] + i.fraction * corner[nx + 1]);
}

/// t in [0, 1] with a t + (b - a) t²/2 = mass, for a density that goes from a ≥ 0 to b ≥ 0.
double invert_linear(double a, double b, double mass) {
  const double root = std::sqrt(std::max(0.0, a * a + 2.0 * (b - a) * mass));
  return a + root > 0.0 ? std::clamp(2.0 * mass / (a + root), 0.0, 1.0) : 0.0;
}

double phase(double azimuth) {
  const double u = (azimuth + pi) / (2.0 * pi);
  return u - std::floor(u);
}

// The normal that u stands for, before it is turned to the light's azimuth.
double theta_of(double u_x) { return 0.5 * pi * u_x * u_x; }
double azimuth_of(double u_y) { return (2.0 * u_y - 1.0) * pi; }

/// dω_o / du for the light's cosine with the normal.
double solid_angle_density(double u_x, double cos_d) {
  return 4.0 * cos_d * std::sin(theta_of(u_x)) * 2.0 * pi * pi * u_x;
}

}  // namespace

SquareDensities::SquareDensities(std::vector<float> values, std::size_t nx, std::size_t ny)
    : nx_(nx), ny_(ny), density_(std::move(values)), row_sums_(density_.size()), line_sums_(density_.size() / nx) {
  const double hx = 1.0 / static_cast<double>(nx - 1), hy = 1.0 / static_cast<double>(ny - 1);
  const std::size_t slice = nx * ny;
  std::vector<double> rows(slice), lines(ny);
  for (std::size_t first = 0; first < density_.size(); first += slice) {
    float* density = density_.data() + first;
    for (std::size_t y = 0; y < ny; ++y) {
      rows[y * nx] = 0.0;
      for (std::size_t x = 1; x < nx; ++x) {
        rows[y * nx + x] = rows[y * nx + x - 1] + 0.5 * hx * (double{density[y * nx + x - 1]} + density[y * nx + x]);
      }
      lines[y] = y == 0 ? 0.0 : lines[y - 1] + 0.5 * hy * (rows[(y - 1) * nx + nx - 1] + rows[y * nx + nx - 1]);
    }
    const double scale = lines.back() > 0.0 ? 1.0 / lines.back() : 0.0;
    for (std::size_t k = 0; k < slice; ++k) {
      density[k] = static_cast<float>(scale * density[k]);
      row_sums_[first + k] = static_cast<float>(scale * rows[k]);
    }
    for (std::size_t y = 0; y < ny; ++y) line_sums_[first / nx + y] = static_cast<float>(scale * lines[y]);
  }
}

double SquareDensities::mixed(const std::vector<float>& values, std::size_t index, std::size_t slice_size,
                              const Mix& mix) const {
  double sum = 0.0;
  for (std::size_t k = 0; k < mix.slice.size(); ++k) {
    if (mix.weight[k] != 0.0) sum += mix.weight[k] * values[mix.slice[k] * slice_size + index];
  }
  return sum;
}

SquareDensities::Point SquareDensities::sample(double s_x, double s_y, const Mix& mix) const {
  const std::size_t slice = nx_ * ny_;
  const double hx = 1.0 / static_cast<double>(nx_ - 1), hy = 1.0 / static_cast<double>(ny_ - 1);
  // The last node whose sum does not exceed `mass`, and not the very last.
  const auto last_below = [](std::size_t n, double mass, const auto& sum) {
    std::size_t low = 0, high = n - 1;
    while (high - low > 1) {
      const std::size_t middle = (low + high) / 2;
      (sum(middle) <= mass ? low : high) = middle;
    }
    return low;
  };
  const double mass_y = std::clamp(s_y, 0.0, 1.0) * mixed(line_sums_, ny_ - 1, ny_, mix);
  const std::size_t j = last_below(ny_, mass_y, [&](std::size_t y) { return mixed(line_sums_, y, ny_, mix); });
  const auto row_total = [&](std::size_t y) { return mixed(row_sums_, y * nx_ + nx_ - 1, slice, mix); };
  const double row_0 = row_total(j), row_1 = row_total(j + 1);
  const double t = invert_linear(row_0, row_1, (mass_y - mixed(line_sums_, j, ny_, mix)) / hy);
  const auto along = [&](const std::vector<float>& values, std::size_t x) {
    return (1.0 - t) * mixed(values, j * nx_ + x, slice, mix) + t * mixed(values, (j + 1) * nx_ + x, slice, mix);
  };
  const double mass_x = std::clamp(s_x, 0.0, 1.0) * ((1.0 - t) * row_0 + t * row_1);
  const std::size_t i = last_below(nx_, mass_x, [&](std::size_t x) { return along(row_sums_, x); });
  const double density_0 = along(density_, i), density_1 = along(density_, i + 1);
  const double r = invert_linear(density_0, density_1, (mass_x - along(row_sums_, i)) / hx);
  return {(static_cast<double>(i) + r) * hx, (static_cast<double>(j) + t) * hy, (1.0 - r) * density_0 + r * density_1};
}

SquareDensities::Point SquareDensities::invert(double x, double y, const Mix& mix) const {
  const std::size_t slice = nx_ * ny_;
  const double hx = 1.0 / static_cast<double>(nx_ - 1), hy = 1.0 / static_cast<double>(ny_ - 1);
  const Cell i = cell(x, nx_), j = cell(y, ny_);
  const auto along = [&](const std::vector<float>& values, std::size_t column) {
    const std::size_t index = j.index * nx_ + column;
    return (1.0 - j.fraction) * mixed(values, index, slice, mix) + j.fraction * mixed(values, index + nx_, slice, mix);
  };
  const double density_0 = along(density_, i.index), density_1 = along(density_, i.index + 1);
  const double r = i.fraction, t = j.fraction;
  const double total = along(row_sums_, nx_ - 1);
  const double before = along(row_sums_, i.index) + hx * (r * density_0 + 0.5 * r * r * (density_1 - density_0));
  const double row_0 = mixed(row_sums_, j.index * nx_ + nx_ - 1, slice, mix);
  const double row_1 = mixed(row_sums_, (j.index + 1) * nx_ + nx_ - 1, slice, mix);
  const double below = mixed(line_sums_, j.index, ny_, mix) + hy * (t * row_0 + 0.5 * t * t * (row_1 - row_0));
  return {total > 0.0 ? std::clamp(before / total, 0.0, 1.0) : 0.0, std::clamp(below, 0.0, 1.0),
          (1.0 - r) * density_0 + r * density_1};
}

RglMaterial::RglMaterial(TensorFile tensors, const std::string& place) : tensors_(std::move(tensors)) {
  const auto invalid = [&](const std::string& what) {
    return Error(ExitCode::invalid_input, what, place, "give a measurement of the RGL material database");
  };
  const auto field = [&](const char* name, std::size_t dimensions) -> const Tensor& {
    const Tensor* found = tensors_.find(name);
    if (!found) throw invalid("a tensor file, but without a field '" + std::string(name) + "'");
    if (found->type != Tensor::f32 || found->shape.size() != dimensions) {
      throw invalid("field '" + std::string(name) + "' is no array of 32-bit floats with " +
                    std::to_string(dimensions) + " axes");
    }
    return *found;
  };
  const auto values_of = [&](const Tensor& tensor, bool non_negative) {
    std::vector<float> values = tensor.floats();
    for (std::size_t k = 0; k < values.size(); ++k) {
      if (!std::isfinite(values[k]) || (non_negative && values[k] < 0.0f)) {
        throw invalid("field '" + tensor.name + "' has a number that is " +
                      (std::isfinite(values[k]) ? "negative" : "not finite") + ", byte " +
                      std::to_string(tensor.offset + k * sizeof(float)));
      }
    }
    return values;
  };
  const auto increasing = [&](const char* name) {
    std::vector<float> values = values_of(field(name, 1), false);
    for (std::size_t k = 1; k < values.size(); ++k) {
      if (!(values[k] > values[k - 1])) throw invalid("field '" + std::string(name) + "' does not increase");
    }
    return values;
  };
  theta_i_ = increasing("theta_i");
  phi_i_ = increasing("phi_i");
  if (theta_i_.front() < 0.0f || theta_i_.back() > 1.5709f) throw invalid("field 'theta_i' leaves 0 … pi/2");

  const auto picture = [&](const char* name, std::array<std::size_t, 2>& size) {
    const Tensor& tensor = field(name, 2);
    size = {tensor.shape[1], tensor.shape[0]};
    if (size[0] < 2 || size[1] < 2) throw invalid("field '" + std::string(name) + "' is smaller than 2 by 2");
    return values_of(tensor, true);
  };
  sigma_ = picture("sigma", sigma_size_);
  ndf_ = picture("ndf", ndf_size_);

  const auto per_light = [&](const Tensor& tensor) {
    if (tensor.shape[0] != phi_i_.size() || tensor.shape[1] != theta_i_.size()) {
      throw invalid("the first axes of field '" + tensor.name + "' are not those of phi_i and theta_i");
    }
    const std::size_t n = tensor.shape.size();
    if (tensor.shape[n - 1] < 2 || tensor.shape[n - 2] < 2) {
      throw invalid("field '" + tensor.name + "' is smaller than 2 by 2 per light");
    }
  };
  const Tensor& vndf = field("vndf", 4);
  per_light(vndf);
  vndf_ = SquareDensities(values_of(vndf, true), vndf.shape[3], vndf.shape[2]);

  if (tensors_.find("rgb")) {
    const Tensor& rgb = field("rgb", 5);
    per_light(rgb);
    if (rgb.shape[2] != 3) throw invalid("field 'rgb' has not 3 channels");
    data_size_ = {rgb.shape[4], rgb.shape[3]};
    rgb_ = values_of(rgb, false);
  } else if (tensors_.find("spectra")) {
    const std::vector<float> wavelengths = increasing("wavelengths");
    const Tensor& spectra = field("spectra", 5);
    per_light(spectra);
    if (spectra.shape[2] != wavelengths.size()) throw invalid("fields 'spectra' and 'wavelengths' have other lengths");
    data_size_ = {spectra.shape[4], spectra.shape[3]};
    const std::vector<float> all = values_of(spectra, false);
    const auto weights = spectrum_to_rgb(wavelengths);
    const std::size_t plane = data_size_[0] * data_size_[1], lights = phi_i_.size() * theta_i_.size();
    rgb_.assign(lights * 3 * plane, 0.0f);
    std::vector<double> sums(3 * plane);
    for (std::size_t light = 0; light < lights; ++light) {
      std::fill(sums.begin(), sums.end(), 0.0);
      for (std::size_t k = 0; k < weights.size(); ++k) {
        const float* source = all.data() + (light * weights.size() + k) * plane;
        for (std::size_t c = 0; c < 3; ++c) {
          for (std::size_t i = 0; i < plane; ++i) sums[c * plane + i] += weights[k][c] * source[i];
        }
      }
      for (std::size_t i = 0; i < sums.size(); ++i) rgb_[light * 3 * plane + i] = static_cast<float>(sums[i]);
    }
  } else {
    throw invalid("a tensor file, but without a field 'rgb' or 'spectra'");
  }

  isotropic_ = phi_i_.size() <= 2;
  if (!isotropic_) {
    reduction_ = static_cast<int>(std::lround(2.0 * pi / (double{phi_i_.back()} - phi_i_.front())));
    if (reduction_ != 1 && reduction_ != 2 && reduction_ != 4) {
      throw invalid("field 'phi_i' covers neither the circle nor a half or quarter of it");
    }
  }
  if (const Tensor* text = tensors_.find("description"); text && text->type == Tensor::u8) {
    description_ = text->bytes;
    for (char& c : description_)
      c = static_cast<unsigned char>(c) < 0x20 || static_cast<unsigned char>(c) > 0x7e ? '?' : c;
  }
}

RglMaterial::Light RglMaterial::light_at(double theta, double phi) const {
  const Between t = locate(theta_i_, theta), p = isotropic_ ? Between{0, 0, 0.0} : locate(phi_i_, phi);
  const std::size_t n = theta_i_.size();
  return {.mix = {.slice = {p.below * n + t.below, p.below * n + t.above, p.above * n + t.below, p.above * n + t.above},
                  .weight = {(1.0 - p.fraction) * (1.0 - t.fraction), (1.0 - p.fraction) * t.fraction,
                             p.fraction * (1.0 - t.fraction), p.fraction * t.fraction}},
          .sigma = bilinear(sigma_.data(), sigma_size_[0], sigma_size_[1], std::sqrt(2.0 * theta / pi), phase(phi)),
          .phi = isotropic_ ? phi : 0.0};
}

double RglMaterial::ndf(double u_x, double u_y) const {
  return bilinear(ndf_.data(), ndf_size_[0], ndf_size_[1], u_x, u_y);
}

Rgb RglMaterial::data(double s_x, double s_y, const SquareDensities::Mix& mix) const {
  const std::size_t plane = data_size_[0] * data_size_[1];
  std::array<double, 3> sum{};
  for (std::size_t k = 0; k < mix.slice.size(); ++k) {
    if (mix.weight[k] == 0.0) continue;
    for (std::size_t c = 0; c < 3; ++c) {
      sum[c] += mix.weight[k] *
                bilinear(rgb_.data() + (3 * mix.slice[k] + c) * plane, data_size_[0], data_size_[1], s_x, s_y);
    }
  }
  return {sum[0], sum[1], sum[2]};
}

Rgb RglMaterial::evaluate(const Direction& light, const Direction& view) const {
  if (!(light.z > 0.0 && view.z > 0.0)) return {};
  Direction wi = light, wo = view;
  // Files that cover part of the azimuths: a half circle (phi_i ≤ 0) by turning, a quarter by mirroring.
  if (reduction_ >= 2) {
    const bool flip_y = wi.y > 0.0, flip_x = reduction_ == 4 ? wi.x > 0.0 : flip_y;
    if (flip_x) wi.x = -wi.x, wo.x = -wo.x;
    if (flip_y) wi.y = -wi.y, wo.y = -wo.y;
  }
  const Direction m = normalize(wi + wo);
  const double sin_m = std::hypot(m.x, m.y), sin_i = std::hypot(wi.x, wi.y);
  const Light at = light_at(std::atan2(sin_i, wi.z), std::atan2(wi.y, wi.x));
  const double u_x = std::sqrt(2.0 * std::atan2(sin_m, m.z) / pi);
  const double u_y = phase(std::atan2(m.y, m.x) - at.phi);
  const SquareDensities::Point s = vndf_.invert(u_x, u_y, at.mix);
  const Rgb raw = data(s.x, s.y, at.mix);
  if (!(at.sigma > 0.0)) return {};
  return Rgb{max(raw.x, 0.0), max(raw.y, 0.0), max(raw.z, 0.0)} * (ndf(u_x, u_y) / (4.0 * at.sigma * wo.z));
}

Albedo RglMaterial::albedo_of_light(double theta) const {
  // The azimuths of a part lie at phi ≤ 0; phi = -pi stands for 0 there, by the symmetries above.
  const double azimuth = reduction_ >= 2 ? -pi : 0.0;
  const Direction wi = direction(theta, azimuth);
  const Light light = light_at(theta, azimuth);
  const auto integrate = [&](int n) {
    Rgb sum;
    for (int j = 0; j < n; ++j) {
      for (int i = 0; i < n; ++i) {
        const double s_x = (i + 0.5) / n, s_y = (j + 0.5) / n;
        const SquareDensities::Point u = vndf_.sample(s_x, s_y, light.mix);
        const Direction m = direction(theta_of(u.x), azimuth_of(u.y) + light.phi);
        const double cos_d = dot(wi, m);
        if (!(u.density > 0.0 && cos_d > 0.0 && 2.0 * cos_d * m.z - wi.z > 0.0)) continue;
        const Rgb raw = data(s_x, s_y, light.mix);
        sum = sum + Rgb{max(raw.x, 0.0), max(raw.y, 0.0), max(raw.z, 0.0)} *
                        (ndf(u.x, u.y) * solid_angle_density(u.x, cos_d) / u.density);
      }
    }
    return sum * (1.0 / (4.0 * light.sigma * n * n));
  };
  const Rgb coarse = integrate(128), fine = integrate(256);
  return {fine, {abs(fine.x - coarse.x), abs(fine.y - coarse.y), abs(fine.z - coarse.z)}};
}

Table RglMaterial::table() const {
  Table table;
  table.coordinates = Coordinates::list;
  const std::size_t phis = isotropic_ ? 1 : phi_i_.size(), nx = data_size_[0], ny = data_size_[1], plane = nx * ny;
  const auto in_degrees = [](const std::vector<float>& angles, std::size_t count) {
    std::vector<double> result;
    for (std::size_t k = 0; k < count; ++k) result.push_back(degrees(double{angles[k]}));
    return result;
  };
  table.grid.theta_o = {"theta_i", "degree", in_degrees(theta_i_, theta_i_.size()), false};
  table.grid.theta_i = {"phi_i", "degree", in_degrees(phi_i_, phis), false};
  table.grid.phi = {"sample", "", {}, false};
  for (std::size_t k = 0; k < plane; ++k) table.grid.phi.values.push_back(static_cast<double>(k));
  table.channels = 3;
  table.allocate();
  const std::vector<double> theta_weights = table.grid.theta_o.weights(), phi_weights = table.grid.theta_i.weights();
  const auto node_weight = [](std::size_t k, std::size_t n) {
    return (k == 0 || k + 1 == n ? 0.5 : 1.0) / static_cast<double>(n - 1);
  };
  constexpr double least_cosine = 1e-4;  // f cos θ is measured; closer to the horizon f is its noise
  for (std::size_t t = 0; t < theta_i_.size(); ++t) {
    for (std::size_t p = 0; p < phis; ++p) {
      const double phi = isotropic_ ? 0.0 : double{phi_i_[p]};
      const Direction wi = direction(double{theta_i_[t]}, phi);
      Light light = light_at(double{theta_i_[t]}, phi);
      // This node alone, without rounding between two.
      light.mix = {.slice = {p * theta_i_.size() + t, 0, 0, 0}, .weight = {1.0, 0.0, 0.0, 0.0}};
      const double light_measure =
          measured_sine(wi) * radians(theta_weights[t]) * (phis > 1 ? radians(phi_weights[p]) : 2.0 * pi);
      for (std::size_t k = 0; k < plane; ++k) {
        const std::size_t entry = (t * phis + p) * plane + k, i = k % nx, j = k / nx;
        const double s_x = static_cast<double>(i) / static_cast<double>(nx - 1);
        const double s_y = static_cast<double>(j) / static_cast<double>(ny - 1);
        const SquareDensities::Point u = vndf_.sample(s_x, s_y, light.mix);
        const Direction m = direction(theta_of(u.x), azimuth_of(u.y) + light.phi);
        const double cos_d = dot(wi, m);
        const Direction wo = m * (2.0 * cos_d) - wi;
        table.set_directions(entry, wi, wo);
        const bool usable = wi.z > least_cosine && wo.z > least_cosine && u.density > 0.0 && light.sigma > 0.0;
        table.valid[entry] = usable ? 1 : 0;
        if (!usable) continue;
        table.measure[entry] = static_cast<float>(light_measure * solid_angle_density(u.x, cos_d) / u.density *
                                                  node_weight(i, nx) * node_weight(j, ny));
        const double scale = ndf(u.x, u.y) / (4.0 * light.sigma * wo.z);
        for (std::size_t c = 0; c < 3; ++c) {
          const std::size_t slice = p * theta_i_.size() + t;
          table.values[c * table.entries() + entry] = static_cast<float>(scale * rgb_[(3 * slice + c) * plane + k]);
        }
      }
    }
  }
  table.model = "measured";
  table.parameters = {{"format", "rgl"}, {"description", description_}, {"isotropic", isotropic_}};
  table.method = "measured";
  table.mask_what_is_not_finite(0, table.entries());
  return table;
}

std::vector<std::array<double, 3>> spectrum_to_rgb(const std::vector<float>& wavelengths) {
  // D65 from 380 to 780 nm by 10 (CIE 15).
  constexpr std::array<double, 41> d65{49.9755, 54.6482, 82.7549, 91.486,  93.4318, 86.6823, 104.865, 117.008, 117.812,
                                       114.861, 115.923, 108.811, 109.354, 107.802, 104.79,  107.689, 104.405, 104.046,
                                       100.0,   96.3342, 95.788,  88.6856, 90.0062, 89.5991, 87.6987, 83.2886, 83.6992,
                                       80.0268, 80.2146, 82.2778, 78.2842, 69.7213, 71.6091, 74.349,  61.604,  69.8856,
                                       75.087,  63.5927, 46.4182, 66.8054, 63.3828};
  const auto illuminant = [&](double nm) {
    const double place = std::clamp((nm - 380.0) / 10.0, 0.0, 39.999);
    const auto k = static_cast<std::size_t>(place);
    return d65[k] + (place - static_cast<double>(k)) * (d65[k + 1] - d65[k]);
  };
  // CIE 1931 observer as sums of lobes with two widths (Wyman, Sloan and Shirley 2013); within 1 % of white here.
  const auto lobe = [](double nm, double centre, double below, double above) {
    const double t = (nm - centre) * (nm < centre ? below : above);
    return std::exp(-0.5 * t * t);
  };
  std::vector<std::array<double, 3>> weights(wavelengths.size());
  for (int step = 0; step <= 400; ++step) {
    const double nm = 380.0 + step;
    const double x = 0.362 * lobe(nm, 442.0, 0.0624, 0.0374) + 1.056 * lobe(nm, 599.8, 0.0264, 0.0323) -
                     0.065 * lobe(nm, 501.1, 0.0490, 0.0382);
    const double y = 0.821 * lobe(nm, 568.8, 0.0213, 0.0247) + 0.286 * lobe(nm, 530.9, 0.0613, 0.0322);
    const double z = 1.217 * lobe(nm, 437.0, 0.0845, 0.0278) + 0.681 * lobe(nm, 459.0, 0.0385, 0.0725);
    const std::array<double, 3> rgb{3.2404542 * x - 1.5371385 * y - 0.4985314 * z,
                                    -0.9692660 * x + 1.8760108 * y + 0.0415560 * z,
                                    0.0556434 * x - 0.2040259 * y + 1.0572252 * z};
    const Between place = locate(wavelengths, nm);
    for (std::size_t c = 0; c < 3; ++c) {
      weights[place.below][c] += (1.0 - place.fraction) * illuminant(nm) * rgb[c];
      weights[place.above][c] += place.fraction * illuminant(nm) * rgb[c];
    }
  }
  for (std::size_t c = 0; c < 3; ++c) {
    double sum = 0.0;
    for (const auto& weight : weights) sum += weight[c];
    for (auto& weight : weights) weight[c] /= sum;
  }
  return weights;
}

}  // namespace lobefit
