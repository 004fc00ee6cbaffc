// Environments and area lights against closed forms and OpenEXR's own map of directions.
#include "report/sampled_light.h"

#include <Imath/ImathBox.h>
#include <OpenEXR/ImfEnvmap.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "models/error.h"
#include "tests/directions.h"
#include "tests/spheres.h"

namespace lobefit {
namespace {

constexpr std::size_t width = 64, height = 32;

std::vector<float> picture(const std::function<Rgb(std::size_t column, std::size_t line)>& radiance) {
  std::vector<float> rgb;
  for (std::size_t line = 0; line < height; ++line) {
    for (std::size_t column = 0; column < width; ++column) {
      const Rgb value = radiance(column, line);
      for (const double c : {value.x, value.y, value.z}) rgb.push_back(static_cast<float>(c));
    }
  }
  return rgb;
}
EnvironmentMap environment(const std::vector<float>& rgb, double rotation = 0.0) {
  return {rgb, width, height, rotation, "picture"};
}

/// What OpenEXR says of a pixel's middle.
Direction direction_of_pixel(std::size_t column, std::size_t line) {
  const Imath::Box2i window({0, 0}, {static_cast<int>(width) - 1, static_cast<int>(height) - 1});
  const Imath::V3f d = OPENEXR_IMF_NAMESPACE::LatLongMap::direction(
      window, Imath::V2f(static_cast<float>(column), static_cast<float>(line)));
  return normalize(Direction{d.x, d.y, d.z});
}

TEST(EnvironmentMap, LiesAsOpenExrSays) {
  const std::vector<float> rgb = picture([](std::size_t column, std::size_t line) {
    return Rgb{static_cast<double>(column) + 1.0, static_cast<double>(line), 1.0};
  });
  const EnvironmentMap map = environment(rgb);
  // OpenEXR's first and last pixels lie on the edges of the sphere, ours half a pixel inside.
  for (std::size_t line = 3; line < height - 3; ++line) {
    for (std::size_t column = 0; column < width; ++column) {
      const Direction w = direction_of_pixel(column, line);
      const Rgb found = map.at(w).radiance;
      const double across = std::abs(found.x - 1.0 - static_cast<double>(column));
      EXPECT_LE(std::min(across, width - across), 1.0) << column << " " << line;
      EXPECT_NEAR(found.y, static_cast<double>(line), 1.0) << column << " " << line;
    }
  }
  EXPECT_NEAR(map.at({0.0, 0.0, 1.0}).radiance.x, width / 2 + 1.0, 1.0);
  EXPECT_NEAR(map.at({1.0, 0.0, 0.0}).radiance.x, width / 4 + 1.0, 1.0);
  EXPECT_NEAR(map.at({0.0, 1.0, 1e-9}).radiance.y, 0.0, 1e-6);
  // Turned, what was behind the camera stands to the right.
  EXPECT_EQ(environment(rgb, 90.0).at({1.0, 0.0, 1e-3}).radiance.x, map.at({-1e-3, 0.0, 1.0}).radiance.x);
}

void expect_density_is_normalised_and_drawn_from(const SampledLight& light) {
  // ∫ pdf = 1, and E[g] = ∫ pdf g, over a fine grid; 4 sigma of 2^16 draws.
  double whole = 0.0, mean = 0.0, square_mean = 0.0;
  const auto g = [](const Direction& w) { return 1.0 + 0.5 * w.x - 0.7 * w.y + 0.2 * w.x * w.z; };
  constexpr int steps = 1024;
  for (int i = 0; i < steps; ++i) {
    for (int k = 0; k < 2 * steps; ++k) {
      const double y = std::cos(pi * (i + 0.5) / steps), azimuth = pi * (k + 0.5) / steps;
      const double sine = std::sqrt(1.0 - y * y);
      const Direction w{sine * std::sin(azimuth), y, sine * std::cos(azimuth)};
      const double density = light.at(w).pdf * sine * pi / steps * pi / steps;
      whole += density;
      mean += density * g(w);
      square_mean += density * g(w) * g(w);
    }
  }
  EXPECT_NEAR(whole, 1.0, 2e-3);
  constexpr int draws = 1 << 16;
  double sum = 0.0;
  UniformNumbers random(5);
  for (int k = 0; k < draws; ++k) {
    const double u = random();
    const Direction w = light.sample({u, random()});
    EXPECT_NEAR(dot(w, w), 1.0, 1e-12);
    ASSERT_GT(light.at(w).pdf, 0.0);
    sum += g(w);
  }
  const double sigma = std::sqrt((square_mean - mean * mean) / draws);
  EXPECT_NEAR(sum / draws, mean, 4.0 * sigma + 2e-3);
}

TEST(SampledLights, DensitiesAreThoseOfTheirDraws) {
  const std::vector<float> rgb = picture([](std::size_t column, std::size_t line) {
    return Rgb{column % 7 == 3 ? 9.0 : 0.1, line > 20 ? 2.0 : 0.0, column == 60 && line == 8 ? 400.0 : 0.0};
  });
  expect_density_is_normalised_and_drawn_from(environment(rgb, 33.0));
  expect_density_is_normalised_and_drawn_from(DiskLight(70.0, 20.0, 25.0));
}

SphereBrdf lambert() {
  return [](const Direction&, const Direction&) { return std::optional<Rgb>(Rgb{1.0 / pi, 0.5 / pi, 0.1 / pi}); };
}

/// Errors in units of the stated noise, over pixels that show the sphere in full: (mean, mean square).
std::array<double, 2> in_sigmas(const SphereImage& image, const std::function<double(std::size_t)>& truth) {
  double sum = 0.0, noise_sum = 0.0, squares = 0.0, noise_squares = 0.0;
  for (std::size_t pixel = 0; pixel < image.pixels(); ++pixel) {
    if (image.cover[pixel] < 1.0f) continue;
    double mean = 0.0;
    for (std::size_t c = 0; c < 3; ++c) mean += image.rgb[3 * pixel + c] / 3.0;
    const double error = mean - truth(pixel), noise = image.noise[pixel];
    sum += error;
    squares += error * error;
    noise_sum += noise * noise;
    noise_squares += noise * noise;
  }
  return {sum / std::sqrt(noise_sum), squares / noise_squares};
}

TEST(SampledLights, AWhiteRoomIsWhite) {
  const auto room = std::make_shared<EnvironmentMap>(environment(picture([](auto, auto) { return grey(1.0); })));
  const SphereImage image = render(lambert(), {.sampled = room}, {.size = 48});
  const auto [mean, square_mean] = in_sigmas(image, [](std::size_t) { return 1.6 / 3.0; });
  // False alarm below 1e-4; Sobol points do better than their halves say, so that noise is overstated.
  EXPECT_LT(std::abs(mean), 4.0);
  EXPECT_LT(square_mean, 2.0);
}

// A disk that is above the horizon in full irradiates by the cosine with its axis.
TEST(SampledLights, DisksIrradiateInClosedForm) {
  constexpr int size = 48;
  for (const double radius : {0.5, 12.0}) {
    const auto disk = std::make_shared<DiskLight>(30.0, 135.0, radius);
    const Direction axis = direction_in_picture(30.0, 135.0);
    const SphereImage image = render(lambert(), {.sampled = disk}, {.size = size, .light_samples = 256});
    double worst = 0.0;
    for (std::size_t pixel = 0; pixel < image.pixels(); ++pixel) {
      if (image.cover[pixel] < 1.0f) continue;
      const int column = static_cast<int>(pixel) % size, line = static_cast<int>(pixel) / size;
      const double x = (2.0 * column + 1.0) / size - 1.0, y = 1.0 - (2.0 * line + 1.0) / size;
      const double cosine = dot(axis, Direction{x, y, std::sqrt(1.0 - x * x - y * y)});
      if (cosine < std::sin(radians(radius + 1.0))) continue;
      worst = std::max(worst, std::abs(image.rgb[3 * pixel] - cosine));
    }
    EXPECT_LT(worst, 0.02) << radius;
    EXPECT_GT(worst, 0.0);
  }
}

// Another way to the same pictures: environments in closed form, integrated by quadrature.
TEST(SampledLights, APictureOfAnEnvironmentLightsAsTheEnvironmentDoes) {
  const Lighting closed = Lighting::environment();
  constexpr std::size_t w = 512, h = 256;
  std::vector<float> rgb;
  for (std::size_t line = 0; line < h; ++line) {
    for (std::size_t column = 0; column < w; ++column) {
      const double polar = pi * (static_cast<double>(line) + 0.5) / h;
      const double longitude = pi - 2.0 * pi * (static_cast<double>(column) + 0.5) / w;
      const Rgb value = closed.radiance(
          {std::sin(polar) * std::sin(longitude), std::cos(polar), std::sin(polar) * std::cos(longitude)});
      for (const double c : {value.x, value.y, value.z}) rgb.push_back(static_cast<float>(c));
    }
  }
  const Lighting drawn{.sampled = std::make_shared<EnvironmentMap>(rgb, w, h, 0.0, "picture")};
  for (const double alpha : {0.05, 0.5}) {
    const SphereBrdf brdf = of_model("callisto", alpha);
    const SphereImage truth = render(brdf, closed, {.size = 24, .resolution = 3});
    const SphereImage image = render(brdf, drawn, {.size = 24, .light_samples = 256});
    const auto [mean, square_mean] = in_sigmas(image, [&](std::size_t pixel) {
      return (truth.rgb[3 * pixel] + truth.rgb[3 * pixel + 1] + truth.rgb[3 * pixel + 2]) / 3.0;
    });
    EXPECT_LT(std::abs(mean), 4.0) << alpha;
    EXPECT_LT(square_mean, 2.0) << alpha;
    EXPECT_GT(square_mean, 1e-3) << alpha;
  }
}

// Proposals weigh nothing in the mean: a model's own and those for any lobe draw one picture.
TEST(SampledLights, ProposalsDoNotChangeThePicture) {
  const Model& model = find_model("specular_ggx");
  ParameterValues values = model.defaults();
  values.set("alpha", 0.1);
  const std::vector<double> flat(values.flat().begin(), values.flat().end());
  const LightProposal own{
      .sample = [&](const Direction& wo, const std::array<double, 2>& u) { return model.sample(flat, wo, u); },
      .pdf = [&](const Direction& wi, const Direction& wo) { return model.pdf(flat, wi, wo); }};
  const SphereBrdf brdf = of_model("specular_ggx", 0.1);
  const Lighting lighting{.sampled = std::make_shared<DiskLight>(40.0, 120.0, 10.0)};
  const SphereImage truth = render(brdf, lighting, {.size = 32, .light_samples = 4096});
  for (const std::vector<LightProposal>& proposals :
       {std::vector{own}, std::vector{own, any_lobe_proposal()}, std::vector{any_lobe_proposal()}}) {
    const SphereImage image = render(brdf, lighting, {.size = 32, .light_samples = 63, .proposals = proposals});
    const auto [mean, square_mean] = in_sigmas(image, [&](std::size_t pixel) {
      return (truth.rgb[3 * pixel] + truth.rgb[3 * pixel + 1] + truth.rgb[3 * pixel + 2]) / 3.0;
    });
    EXPECT_LT(std::abs(mean), 4.0) << proposals.size();
    EXPECT_LT(square_mean, 2.0) << proposals.size();
  }
}

TEST(SampledLights, GiveTheSameBitsForAnyNumberOfThreads) {
  const SphereBrdf brdf = of_model("callisto", 0.2);
  const Lighting lighting{.sampled = std::make_shared<DiskLight>(40.0, 120.0, 10.0)};
  const SphereImage many = render(brdf, lighting, {.size = 24, .antialiasing = 2});
  tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  const SphereImage single = render(brdf, lighting, {.size = 24, .antialiasing = 2});
  EXPECT_EQ(many.rgb, single.rgb);
  EXPECT_EQ(many.noise, single.noise);
}

TEST(EnvironmentMap, RefusesWhatLightsNothing) {
  const auto refused = [](const std::vector<float>& rgb, std::size_t w, std::size_t h, const std::string& what) {
    try {
      EnvironmentMap(rgb, w, h, 0.0, "studio.exr");
      ADD_FAILURE() << what;
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ExitCode::invalid_input);
      EXPECT_NE(std::string(error.what()).find(what), std::string::npos) << error.what();
    }
  };
  refused(std::vector<float>(12, 1.0f), 2, 2, "twice as wide as high");
  refused(std::vector<float>(6, 0.0f), 2, 1, "black");
  refused(std::vector<float>(6, -1.0f), 2, 1, "black");
  refused({1, 1, 1, 1, NAN, 1}, 2, 1, "column 1, line 0");
  EXPECT_THROW(DiskLight(0.0, 0.0, 0.0), Error);
}

}  // namespace
}  // namespace lobefit
