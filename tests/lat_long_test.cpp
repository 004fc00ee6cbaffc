// Lat-long pictures: written here from closed forms, read, held against them and against their albedos.
#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfDoubleAttribute.h>
#include <OpenEXR/ImfFloatAttribute.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfIntAttribute.h>
#include <OpenEXR/ImfOutputFile.h>
#include <OpenEXR/ImfStandardAttributes.h>
#include <OpenEXR/ImfStringAttribute.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>
#include <map>

#include "models/error.h"
#include "reference/formats/brdf_file.h"
#include "reference/merge.h"
#include "tests/gauss_legendre.h"

namespace lobefit {
namespace {

namespace fs = std::filesystem;

using Values = std::function<std::array<float, 4>(int x, int y)>;

struct Picture {
  int width, height;
  Imf::Header header = {};
  std::vector<std::string> channels = {"R", "G", "B"};
  Imf::PixelType type = Imf::FLOAT;
};

class LatLongPictures : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::path(::testing::TempDir()) / ("lobefit_lat_long_" + std::to_string(getpid()));
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  /// The picture's window begins at (3, -5), as cropped renders' do.
  fs::path write(const std::string& name, const Picture& picture, const Values& values) const {
    const fs::path path = folder_ / name;
    Imf::Header header = picture.header;
    const Imath::Box2i window(Imath::V2i(3, -5), Imath::V2i(2 + picture.width, picture.height - 6));
    header.dataWindow() = header.displayWindow() = window;
    for (const std::string& channel : picture.channels) header.channels().insert(channel, Imf::Channel(picture.type));
    const auto count = static_cast<std::size_t>(picture.width) * static_cast<std::size_t>(picture.height);
    std::vector<std::vector<float>> floats(picture.channels.size(), std::vector<float>(count));
    std::vector<std::vector<half>> halves(picture.channels.size(), std::vector<half>(count));
    Imf::FrameBuffer frame;
    for (std::size_t c = 0; c < picture.channels.size(); ++c) {
      for (std::size_t k = 0; k < count; ++k) {
        const auto width = static_cast<std::size_t>(picture.width);
        floats[c][k] = values(static_cast<int>(k % width), static_cast<int>(k / width))[c];
        halves[c][k] = half(floats[c][k]);
      }
      void* base = picture.type == Imf::HALF ? static_cast<void*>(halves[c].data()) : floats[c].data();
      frame.insert(picture.channels[c],
                   Imf::Slice::Make(picture.type, base, Imath::V2i(3, -5), picture.width, picture.height));
    }
    Imf::OutputFile file(path.c_str(), header);
    file.setFrameBuffer(frame);
    file.writePixels(picture.height);
    return path;
  }

  static Imf::Header angles(const std::map<std::string, std::string>& attributes) {
    Imf::Header header;
    for (const auto& [name, text] : attributes) header.insert(name, Imf::StringAttribute(text));
    return header;
  }

  fs::path folder_;
};

/// The direction at a pixel's centre, by the conventions of lat_long.h.
Direction pixel_direction(const Picture& picture, int x, int y) {
  return direction(2.0 * pi * (y + 0.5) / picture.width, 2.0 * pi * (x + 0.5) / picture.width);
}

double smith_lambda(double alpha, double z) {
  return 0.5 * (std::sqrt(1.0 + alpha * alpha * (1.0 - z * z) / (z * z)) - 1.0);
}

double ggx(double alpha, double z) {
  const double t = 1.0 + (alpha * alpha - 1.0) * z * z;
  return alpha * alpha / (pi * t * t);
}

/// A GGX lobe that reflects all, with height-correlated masking.
double ggx_lobe(double alpha, const Direction& wi, const Direction& wo) {
  if (wi.z <= 0.0 || wo.z <= 0.0) return 0.0;
  const double g = 1.0 / (1.0 + smith_lambda(alpha, wi.z) + smith_lambda(alpha, wo.z));
  return ggx(alpha, normalize(wi + wo).z) * g / (4.0 * wi.z * wo.z);
}

/// Its albedo, integrated over microfacet normals m: dω_i = 4 (wo·m) dω_m.
double ggx_albedo(double alpha, const Direction& wo) {
  double sum = 0.0;
  constexpr int azimuths = 2000;
  for (const QuadraturePoint& z : gauss_legendre(400, 0.0, 1.0)) {
    for (int k = 0; k < azimuths; ++k) {
      const double radius = std::sqrt(1.0 - z.x * z.x), azimuth = 2.0 * pi * (k + 0.5) / azimuths;
      const Direction m{radius * std::cos(azimuth), radius * std::sin(azimuth), z.x};
      const double cosine = dot(wo, m);
      const Direction wi = m * (2.0 * cosine) - wo;
      if (cosine > 0.0) sum += ggx_lobe(alpha, wi, wo) * std::max(0.0, wi.z) * 4.0 * cosine * z.weight / azimuths;
    }
  }
  return 2.0 * pi * sum;
}

/// ∫ f cosine over the direction that is not held, by the table's own weights.
double albedo(const Table& table, int channel, bool view_held = true) {
  const std::vector<double> weights = table.quadrature_weights();
  double sum = 0.0;
  for (std::size_t entry = 0; entry < table.entries(); ++entry) {
    const double z = (view_held ? table.wi(entry) : table.wo(entry)).z;
    sum += table.value(entry, channel) * z * std::sqrt(1.0 - z * z) * weights[entry];
  }
  return sum * radians(1.0) * radians(1.0);
}

void expect_error(ExitCode code, const std::string& fragment, const std::function<void()>& act) {
  try {
    act();
    ADD_FAILURE() << "no error: " << fragment;
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), code) << error.what();
    EXPECT_NE(std::string(error.what()).find(fragment), std::string::npos) << error.what() << " lacks " << fragment;
  }
}

TEST_F(LatLongPictures, ALambertianSurfaceKeepsItsAlbedo) {
  const auto values = [](int, int) -> std::array<float, 4> {
    return {static_cast<float>(0.8 / pi), static_cast<float>(0.5 / pi), static_cast<float>(0.2 / pi)};
  };
  const BrdfFile file = read_brdf_file(
      write("a.txt", {.width = 256, .height = 64, .header = angles({{"theta_o", "30"}})}, values));  // misleading name
  EXPECT_EQ(file.format, FileFormat::lat_long);
  EXPECT_EQ(file.table.channels, 3);
  EXPECT_EQ(file.table.entries(), 256u * 64u);
  EXPECT_EQ(file.table.masked(), 0u);
  EXPECT_EQ(file.table.grid.theta_o.values, std::vector<double>{30.0});
  // The midpoint rule over 64 lines gives ∫ sin 2θ dθ = 1 but for 1e-4.
  EXPECT_NEAR(albedo(file.table, 0), 0.8, 2e-4 * 0.8);
  EXPECT_NEAR(albedo(file.table, 1), 0.5, 2e-4 * 0.5);
  EXPECT_NEAR(albedo(file.table, 2), 0.2, 2e-4 * 0.2);
}

TEST_F(LatLongPictures, ALobeLiesWhereItsDirectionsSayWhateverIsHeld) {
  constexpr double alpha = 0.5;
  const Direction held = direction(radians(40.0), radians(70.0));
  const double truth = ggx_albedo(alpha, held);
  for (const bool view_held : {true, false}) {
    for (const int aspect : {4, 2}) {
      SCOPED_TRACE((view_held ? "view held, 1:" : "light held, 1:") + std::to_string(aspect));
      Picture picture{.width = 512, .height = 512 / aspect, .channels = {"Y"}};
      picture.header.insert(view_held ? "theta_o" : "theta_i", Imf::FloatAttribute(40.0f));
      picture.header.insert(view_held ? "phi_o" : "phi_i", Imf::IntAttribute(70));
      // Below the horizon stands what would ruin every figure.
      const fs::path path = write("lobe.exr", picture, [&](int x, int y) -> std::array<float, 4> {
        const Direction other = pixel_direction(picture, x, y);
        return {other.z > 0.0 ? static_cast<float>(ggx_lobe(alpha, other, held)) : 1e9f};
      });
      const Table table = read_table(path);
      ASSERT_EQ(table.channels, 1);
      ASSERT_EQ(table.entries(), 512u * 128u);
      for (std::size_t entry = 0; entry < table.entries(); entry += 7) {
        const double expected = ggx_lobe(alpha, table.wi(entry), table.wo(entry));
        ASSERT_NEAR(table.value(entry), expected, 1e-6 * expected) << table.place(entry);
      }
      EXPECT_NEAR(albedo(table, 0, view_held), truth, 3e-4 * truth);
      // Between pixels, by directions that turn with the held one.
      const Direction other = direction(radians(35.3), radians(70.0 + 171.7));
      const Rgb between = view_held ? table.interpolate(0, other, held) : table.interpolate(0, held, other);
      EXPECT_NEAR(between.x, ggx_lobe(alpha, other, held), 2e-3 * between.x);
    }
  }
}

TEST_F(LatLongPictures, HandednessIsThatOfAzimuthsGrowingToTheRight) {
  // Brightest at azimuth 90° ahead of the view: the light's azimuth seen from the view is +90°, the view's seen from
  // the light -90°.
  for (const bool view_held : {true, false}) {
    Picture picture{.width = 64, .height = 16, .channels = {"Y"}};
    picture.header.insert(view_held ? "theta_o" : "theta_i", Imf::DoubleAttribute(20.0));
    picture.header.insert(view_held ? "phi_o" : "phi_i", Imf::StringAttribute("-45"));
    const Table table = read_table(write("turn.exr", picture, [&](int x, int y) -> std::array<float, 4> {
      const double azimuth = 360.0 * (x + 0.5) / picture.width;
      return {azimuth > 42.0 && azimuth < 48.0 && y == 3 ? 1.0f : 0.0f};
    }));
    double sum = 0.0, azimuth = 0.0;
    for (std::size_t entry = 0; entry < table.entries(); ++entry) {
      sum += table.value(entry);
      azimuth += table.value(entry) * table.grid.phi.values[table.phi_index(entry)];
    }
    EXPECT_NEAR(azimuth / sum, view_held ? 90.0 : 270.0, 1e-9);
  }
}

TEST_F(LatLongPictures, WhatIsNoValueIsMasked) {
  Picture picture{.width = 16, .height = 8, .header = angles({{"theta_o", "0"}}), .channels = {"Y", "A"}};
  picture.type = Imf::HALF;
  const Table table = read_table(write("masked.exr", picture, [](int x, int y) -> std::array<float, 4> {
    if (y == 1 && x == 2) return {-0.25f, 1.0f};
    if (y == 1 && x == 3) return {std::numeric_limits<float>::quiet_NaN(), 1.0f};
    if (y == 2 && x == 4) return {std::numeric_limits<float>::infinity(), 1.0f};
    if (y == 3 && x == 5) return {0.5f, 0.0f};
    return {0.5f, 1.0f};
  }));
  EXPECT_EQ(table.entries(), 64u);
  EXPECT_EQ(table.masked(), 4u);
  for (std::size_t entry = 0; entry < table.entries(); ++entry) {
    const std::size_t line = table.theta_i_index(entry), column = table.phi_index(entry);
    const bool broken =
        (line == 1 && (column == 2 || column == 3)) || (line == 2 && column == 4) || (line == 3 && column == 5);
    EXPECT_EQ(table.valid[entry] == 0, broken) << table.place(entry);
    if (!broken) {
      EXPECT_EQ(table.value(entry), 0.5f);
    }
  }
}

TEST_F(LatLongPictures, TheHeldDirectionMayComeFromElsewhere) {
  const auto flat = [](int, int) -> std::array<float, 4> { return {1.0f, 1.0f, 1.0f}; };
  const fs::path path = write("untold.exr", {.width = 16, .height = 4}, flat);
  expect_error(ExitCode::invalid_input, "give --wo or --wi THETA,PHI", [&] { read_table(path); });
  const ReadOptions options{.held = LatLong::Held{FixedDirection::light, 25.0, 0.0}};
  EXPECT_EQ(read_brdf_file(path, options).table.grid.theta_i.values, std::vector<double>{25.0});

  const fs::path told = write("told.exr", {.width = 16, .height = 4, .header = angles({{"theta_i", "25"}})}, flat);
  EXPECT_EQ(read_brdf_file(told, options).table.grid.theta_i.values, std::vector<double>{25.0}) << "the same again";
  expect_error(ExitCode::usage, "itself holds another direction", [&] {
    read_brdf_file(told, {.held = LatLong::Held{FixedDirection::view, 25.0, 0.0}});
  });
  read_table(told).write(folder_ / "table.exr");
  EXPECT_EQ(read_brdf_file(folder_ / "table.exr").format, FileFormat::exr);
  expect_error(ExitCode::usage, "they are for lat-long pictures",
               [&] { read_brdf_file(folder_ / "table.exr", options); });
}

TEST_F(LatLongPictures, OtherPicturesAreRefused) {
  const auto flat = [](int, int) -> std::array<float, 4> { return {1.0f, 1.0f, 1.0f, 1.0f}; };
  const auto refused = [&](const Picture& picture, const std::string& why) {
    const fs::path path = write("bad.exr", picture, flat);
    expect_error(ExitCode::invalid_input, why, [&] { read_table(path); });
  };
  const Imf::Header good = angles({{"theta_o", "30"}});
  refused({.width = 16, .height = 9, .header = good}, "16 × 9 pixels: neither");
  refused({.width = 2, .height = 1, .header = good}, "neither");
  refused({.width = 8196, .height = 2049, .header = good, .channels = {"Y"}}, "8196 columns");
  refused({.width = 16, .height = 4, .header = good, .channels = {"R", "G"}}, "no channels R, G, B or Y, but G, R");
  refused({.width = 16, .height = 4, .header = good, .type = Imf::UINT}, "channel R holds integers");
  refused({.width = 16, .height = 4, .header = angles({{"theta_o", "steep"}})}, "theta_o is no number");
  refused({.width = 16, .height = 4, .header = angles({{"theta_o", "nan"}})}, "theta_o is no number");
  refused({.width = 16, .height = 4, .header = angles({{"theta_o", "90"}})}, "90 degrees from the normal");
  refused({.width = 16, .height = 4, .header = angles({{"theta_o", "1"}, {"theta_i", "1"}})}, "both hold");
  Imf::Header environment = good;
  Imf::addEnvmap(environment, Imf::ENVMAP_LATLONG);
  refused({.width = 16, .height = 8, .header = environment}, "attribute envmap");

  const fs::path whole = write("whole.exr", {.width = 64, .height = 16, .header = good}, flat);
  std::ifstream stream(whole, std::ios::binary);
  const std::string bytes{std::istreambuf_iterator<char>(stream), {}};
  for (std::size_t size = 4; size < bytes.size(); size += 13) {
    std::ofstream(folder_ / "cut.exr", std::ios::binary) << bytes.substr(0, size);
    expect_error(ExitCode::invalid_input, "cut.exr", [&] { read_table(folder_ / "cut.exr"); });
  }
}

TEST_F(LatLongPictures, PicturesForSeveralViewsJoinIntoOneTable) {
  std::vector<Table> tables;
  std::vector<fs::path> names;
  for (const double theta : {60.0, 0.0, 30.0}) {
    Picture picture{.width = 64, .height = 16, .channels = {"Y"}};
    picture.header.insert("theta_o", Imf::DoubleAttribute(theta));
    names.push_back(write(std::to_string(theta) + ".exr", picture, [&](int x, int y) -> std::array<float, 4> {
      return {static_cast<float>(ggx_lobe(0.5, pixel_direction(picture, x, y), direction(radians(theta), 0.0)))};
    }));
    tables.push_back(read_table(names.back()));
  }
  const Table joined = join_polar_angles(tables, names);
  EXPECT_EQ(joined.grid.theta_o.values, (std::vector<double>{0.0, 30.0, 60.0}));
  ASSERT_EQ(joined.entries(), 3u * 64u * 16u);
  for (std::size_t entry = 0; entry < joined.entries(); ++entry) {
    const double expected = ggx_lobe(0.5, joined.wi(entry), joined.wo(entry));
    ASSERT_NEAR(joined.value(entry), expected, 1e-6 * expected) << joined.place(entry);
  }
  // Tables whose lights are single join in the other axis, masks and all.
  const auto turned = [](const Table& table) {
    Table result;
    result.grid = {{"theta_i", "degree", table.grid.theta_o.values, false},
                   {"theta_o", "degree", table.grid.theta_i.values, true},
                   table.grid.phi};
    result.allocate();
    result.values = table.values;
    result.valid.back() = 0;
    return result;
  };
  std::vector<Table> lights;
  for (const Table& table : tables) lights.push_back(turned(table));
  const Table other = join_polar_angles(lights, names);
  EXPECT_EQ(other.grid.theta_i.values, (std::vector<double>{0.0, 30.0, 60.0}));
  EXPECT_EQ(other.masked(), 3u);
  for (std::size_t entry = 0; entry < other.entries(); ++entry) {
    const double expected = ggx_lobe(0.5, other.wo(entry), other.wi(entry));
    ASSERT_NEAR(other.value(entry), expected, 1e-6 * expected) << other.place(entry);
  }

  const auto refused = [&](const std::vector<Table>& some, const std::string& why) {
    expect_error(ExitCode::invalid_input, why, [&] { join_polar_angles(some, names); });
  };
  refused({tables[0], tables[1], tables[0]}, "theta_o = 60 comes twice");
  Table coarse = read_table(write("coarse.exr", {.width = 32, .height = 8, .header = angles({{"theta_o", "45"}})},
                                  [](int, int) -> std::array<float, 4> {
                                    return {1.0f, 1.0f, 1.0f};
                                  }));
  refused({tables[0], coarse}, "in more than one polar angle: channels");
  Table shard = tables[1];
  shard.shards = {3, {1}};
  refused({tables[0], shard}, "not a whole table");
}

}  // namespace
}  // namespace lobefit
