#include "report/image_difference.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "models/error.h"
#include "report/flip.h"

namespace lobefit {

namespace {

struct Matrix {
  Rgb rows[3];

  Rgb operator*(const Rgb& v) const { return {dot(rows[0], v), dot(rows[1], v), dot(rows[2], v)}; }
};

// From the primaries of both and their common white D65; ITU-R BT.2087 prints four digits of it.
constexpr Matrix rec2020_of_rec709{{{0.627403895934699, 0.329283038377884, 0.043313065687417},
                                    {0.069097289358232, 0.919540395075459, 0.011362315566309},
                                    {0.016391438875150, 0.088013307877226, 0.895595253247624}}};
// ITU-R BT.2100.
constexpr Matrix lms_of_rec2020{{{1688.0 / 4096.0, 2146.0 / 4096.0, 262.0 / 4096.0},
                                 {683.0 / 4096.0, 2951.0 / 4096.0, 462.0 / 4096.0},
                                 {99.0 / 4096.0, 309.0 / 4096.0, 3688.0 / 4096.0}}};
constexpr Matrix itp_of_pq{{{0.5, 0.5, 0.0},
                            {0.5 * 6610.0 / 4096.0, 0.5 * -13613.0 / 4096.0, 0.5 * 7003.0 / 4096.0},
                            {17933.0 / 4096.0, -17390.0 / 4096.0, -543.0 / 4096.0}}};

/// SMPTE ST 2084: from cd/m² to the signal.
double pq(double luminance) {
  constexpr double m1 = 2610.0 / 16384.0, m2 = 2523.0 / 4096.0 * 128.0, c1 = 3424.0 / 4096.0,
                   c2 = 2413.0 / 4096.0 * 32.0, c3 = 2392.0 / 4096.0 * 32.0;
  const double power = std::pow(std::clamp(luminance / 10000.0, 0.0, 1.0), m1);
  return std::pow((c1 + c2 * power) / (1.0 + c3 * power), m2);
}

}  // namespace

Rgb itp_of_rec709(const Rgb& luminance) {
  const Rgb lms = lms_of_rec2020 * (rec2020_of_rec709 * luminance);
  return itp_of_pq * Rgb{pq(lms.x), pq(lms.y), pq(lms.z)};
}

double delta_e_itp(const Rgb& itp_a, const Rgb& itp_b) {
  const Rgb difference = itp_a - itp_b;
  return 720.0 * std::sqrt(dot(difference, difference));
}

std::optional<ImageDifference> image_difference(const SphereImage& a, const SphereImage& b) {
  if (a.size != b.size) throw Error(ExitCode::usage, "pictures of different sizes", "", "render both alike");
  const auto itp = [](const SphereImage& image, std::size_t pixel) {
    return itp_of_rec709(Rgb{image.rgb[3 * pixel], image.rgb[3 * pixel + 1], image.rgb[3 * pixel + 2]} *
                         white_luminance);
  };
  const std::vector<double> flip = flip_errors(a.rgb, b.rgb, a.size, a.size, pixels_per_degree);
  std::vector<double> differences;
  double sum = 0.0, flip_sum = 0.0;
  for (std::size_t pixel = 0; pixel < a.pixels(); ++pixel) {
    if (a.cover[pixel] < 1.0f || b.cover[pixel] < 1.0f) continue;
    differences.push_back(delta_e_itp(itp(a, pixel), itp(b, pixel)));
    sum += differences.back();
    flip_sum += flip[pixel];
  }
  if (differences.empty()) return std::nullopt;
  const std::size_t count = differences.size();
  const auto rank = static_cast<std::ptrdiff_t>((95 * count + 99) / 100) - 1;
  std::nth_element(differences.begin(), differences.begin() + rank, differences.end());
  return ImageDifference{.delta_e_itp_mean = sum / static_cast<double>(count),
                         .delta_e_itp_p95 = differences[static_cast<std::size_t>(rank)],
                         .flip_mean = flip_sum / static_cast<double>(count)};
}

}  // namespace lobefit
