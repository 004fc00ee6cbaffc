// Lit spheres against closed forms, and how far apart they look against independent implementations.
#include "report/sphere.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>

#include "models/error.h"
#include "report/flip.h"
#include "report/image_difference.h"
#include "report/metrics_report.h"
#include "tests/directions.h"
#include "tests/spheres.h"

namespace lobefit {
namespace {

SphereBrdf lambert(double albedo) {
  return [=](const Direction&, const Direction&) { return std::optional<Rgb>(grey(albedo / pi)); };
}

/// What an orthographic sphere shows in the middle of a pixel.
struct PixelPlace {
  double x, y;
  bool inside() const { return x * x + y * y < 1.0; }
  Direction normal() const { return {x, y, std::sqrt(1.0 - x * x - y * y)}; }
};
PixelPlace place(std::size_t pixel, int size) {
  const int column = static_cast<int>(pixel) % size, line = static_cast<int>(pixel) / size;
  return {(2.0 * column + 1.0) / size - 1.0, 1.0 - (2.0 * line + 1.0) / size};
}

Lighting constant(double radiance) { return {.constant = grey(radiance)}; }

TEST(Sphere, OfLambertUnderOneLightIsTheCosine) {
  constexpr int size = 33;
  for (const auto& [theta, phi] : {std::pair{0.0, 0.0}, {45.0, 135.0}, {100.0, -20.0}}) {
    const SphereImage image = render(lambert(0.7), Lighting::directional(theta, phi), {.size = size});
    const Direction light = direction(radians(theta), radians(phi));
    for (std::size_t pixel = 0; pixel < image.pixels(); ++pixel) {
      const PixelPlace at = place(pixel, size);
      EXPECT_EQ(image.cover[pixel], at.inside() ? 1.0f : 0.0f);
      const double truth = at.inside() ? 0.7 * std::max(0.0, dot(at.normal(), light)) : 0.0;
      for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(image.rgb[3 * pixel + c], truth, 1e-6);
    }
  }
}

TEST(Sphere, WhiteInAWhiteRoomIsOneEverywhere) {
  for (const bool isotropic : {true, false}) {
    const SphereImage image = render(lambert(1.0), constant(1.0), {.size = 64, .isotropic = isotropic});
    for (std::size_t k = 0; k < image.pixels(); ++k) {
      EXPECT_NEAR(image.rgb[3 * k], image.cover[k], 1e-6) << k;
    }
  }
}

TEST(Sphere, LobesOfLightIrradiateInClosedForm) {
  // A lobe cosⁿ about the normal irradiates by ∫ cosⁿ cos dω = 2π/(n + 2); the middle pixel faces the viewer.
  for (const int sharpness : {0, 1, 4}) {
    const Lighting lighting{.lobes = {{direction_in_picture(0.0, 0.0), {1.0, 2.0, 3.0}, sharpness}}};
    const SphereImage image = render(lambert(0.5), lighting, {.size = 9});
    const std::size_t middle = image.pixels() / 2;
    const double truth = 0.5 * 2.0 / (std::exp2(sharpness) + 2.0);
    for (std::size_t c = 0; c < 3; ++c) {
      EXPECT_NEAR(image.rgb[3 * middle + c], truth * (1.0 + static_cast<double>(c)), 1e-4);
    }
  }
}

TEST(Sphere, HighlightsLieWhereTheNormalHalvesLightAndView) {
  constexpr int size = 101;
  for (const auto& [theta, phi] : {std::pair{60.0, 135.0}, {40.0, -90.0}, {80.0, 10.0}}) {
    for (const bool isotropic : {true, false}) {
      // Lobes over the half vector alone: no Fresnel or masking moves the highlight.
      const SphereBrdf lobe = [](const Direction& wi, const Direction& wo) {
        return std::optional<Rgb>(grey(std::pow(normalize(wi + wo).z, 2000.0) / wi.z));
      };
      const SphereImage image = render(lobe, Lighting::directional(theta, phi), {.size = size, .isotropic = isotropic});
      std::size_t brightest = 0;
      for (std::size_t k = 0; k < image.pixels(); ++k) {
        if (image.rgb[3 * k] > image.rgb[3 * brightest]) brightest = k;
      }
      const Direction half = direction(radians(0.5 * theta), radians(phi));
      EXPECT_NEAR(place(brightest, size).x, half.x, 1.01 / size);
      EXPECT_NEAR(place(brightest, size).y, half.y, 1.01 / size);
    }
  }
}

TEST(Sphere, IsotropicSurfacesHaveNoGrain) {
  // Shared rings against a frame for each pixel.
  const SphereBrdf brdf = of_model("callisto", 0.3);
  for (const std::string_view name : lighting_names) {
    const SphereImage rings = render(brdf, find_lighting(name), {.size = 24});
    const SphereImage pixels = render(brdf, find_lighting(name), {.size = 24, .isotropic = false});
    for (std::size_t k = 0; k < rings.rgb.size(); ++k) {
      EXPECT_NEAR(rings.rgb[k], pixels.rgb[k], 2e-3 * rings.rgb[k]) << name << " " << k;
    }
  }
}

TEST(Sphere, GrainRunsAlongCirclesOfLatitude) {
  // What only reflects along x, eastwards, shows a light from the side but not one from above at the middle.
  const SphereBrdf brushed = [](const Direction& wi, const Direction& wo) {
    const Direction h = normalize(wi + wo);
    return std::optional<Rgb>(grey(h.x * h.x));
  };
  const SphereOptions options{.size = 9, .isotropic = false};
  const SphereImage east = render(brushed, Lighting::directional(60.0, 0.0), options);
  const SphereImage north = render(brushed, Lighting::directional(60.0, 90.0), options);
  const std::size_t middle = east.pixels() / 2;
  EXPECT_NEAR(east.rgb[3 * middle], pi * 0.25 * 0.5, 1e-5);  // h at 30°, cosine ½
  EXPECT_NEAR(north.rgb[3 * middle], 0.0, 1e-7);
}

TEST(Sphere, EnvironmentsAreResolved) {
  // The reports' environment at their resolution against nine times the nodes.
  struct Case {
    SphereBrdf brdf;
    double tolerance;
  };
  for (const Case& one : {Case{lambert(1.0), 1e-3}, Case{of_model("specular_ggx", 0.5), 5e-3},
                          Case{of_model("specular_ggx", 0.1), 1e-2}}) {
    const SphereImage coarse = render(one.brdf, Lighting::environment(), {.size = 16});
    const SphereImage fine = render(one.brdf, Lighting::environment(), {.size = 16, .resolution = 3});
    for (std::size_t k = 0; k < fine.rgb.size(); ++k) {
      EXPECT_NEAR(coarse.rgb[k], fine.rgb[k], one.tolerance * fine.rgb[k]) << k;
    }
  }
}

TEST(Sphere, MasksWhatOneOfTheBrdfsLacks) {
  constexpr int size = 40;
  const SphereBrdf steep = [](const Direction&, const Direction& wo) -> std::optional<Rgb> {
    if (wo.z < 0.5) return std::nullopt;
    return grey(1.0 / pi);
  };
  const std::array<SphereBrdf, 2> brdfs{lambert(0.4), steep};
  for (const std::string_view name : lighting_names) {
    const Lighting lighting = find_lighting(name);
    const std::vector<SphereImage> images = render_spheres(brdfs, lighting, {.size = size});
    EXPECT_EQ(images[0].cover, images[1].cover);
    for (std::size_t k = 0; k < images[0].pixels(); ++k) {
      const PixelPlace at = place(k, size);
      // A light that does not reach the surface asks for no value.
      const bool dark = at.inside() && !lighting.has_environment() &&
                        std::ranges::all_of(lighting.lights, [&](const DirectionalLight& light) {
                          return dot(at.normal(), light.towards) <= 0.0;
                        });
      EXPECT_EQ(images[0].cover[k], at.inside() && (dark || at.normal().z >= 0.5) ? 1.0f : 0.0f) << name << " " << k;
      EXPECT_LE(images[0].rgb[3 * k], 100.0f * images[0].cover[k]) << "black where uncovered";
    }
  }
  // An environment may lose a tenth of its light: a cosine-weighted cone of sin² 60° = .75 is too little, .970 is not.
  const auto up_to = [](double degrees_i) -> SphereBrdf {
    return [least = std::cos(radians(degrees_i))](const Direction& wi, const Direction&) -> std::optional<Rgb> {
      if (wi.z < least) return std::nullopt;
      return grey(1.0 / pi);
    };
  };
  const std::size_t middle = 9 * 9 / 2;
  EXPECT_EQ(render(up_to(60.0), constant(1.0), {.size = 9}).cover[middle], 0.0f);
  const SphereImage most = render(up_to(80.0), constant(1.0), {.size = 9});
  EXPECT_EQ(most.cover[middle], 1.0f);
  EXPECT_NEAR(most.rgb[3 * middle], std::pow(std::sin(radians(80.0)), 2), 2e-2);
}

TEST(Sphere, EdgesAreCoveredInPart) {
  const SphereImage image = render(lambert(1.0), constant(1.0), {.size = 64, .antialiasing = 4});
  double sum = 0.0;
  int partial = 0;
  for (std::size_t k = 0; k < image.pixels(); ++k) {
    sum += image.cover[k];
    if (image.cover[k] > 0.0f && image.cover[k] < 1.0f) ++partial;
    EXPECT_NEAR(image.rgb[3 * k], image.cover[k], 1e-6);  // black outside, and white within
  }
  EXPECT_NEAR(sum / (64.0 * 64.0), pi / 4.0, 1e-3);
  EXPECT_GT(partial, 100);
  EXPECT_THROW(render(lambert(1.0), constant(1.0), {.size = 0}), Error);
  EXPECT_THROW(find_lighting("candle"), Error);
}

TEST(Sphere, HasTheSameBitsForAnyNumberOfThreads) {
  const SphereBrdf brdf = of_model("callisto", 0.2);
  const auto with_threads = [&](std::size_t threads) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    return render(brdf, Lighting::environment(), {.size = 32}).rgb;
  };
  EXPECT_EQ(with_threads(1), with_threads(4));
}

// ---- ΔE_ITP ----------------------------------------------------------------------------------------------------

double srgb_to_linear(int code) {
  const double v = code / 255.0;
  return v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4);
}

TEST(DeltaEItp, MeetsAnIndependentImplementation) {
  // ColorAide's own tests (github.com/facelessuser/coloraide, tests/test_distance.py): sRGB red against CSS colours,
  // four digits, white at 203 cd/m².
  struct Case {
    std::array<int, 3> srgb;
    double delta;
  };
  const Rgb red = itp_of_rec709(Rgb{1.0, 0.0, 0.0} * 203.0);
  for (const Case& one : {Case{{255, 0, 0}, 0.0}, Case{{255, 165, 0}, 137.1706}, Case{{255, 255, 0}, 207.1558},
                          Case{{0, 128, 0}, 238.2887}, Case{{0, 0, 255}, 349.7161}, Case{{75, 0, 130}, 260.8920},
                          Case{{238, 130, 238}, 188.9220}, Case{{255, 255, 255}, 232.6248}, Case{{0, 0, 0}, 370.0251},
                          Case{{128, 128, 128}, 204.9620}}) {
    const Rgb linear{srgb_to_linear(one.srgb[0]), srgb_to_linear(one.srgb[1]), srgb_to_linear(one.srgb[2])};
    EXPECT_NEAR(delta_e_itp(red, itp_of_rec709(linear * 203.0)), one.delta, 1e-4);
  }
}

TEST(DeltaEItp, OfGreysIsThePqSignalAlone) {
  // SMPTE ST 2084 in 40 digits (mpmath): 0, 1, 100, 203 (BT.2408's 58 %), 1000 and 10,000 cd/m².
  struct Case {
    double luminance, signal;
  };
  for (const Case& one :
       {Case{0.0, 7.3095590257839663e-7}, Case{1.0, 0.149945732100179775}, Case{100.0, 0.508078421517394855},
        Case{203.0, 0.580688881041607838}, Case{1000.0, 0.751827096247041773}, Case{10000.0, 1.0}}) {
    const Rgb itp = itp_of_rec709(grey(one.luminance));
    EXPECT_NEAR(itp.x, one.signal, 1e-12);
    EXPECT_NEAR(itp.y, 0.0, 1e-12);
    EXPECT_NEAR(itp.z, 0.0, 1e-12);
  }
  // Beyond what PQ shows, and below black.
  EXPECT_EQ(delta_e_itp(itp_of_rec709(grey(2e4)), itp_of_rec709(grey(1e4))), 0.0);
  EXPECT_EQ(delta_e_itp(itp_of_rec709(grey(-3.0)), itp_of_rec709(grey(0.0))), 0.0);
}

TEST(ImageDifference, TakesMeanAndPercentileOverTheSphere) {
  // A sphere of 101 × 101 pixels; one in twenty differs by much, the others by little.
  const SphereImage a = render(lambert(1.0), constant(1.0), {.size = 101});
  SphereImage b = a;
  std::size_t shown = 0;
  for (const float cover : a.cover) shown += cover == 1.0f ? 1 : 0;
  const std::size_t many = shown / 20;
  std::size_t seen = 0;
  for (std::size_t k = 0; k < a.pixels(); ++k) {
    const float factor = a.cover[k] < 1.0f ? 0.0f : seen++ < many ? 0.25f : 0.5f;
    for (std::size_t c = 0; c < 3; ++c) b.rgb[3 * k + c] *= factor;
  }
  const auto from_white = [](double radiance) {
    return delta_e_itp(itp_of_rec709(grey(203.0)), itp_of_rec709(grey(203.0 * radiance)));
  };
  const ImageDifference difference = image_difference(a, b).value();
  EXPECT_NEAR(difference.delta_e_itp_p95, from_white(0.5), 1e-3);
  const double share = static_cast<double>(many) / static_cast<double>(shown);
  EXPECT_NEAR(difference.delta_e_itp_mean, share * from_white(0.25) + (1.0 - share) * from_white(0.5), 1e-3);
  EXPECT_GT(difference.flip_mean, 0.3);
  const ImageDifference same = image_difference(a, a).value();
  EXPECT_EQ(same.delta_e_itp_mean, 0.0);
  EXPECT_EQ(same.delta_e_itp_p95, 0.0);
  EXPECT_EQ(same.flip_mean, 0.0);
  SphereImage hidden = a;
  std::fill(hidden.cover.begin(), hidden.cover.end(), 0.0f);
  EXPECT_FALSE(image_difference(a, hidden).has_value());
  EXPECT_THROW(image_difference(a, render(lambert(1.0), constant(1.0), {.size = 8})), Error);
}

// ---- FLIP ------------------------------------------------------------------------------------------------------

constexpr int width = 48, height = 40;

template <class Pixel>
std::vector<float> picture(Pixel&& pixel) {
  std::vector<float> values;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      for (int c = 0; c < 3; ++c) values.push_back(static_cast<float>(pixel(x, y, c)));
    }
  }
  return values;
}

TEST(Flip, MeetsItsAuthorsProgram) {
  // NVIDIA's flip_api.py (github.com/NVlabs/flip, 2021) on these pictures in double precision, OpenCV's filter2D
  // replaced by the sum that it documents.
  const auto wave = [](int x, int y, int c) { return 0.5 + 0.4 * std::sin(0.3 * x + c) * std::cos(0.2 * y - c); };
  const auto square_at = [](int x, int y) { return (x / 12 + y / 10) % 2 != 0 ? 0.75 : 0.25; };
  struct Case {
    const char* name;
    std::vector<float> a, b;
    double pixels_per_degree, mean, most, corner, inner, last;  // at (0, 0), (17, 20), (47, 39)
  };
  const std::vector<float> waves = picture(wave),
                           shifted = picture([&](int x, int y, int c) {
                             return wave(x, y, c) + 0.15 * std::sin(1.1 * x * (c + 1) / 3.0) + 0.05 * c;
                           });
  const std::vector<float> squares = picture([&](int x, int y, int) { return square_at(x, y); }),
                           moved = picture([&](int x, int y, int) { return square_at(x + 1, y); });
  const std::vector<float> white = picture([](int, int, int) { return 1.0; }),
                           black = picture([](int, int, int) { return 0.0; });
  const std::vector<float> green = picture([](int, int, int c) { return c == 1 ? 1.0 : 0.0; }),
                           blue = picture([](int, int, int c) { return c == 2 ? 1.0 : 0.0; });
  for (const Case& one :
       {Case{"waves", waves, shifted, 67.0, 0.3938962153, 0.6211722628, 0.3016022962, 0.3322741048, 0.4304830279},
        Case{"waves", waves, shifted, 30.0, 0.4524380388, 0.6877113356, 0.3622477159, 0.3860613037, 0.4614144045},
        Case{"squares", squares, moved, 67.0, 0.1166367940, 0.7795832065, 0.0, 0.0, 0.7795832065},
        Case{"squares", squares, moved, 30.0, 0.0939812403, 0.8279656552, 0.0, 0.0, 0.8279656552},
        Case{"white", white, black, 67.0, 0.9673797637, 0.9673797637, 0.9673797637, 0.9673797637, 0.9673797637},
        Case{"green", green, blue, 67.0, 1.0, 1.0, 1.0, 1.0, 1.0}}) {
    const std::vector<double> errors = flip_errors(one.a, one.b, width, height, one.pixels_per_degree);
    double sum = 0.0, most = 0.0;
    for (const double error : errors) {
      sum += error;
      most = std::max(most, error);
    }
    constexpr double rounding = 2e-5;  // pictures are float
    EXPECT_NEAR(sum / (width * height), one.mean, rounding) << one.name;
    EXPECT_NEAR(most, one.most, rounding) << one.name;
    EXPECT_NEAR(errors[0], one.corner, rounding) << one.name;
    EXPECT_NEAR(errors[20 * width + 17], one.inner, rounding) << one.name;
    EXPECT_NEAR(errors[39 * width + 47], one.last, rounding) << one.name;
  }
  for (const double error : flip_errors(waves, waves, width, height, 67.0)) EXPECT_EQ(error, 0.0);
  EXPECT_EQ(flip_errors(waves, shifted, width, height, 67.0), flip_errors(shifted, waves, width, height, 67.0));
}

// ---- the whole report ------------------------------------------------------------------------------------------

Grid angles() {
  Grid grid{{"theta_i", "degree", {}}, {"theta_o", "degree", {}}, {"phi", "degree", {}}};
  for (int k = 0; k < 18; ++k) grid.theta_i.values.push_back(5.0 * k);
  for (int k = 0; k < 18; ++k) grid.theta_o.values.push_back(5.0 * k);
  for (int k = 0; k < 19; ++k) grid.phi.values.push_back(10.0 * k);
  return grid;
}

BrdfFile table_of(const std::string& model, int channels, const std::vector<Axis>& axes) {
  Table table;
  table.grid = angles();
  table.channels = channels;
  table.parameter_axes = axes;
  table.allocate();
  const TableModel truth(find_model(model), find_model(model).defaults(), table);
  table.values = truth.render().values;
  return {.format = FileFormat::exr, .table = table};
}

TEST(MetricsReport, OfAModelOnItsOwnTableIsZero) {
  // Sharper than the grid: what interpolation loses is lost on both sides.
  const BrdfFile file = table_of("specular_ggx", 1, {{"alpha", "", {0.05, 0.1, 0.2, 0.3, 0.5, 0.6, 0.8, 1.0}, false}});
  const Model& model = find_model("specular_ggx");
  const TableModel on_table(model, model.defaults(), file.table);
  const Table rendered = on_table.render();
  const MetricsReport report = metrics_report(model_pair(file, on_table, rendered.values), {.sphere_size = 16});
  EXPECT_TRUE(report.not_formed.empty());
  EXPECT_EQ(report.spheres.size(), 3u * 6u) << "three lightings, six rows of eight";
  EXPECT_EQ(report.spheres.front().row, 0u);
  EXPECT_EQ(report.spheres.back().row, 7u);
  for (const SphereDifference& sphere : report.spheres) {
    EXPECT_EQ(sphere.image.delta_e_itp_mean, 0.0);
    EXPECT_EQ(sphere.image.flip_mean, 0.0);
    EXPECT_GT(sphere.cover, 0.75);
  }
  const Json json = report.json(file.table);
  EXPECT_EQ(json["rms"]["log"]["uniform"], 0.0);
  EXPECT_EQ(json["sphere"]["rows"][17]["alpha"], 1.0);
  EXPECT_EQ(json["sphere"]["environment"]["flip_mean"], 0.0);
  EXPECT_EQ(json["not_formed"], Json::array());
}

TEST(MetricsReport, OfTwoLambertsFollowsFromTheirCosines) {
  const BrdfFile file = table_of("lambert", 3, {});
  const Model& model = find_model("lambert");
  ParameterValues values = model.defaults();
  values.set("albedo", std::vector{0.8, 0.8, 0.8});
  const TableModel on_table(model, values, file.table);
  const Table rendered = on_table.render();
  constexpr int size = 48;
  const MetricsReport report = metrics_report(model_pair(file, on_table, rendered.values), {.sphere_size = size});
  // The light of `directional`; the table ends at 85 degrees.
  const Direction light = direction(radians(45.0), radians(135.0));
  double sum = 0.0;
  int count = 0, inside = 0;
  for (std::size_t k = 0; k < std::size_t{size} * size; ++k) {
    const PixelPlace at = place(k, size);
    if (!at.inside()) continue;
    ++inside;
    const double cosine = dot(at.normal(), light);
    const double least = std::cos(radians(85.0));
    if (cosine > 0.0 && (cosine < least || at.normal().z < least)) continue;
    ++count;
    const double radiance = std::max(cosine, 0.0);
    sum += delta_e_itp(itp_of_rec709(grey(203.0 * radiance)), itp_of_rec709(grey(203.0 * 0.8 * radiance)));
  }
  EXPECT_NEAR(report.mean("directional", &ImageDifference::delta_e_itp_mean).value(), sum / count, 1e-3);
  EXPECT_NEAR(report.spheres.front().cover, static_cast<double>(count) / inside, 1e-12);
  EXPECT_NEAR(report.brdf.albedo->relative->worst, 0.2, 1e-6);
}

TEST(MetricsReport, CanLeaveSpheresOut) {
  const BrdfFile file = table_of("lambert", 1, {});
  const TableModel on_table(find_model("lambert"), find_model("lambert").defaults(), file.table);
  const Table rendered = on_table.render();
  const Json json = metrics_report(model_pair(file, on_table, rendered.values), {.sphere_size = 0}).json(file.table);
  EXPECT_TRUE(json["sphere"].is_null());
  EXPECT_TRUE(json.contains("smape"));
  // Values at the entries alone make no sphere, and the report says so.
  const MetricsReport blind = metrics_report({.table = &file.table, .values = rendered.values});
  EXPECT_TRUE(blind.spheres.empty());
  ASSERT_EQ(blind.not_formed.size(), 1u);
  EXPECT_EQ(blind.not_formed[0].metric, "sphere");
}

}  // namespace
}  // namespace lobefit
