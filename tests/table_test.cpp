// Tables: what is written is what is read, the layout is the documented one, files appear whole or not at all, and no
// file, however broken, does worse than a message that names it.
#include "reference/table.h"

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfInputFile.h>
#include <OpenEXR/ImfOutputFile.h>
#include <OpenEXR/ImfStringAttribute.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>
#include <unistd.h>

#include <atomic>
#include <bit>
#include <cmath>
#include <cstring>
#include <fstream>
#include <limits>
#include <map>
#include <set>
#include <sstream>

#include "models/error.h"
#include "reference/json_reader.h"
#include "reference/output_file.h"
#include "reference/render.h"
#include "reference/table_model.h"
#include "tests/directions.h"

namespace lobefit {
namespace {

namespace fs = std::filesystem;

/// A folder of its own for each test, removed with it.
class TableFiles : public ::testing::Test {
 protected:
  TableFiles()
      : folder_(fs::temp_directory_path() / ("lobefit_" + std::to_string(getpid()) + "_" +
                                             ::testing::UnitTest::GetInstance()->current_test_info()->name())) {
    fs::create_directories(folder_);
  }
  ~TableFiles() override {
    std::error_code ignored;
    fs::remove_all(folder_, ignored);
  }

  fs::path file(const std::string& name) const { return folder_ / name; }
  std::size_t files_in_folder() const {
    return static_cast<std::size_t>(std::distance(fs::directory_iterator(folder_), fs::directory_iterator()));
  }

  const fs::path folder_;
};

std::string bytes_of(const fs::path& path) {
  std::ifstream stream(path, std::ios::binary);
  std::ostringstream content;
  content << stream.rdbuf();
  return content.str();
}

void write_bytes(const fs::path& path, std::string_view bytes) {
  std::ofstream(path, std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
}

/// The Error that `act` throws, or a failure of the test. `fragment` has to be in its message.
template <class Act>
void expect_error(ExitCode code, const std::string& fragment, Act&& act, const std::string& what = "") {
  try {
    act();
    ADD_FAILURE() << what << ": no error";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), code) << what << ": " << error.what();
    EXPECT_NE(std::string(error.what()).find(fragment), std::string::npos)
        << what << ": '" << error.what() << "' lacks '" << fragment << "'";
  } catch (const std::exception& error) {
    ADD_FAILURE() << what << ": another exception: " << error.what();
  }
}

Axis axis(const std::string& name, std::vector<double> values, const std::string& unit = "degree") {
  return {name, unit, std::move(values), false};
}

Grid small_grid() {
  return {axis("theta_i", {0.0, 20.0, 50.0, 80.0}), axis("theta_o", {0.0, 45.0, 85.0}),
          axis("phi", {0.0, 60.0, 180.0})};
}

ParameterValues microfacet_diffuse(double alpha = 0.5) {
  ParameterValues values = find_reference("microfacet_diffuse").defaults();
  values.set("alpha", alpha);
  return values;
}

Table monte_carlo(const ParameterValues& values, const RenderOptions& options) {
  Monitor monitor;
  return render(find_reference("microfacet_diffuse"), values, {axis("alpha", {0.25, 1.0}, "")}, small_grid(), options,
                monitor);
}

std::vector<std::uint32_t> bits(const std::vector<float>& values) {
  std::vector<std::uint32_t> result;
  for (const float value : values) result.push_back(std::bit_cast<std::uint32_t>(value));
  return result;
}

void expect_same(const Table& a, const Table& b) {
  const auto same_axis = [](const Axis& x, const Axis& y) {
    EXPECT_EQ(x.name, y.name);
    EXPECT_EQ(x.unit, y.unit);
    EXPECT_EQ(x.values, y.values);
    EXPECT_EQ(x.midpoints, y.midpoints);
  };
  same_axis(a.grid.theta_i, b.grid.theta_i);
  same_axis(a.grid.theta_o, b.grid.theta_o);
  same_axis(a.grid.phi, b.grid.phi);
  ASSERT_EQ(a.parameter_axes.size(), b.parameter_axes.size());
  for (std::size_t i = 0; i < a.parameter_axes.size(); ++i) same_axis(a.parameter_axes[i], b.parameter_axes[i]);
  EXPECT_EQ(a.channels, b.channels);
  EXPECT_EQ(a.model, b.model);
  EXPECT_EQ(a.parameters, b.parameters);
  EXPECT_EQ(a.method, b.method);
  EXPECT_EQ(a.seed, b.seed);
  EXPECT_EQ(a.samples, b.samples);
  EXPECT_EQ(a.shared_facets, b.shared_facets);
  EXPECT_EQ(a.sampler, b.sampler);
  EXPECT_EQ(a.stderr_target, b.stderr_target);
  EXPECT_EQ(a.shards, b.shards);
  EXPECT_EQ(a.version, b.version);
  EXPECT_EQ(a.command, b.command);
  EXPECT_EQ(bits(a.values), bits(b.values));
  EXPECT_EQ(bits(a.stderr_values), bits(b.stderr_values));
  EXPECT_EQ(bits(a.replicates), bits(b.replicates));
  EXPECT_EQ(bits(a.sample_counts), bits(b.sample_counts));
  EXPECT_EQ(a.valid, b.valid);
}

// ---- axes and grids ---------------------------------------------------------------------------------------------

TEST(Axis, WeightsAreTrapezoidsOrCells) {
  EXPECT_EQ(axis("x", {7.0}).weights(), (std::vector{1.0}));
  EXPECT_EQ(axis("x", {0.0, 1.0, 4.0}).weights(), (std::vector{0.5, 2.0, 1.5}));
  Axis cells = axis("x", {5.0, 15.0, 25.0});
  cells.midpoints = true;
  EXPECT_EQ(cells.weights(), (std::vector{10.0, 10.0, 10.0}));
}

TEST(Axis, PointWeightsIntegrateBrokenLinesExactly) {
  // The trapezoidal rule is exact for what is linear between the points.
  UniformNumbers uniform(1);
  std::vector<double> points{0.0};
  for (int i = 0; i < 9; ++i) points.push_back(points.back() + uniform.between(0.1, 2.0));
  const std::vector<double> weights = axis("x", points).weights();
  double constant = 0.0, linear = 0.0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    constant += weights[i];
    linear += weights[i] * points[i];
  }
  EXPECT_NEAR(constant, points.back(), 1e-13);
  EXPECT_NEAR(linear, 0.5 * points.back() * points.back(), 1e-12);
}

TEST(Grid, NamedGridsAreTheContracts) {
  const auto sizes = [](const Grid& grid) {
    return std::array{grid.theta_i.size(), grid.theta_o.size(), grid.phi.size()};
  };
  EXPECT_EQ(sizes(Grid::named_or_file("small")), (std::array<std::size_t, 3>{9, 9, 10}));
  EXPECT_EQ(sizes(Grid::named_or_file("default")), (std::array<std::size_t, 3>{18, 18, 19}));
  EXPECT_EQ(sizes(Grid::named_or_file("fine")), (std::array<std::size_t, 3>{36, 36, 37}));
  for (const char* name : {"small", "default", "fine"}) {
    const Grid grid = Grid::named_or_file(name);
    EXPECT_EQ(grid.phi.values.front(), 0.0);
    EXPECT_EQ(grid.phi.values.back(), 180.0);
    EXPECT_EQ(grid.theta_i.values, grid.theta_o.values);
    EXPECT_LT(grid.theta_i.values.back(), 90.0);
    EXPECT_EQ(grid.theta_i.values.front(), 0.0);
  }
  expect_error(ExitCode::usage, "unknown grid 'defualt'", [] { Grid::named_or_file("defualt"); });
}

TEST(Grid, ComplaintsNameTheirPlace) {
  const auto parse = [](const char* text) { Grid::from_json(parse_json(text, "g.json"), "g.json"); };
  struct Case {
    const char* text;
    const char* fragment;
  };
  for (const Case& c : {
           Case{R"({"theta_i":[0,90],"theta_o":[0],"phi":[0]})", "g.json, $.theta_i"},
           {R"({"theta_i":[0],"theta_o":[-1,5],"phi":[0]})", "g.json, $.theta_o"},
           {R"({"theta_i":[0],"theta_o":[0],"phi":[0,360]})", "g.json, $.phi"},
           {R"({"theta_i":[0,20,10],"theta_o":[0],"phi":[0]})", "g.json, $.theta_i): sort"},
           {R"({"theta_i":[0,20,20],"theta_o":[0],"phi":[0]})", "g.json, $.theta_i): sort"},
           {R"({"theta_i":[],"theta_o":[0],"phi":[0]})", "g.json, $.theta_i"},
           {R"({"theta_i":[0,"10"],"theta_o":[0],"phi":[0]})", "g.json, $.theta_i[1]"},
           {R"({"theta_i":[0,null],"theta_o":[0],"phi":[0]})", "g.json, $.theta_i[1]"},
           {R"({"theta_i":30,"theta_o":[0],"phi":[0]})", "g.json, $.theta_i"},
           {R"({"theta_i":[0],"theta_o":[0]})", "missing 'phi' (g.json, $)"},
           {R"({"theta_i":[0],"theta_o":[0],"phi":[0],"thetao":[1]})", "did you mean 'theta_o'"},
           {R"({"theta_i":[0],"theta_o":[0],"phi":[0],"midpoints":1})", "g.json, $.midpoints"},
           {R"([1,2])", "expected an object (g.json, $)"},
           {R"({"theta_i":[0],)", "g.json, line 1"},
           {"{\"theta_i\":[0],\n\"theta_o\":[NaN]}", "g.json, line 2"},
           {"{\n\n\"theta_i\":[1e999]}", "g.json"},
           {"", "g.json"},
       }) {
    expect_error(
        ExitCode::invalid_input, c.fragment, [&] { parse(c.text); }, c.text);
  }
  // NaN can't be written in JSON, but in a document made by a program.
  Json document{{"theta_i", {0.0, std::nan("")}}, {"theta_o", {0.0}}, {"phi", {0.0}}};
  expect_error(ExitCode::invalid_input, "$.theta_i", [&] { Grid::from_json(document, "g.json"); });
}

TEST_F(TableFiles, GridsAreReadFromFiles) {
  write_bytes(file("grid.json"), R"({"theta_i":[5,15],"theta_o":[0.5],"phi":[0,180],"midpoints":true})");
  const Grid grid = Grid::named_or_file(file("grid.json").string());
  EXPECT_EQ(grid.theta_i.values, (std::vector{5.0, 15.0}));
  EXPECT_EQ(grid.theta_o.values, (std::vector{0.5}));
  EXPECT_EQ(grid.phi.values, (std::vector{0.0, 180.0}));
  EXPECT_TRUE(grid.theta_i.midpoints);
  write_bytes(file("bad.json"), "{");
  expect_error(ExitCode::invalid_input, "bad.json", [&] { Grid::named_or_file(file("bad.json").string()); });
}

// ---- layout -----------------------------------------------------------------------------------------------------

TEST(Table, EntriesLieWhereTheContractSays) {
  Table table;
  table.grid = small_grid();
  table.parameter_axes = {axis("first", {0.1, 0.2}, ""), axis("second", {1.0, 2.0, 3.0}, "")};
  table.allocate();
  ASSERT_EQ(table.width(), 3u * 4u);
  ASSERT_EQ(table.height(), 3u * 6u);
  for (std::size_t first = 0; first < 2; ++first) {
    for (std::size_t second = 0; second < 3; ++second) {
      for (std::size_t o = 0; o < 3; ++o) {
        for (std::size_t i = 0; i < 4; ++i) {
          for (std::size_t p = 0; p < 3; ++p) {
            const std::size_t x = p + 3 * i, y = o + 3 * (second + 3 * first);
            const std::size_t entry = y * table.width() + x;
            EXPECT_EQ(table.phi_index(entry), p);
            EXPECT_EQ(table.theta_i_index(entry), i);
            EXPECT_EQ(table.theta_o_index(entry), o);
            EXPECT_EQ(table.parameter_row(entry), second + 3 * first);
            EXPECT_EQ(table.parameter_values(table.parameter_row(entry)),
                      (std::vector{table.parameter_axes[0].values[first], table.parameter_axes[1].values[second]}));
            // Polar angles are those of the axes, and azimuth 0 is the retro side: both azimuths the same.
            const Direction wi = table.wi(entry), wo = table.wo(entry);
            EXPECT_NEAR(degrees(std::acos(wi.z)), table.grid.theta_i.values[i], 1e-6);
            EXPECT_NEAR(degrees(std::acos(wo.z)), table.grid.theta_o.values[o], 1e-6);
            const double cos_phi = std::cos(radians(table.grid.phi.values[p]));
            EXPECT_NEAR(dot(wi, wo) - wi.z * wo.z, cos_phi * std::sqrt((1.0 - wi.z * wi.z) * (1.0 - wo.z * wo.z)),
                        1e-12);
          }
        }
      }
    }
  }
}

TEST_F(TableFiles, AreReadableAsPictures) {
  // Values that tell where they belong, read back by OpenEXR alone.
  Table table;
  table.grid = small_grid();
  table.parameter_axes = {axis("alpha", {0.1, 0.9}, "")};
  table.model = "made_up";
  table.parameters = Json::object();
  table.method = "exact";
  table.allocate();
  const auto truth = [](std::size_t x, std::size_t y) { return static_cast<float>(1000 * y + x) + 0.25f; };
  for (std::size_t entry = 0; entry < table.entries(); ++entry) {
    table.values[entry] = truth(entry % table.width(), entry / table.width());
    table.stderr_values[entry] = -table.values[entry];
  }
  table.valid[5] = 0;
  table.write(file("t.exr"));

  Imf::InputFile picture(file("t.exr").c_str());
  const auto window = picture.header().dataWindow();
  const std::size_t width = table.width(), height = table.height();
  ASSERT_EQ(window.max.x, static_cast<int>(width) - 1);
  ASSERT_EQ(window.max.y, static_cast<int>(height) - 1);
  EXPECT_EQ(picture.header().compression(), Imf::ZIP_COMPRESSION);
  std::set<std::string> names;
  for (auto channel = picture.header().channels().begin(); channel != picture.header().channels().end(); ++channel) {
    names.insert(channel.name());
    EXPECT_EQ(channel.channel().type, Imf::FLOAT);
  }
  EXPECT_EQ(names, (std::set<std::string>{"Y", "A", "stderr.Y"}));
  for (const char* attribute :
       {"coordinates", "axes", "quantity", "reference", "params", "seed", "samples", "version", "command"}) {
    EXPECT_NE(picture.header().findTypedAttribute<Imf::StringAttribute>(std::string("lobefit:") + attribute), nullptr)
        << attribute;
  }
  const auto attribute = [&](const char* name) {
    return picture.header().typedAttribute<Imf::StringAttribute>(std::string("lobefit:") + name).value();
  };
  EXPECT_EQ(attribute("coordinates"), "spherical");
  EXPECT_EQ(attribute("quantity"), "brdf 1/sr");
  EXPECT_EQ(attribute("reference"), "made_up");
  bool has_alpha = false;
  for (const Json& json : Json::parse(attribute("axes"))) {
    has_alpha = has_alpha || (json["name"] == "alpha" && json["values"] == Json({0.1, 0.9}) && json.contains("unit") &&
                              json["kind"] == "points" && json["weights"].size() == 2);
  }
  EXPECT_TRUE(has_alpha) << attribute("axes");

  std::map<std::string, std::vector<float>> planes;
  Imf::FrameBuffer frame;
  for (const std::string& name : names) {
    planes[name].resize(width * height);
    frame.insert(name,
                 {Imf::FLOAT, reinterpret_cast<char*>(planes[name].data()), sizeof(float), sizeof(float) * width});
  }
  picture.setFrameBuffer(frame);
  picture.readPixels(0, static_cast<int>(height) - 1);
  for (std::size_t y = 0; y < height; ++y) {
    for (std::size_t x = 0; x < width; ++x) {
      const std::size_t pixel = y * width + x;
      EXPECT_EQ(planes["Y"][pixel], truth(x, y));
      EXPECT_EQ(planes["stderr.Y"][pixel], -truth(x, y));
      EXPECT_EQ(planes["A"][pixel], x == 5 && y == 0 ? 0.0f : 1.0f);
    }
  }
}

// ---- round trips ------------------------------------------------------------------------------------------------

TEST_F(TableFiles, RoundTripsKeepEveryBit) {
  const RenderOptions shared{.sampling = {.samples = 320, .seed = 7}};
  const RenderOptions adaptive{.sampling = {.samples = 320, .stderr_target = 5e-3, .seed = 18446744073709551615u},
                               .shared_facets = false};
  const RenderOptions exact{.exact = true};
  ParameterValues coloured = microfacet_diffuse();
  coloured.set("albedo", std::array{0.25, 0.5, 1.0});
  coloured.set_text("masking", "separable");
  int index = 0;
  for (const ParameterValues& values : {microfacet_diffuse(), coloured}) {
    for (const RenderOptions& options : {shared, adaptive, exact}) {
      Table table = monte_carlo(values, options);
      table.command = "lobefit render … \"quoted\"\nand more";
      table.valid[3] = 0;
      table.grid.theta_i.midpoints = true;
      const fs::path path = file(std::to_string(index++) + ".exr");
      table.write(path);
      const Table back = Table::read(path);
      expect_same(table, back);
      EXPECT_EQ(back.masked(), 1u);
      EXPECT_EQ(back.replicates.size(), options.exact || !options.shared_facets ? 0u : 32 * table.values.size());
      EXPECT_EQ(back.sample_counts.empty(), options.sampling.stderr_target == 0.0);
    }
  }
}

TEST_F(TableFiles, OddFloatsSurvive) {
  Table table = monte_carlo(microfacet_diffuse(), {.exact = true});
  const std::array odd{-0.0f, std::numeric_limits<float>::denorm_min(), std::numeric_limits<float>::max(),
                       std::numeric_limits<float>::lowest(), std::nextafter(1.0f, 2.0f)};
  std::copy(odd.begin(), odd.end(), table.values.begin());
  table.write(file("odd.exr"));
  EXPECT_EQ(bits(Table::read(file("odd.exr")).values), bits(table.values));
}

TEST_F(TableFiles, ConstantTablesRoundTrip) {
  // Nothing packs better: the file is hundreds of times smaller than its pixels, and still no fraud.
  Monitor monitor;
  const Table table =
      render(find_model("lambert"), find_model("lambert").defaults(), {}, Grid::named_or_file("fine"), monitor);
  table.write(file("t.exr"));
  EXPECT_LT(fs::file_size(file("t.exr")) * 20, 12 * table.entries());
  expect_same(table, Table::read(file("t.exr")));
}

TEST_F(TableFiles, RendersAreTheSameBytesForAnyNumberOfThreads) {
  for (const RenderOptions& options :
       {RenderOptions{.sampling = {.samples = 640}},
        RenderOptions{.sampling = {.samples = 320}, .shared_facets = false},
        RenderOptions{.sampling = {.samples = 320, .stderr_target = 5e-3}},
        RenderOptions{.sampling = {.samples = 320, .sampler = Sampler::philox}}, RenderOptions{.exact = true}}) {
    std::vector<std::string> files;
    for (const std::size_t threads : {1, 2, 2, 1}) {
      const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
      monte_carlo(microfacet_diffuse(), options).write(file("t.exr"));
      files.push_back(bytes_of(file("t.exr")));
    }
    for (const std::string& other : files) EXPECT_EQ(other, files[0]);
  }
}

TEST(Table, SeedsAndSamplersMakeDifferentTables) {
  const auto values = [](SamplingOptions sampling) {
    return monte_carlo(microfacet_diffuse(), {.sampling = sampling}).values;
  };
  const std::vector<float> first = values({.samples = 320, .seed = 1});
  EXPECT_EQ(first, values({.samples = 320, .seed = 1}));
  EXPECT_NE(first, values({.samples = 320, .seed = 2}));
  EXPECT_NE(first, values({.samples = 320, .sampler = Sampler::philox, .seed = 1}));
}

TEST(Table, SurfacesHaveNoDirectionsBeyondTheHorizon) {
  Monitor silent;
  Grid grid = small_grid();
  grid.theta_o.values.back() = 90.0;
  expect_error(ExitCode::usage, "theta_o = 90 is out of range", [&] {
    render(find_reference("microfacet_diffuse"), microfacet_diffuse(), {}, grid, {.sampling = {.samples = 64}}, silent);
  });
}

TEST(Table, ExactRendersHoldTheReferencesValues) {
  const Table table = monte_carlo(microfacet_diffuse(), {.exact = true});
  const Reference& reference = find_reference("microfacet_diffuse");
  for (const std::size_t entry : {std::size_t{0}, std::size_t{17}, std::size_t{40}, table.entries() - 1}) {
    const ParameterValues values = microfacet_diffuse(table.parameter_values(table.parameter_row(entry))[0]);
    const Rgb f = reference.make(values)->exact(table.wi(entry), table.wo(entry));
    EXPECT_EQ(table.value(entry), static_cast<float>(f.x));
    EXPECT_EQ(table.standard_error(entry), 0.0f);
  }
}

TEST(Table, AdaptiveSamplingMeetsItsTargetEverywhere) {
  for (const bool shared : {true, false}) {
    const Table table = monte_carlo(microfacet_diffuse(),
                                    {.sampling = {.samples = 64, .stderr_target = 2e-3}, .shared_facets = shared});
    ASSERT_EQ(table.sample_counts.size(), table.entries());
    std::set<float> counts;
    for (std::size_t entry = 0; entry < table.entries(); ++entry) {
      EXPECT_LE(table.standard_error(entry), 2e-3f);
      counts.insert(table.sample_counts[entry]);
    }
    EXPECT_GT(counts.size(), 1u) << "some entries should need more samples than others";
  }
}

TEST(Table, ReplicatesAverageToTheValues) {
  const Table table = monte_carlo(microfacet_diffuse(), {.sampling = {.samples = 320}});
  ASSERT_EQ(table.replicates.size(), 32 * table.values.size());
  for (std::size_t entry = 0; entry < table.entries(); ++entry) {
    double sum = 0.0, squares = 0.0;
    for (int r = 0; r < 32; ++r) {
      sum += table.replicate(r, entry);
      squares += std::pow(table.replicate(r, entry), 2);
    }
    const double mean = sum / 32.0, variance = (squares - sum * mean) / 31.0 / 32.0;
    EXPECT_NEAR(table.value(entry), mean, 1e-6 * mean);
    EXPECT_NEAR(table.standard_error(entry), std::sqrt(std::max(variance, 0.0)), 1e-5 * mean);
  }
}

TEST(Table, ColouredAlbedosMakeColouredTables) {
  ParameterValues values = microfacet_diffuse();
  EXPECT_EQ(monte_carlo(values, {.exact = true}).channels, 1);
  values.set("albedo", std::array{0.5, 0.5, 0.5});
  EXPECT_EQ(monte_carlo(values, {.exact = true}).channels, 1) << "grey needs one channel";
  values.set("albedo", std::array{0.2, 0.4, 0.8});
  const Table table = monte_carlo(values, {.exact = true});
  ASSERT_EQ(table.channels, 3);
  ASSERT_EQ(table.values.size(), 3 * table.entries());
  for (std::size_t entry = 0; entry < table.entries(); ++entry) {
    EXPECT_NEAR(table.value(entry, 1), 2.0f * table.value(entry, 0), 1e-6f * table.value(entry, 1));
    EXPECT_NEAR(table.value(entry, 2), 4.0f * table.value(entry, 0), 1e-6f * table.value(entry, 2));
  }
}

TEST_F(TableFiles, ColouredTablesHaveColourChannels) {
  ParameterValues values = microfacet_diffuse();
  values.set("albedo", std::array{0.2, 0.4, 0.8});
  monte_carlo(values, {.exact = true}).write(file("rgb.exr"));
  Imf::InputFile picture(file("rgb.exr").c_str());
  std::set<std::string> names;
  for (auto channel = picture.header().channels().begin(); channel != picture.header().channels().end(); ++channel) {
    names.insert(channel.name());
  }
  EXPECT_EQ(names, (std::set<std::string>{"R", "G", "B", "A", "stderr.R", "stderr.G", "stderr.B"}));
}

TEST(Table, RowSlicesAreTablesOfOneRow) {
  const Table table = monte_carlo(microfacet_diffuse(), {.sampling = {.samples = 320, .stderr_target = 1e-2}});
  ASSERT_EQ(table.parameter_rows(), 2u);
  for (std::size_t row = 0; row < 2; ++row) {
    const Table slice = table.row_slice(row);
    EXPECT_TRUE(slice.parameter_axes.empty());
    EXPECT_EQ(slice.parameters["alpha"], table.parameter_axes[0].values[row]);
    ASSERT_EQ(slice.entries(), table.entries() / 2);
    for (std::size_t entry = 0; entry < slice.entries(); ++entry) {
      const std::size_t whole = row * slice.entries() + entry;
      EXPECT_EQ(slice.value(entry), table.value(whole));
      EXPECT_EQ(slice.standard_error(entry), table.standard_error(whole));
      EXPECT_EQ(slice.replicate(31, entry), table.replicate(31, whole));
      EXPECT_EQ(slice.sample_counts[entry], table.sample_counts[whole]);
      EXPECT_EQ(slice.wi(entry).x, table.wi(whole).x);
      EXPECT_EQ(slice.wo(entry).x, table.wo(whole).x);
    }
  }
}

TEST(Table, InterpolationIsExactForWhatIsLinearInTheAngles) {
  Table table;
  table.grid = small_grid();
  table.parameter_axes = {axis("alpha", {0.1, 0.9}, "")};
  table.allocate();
  const auto linear = [](double theta_i, double theta_o, double phi, std::size_t row) {
    return 3.0 + 0.01 * theta_i - 0.02 * theta_o + 0.005 * phi + 10.0 * static_cast<double>(row);
  };
  for (std::size_t entry = 0; entry < table.entries(); ++entry) {
    table.values[entry] = static_cast<float>(linear(
        table.grid.theta_i.values[table.theta_i_index(entry)], table.grid.theta_o.values[table.theta_o_index(entry)],
        table.grid.phi.values[table.phi_index(entry)], table.parameter_row(entry)));
  }
  UniformNumbers uniform(4);
  for (int trial = 0; trial < 100; ++trial) {
    const double theta_i = uniform.between(1.0, 80.0), theta_o = uniform.between(1.0, 85.0);
    const double phi = uniform.between(0.0, 180.0), turn = uniform.between(0.0, 360.0);
    const std::size_t row = static_cast<std::size_t>(trial) % 2;
    // The azimuth difference alone counts, and its sign does not.
    const Direction light = direction(radians(theta_i), radians(turn + (trial % 3 == 0 ? phi : -phi)));
    const Direction view = direction(radians(theta_o), radians(turn));
    EXPECT_NEAR(table.interpolate(row, light, view).x, linear(theta_i, theta_o, phi, row), 1e-5);
  }
  expect_error(ExitCode::usage, "theta_i",
               [&] { table.interpolate(0, direction(radians(81.0), 0.0), direction(radians(10.0), 0.0)); });
  table.valid[0] = 0;
  expect_error(ExitCode::usage, "masked",
               [&] { table.interpolate(0, direction(radians(5.0), 0.0), direction(radians(5.0), 0.0)); });
}

// ---- what is not a number ---------------------------------------------------------------------------------------

/// Lambert, but not a number or infinite where the light is low.
Rgb broken_evaluate(std::span<const double>, const Direction& wi, const Direction&) {
  const double f = wi.z > 0.8 ? 1.0 / pi : wi.z > 0.5 ? std::nan("") : 1e300;
  return {f, f, f};
}

TEST(Table, WhatIsNotFiniteIsMaskedAndCounted) {
  static constexpr ModelInfo info{.name = "broken"};
  Model model{.info = &info};
  model.evaluate = broken_evaluate;
  Monitor monitor;
  const Table table = render(model, ParameterValues({}, "broken"), {}, small_grid(), monitor);
  // Of the lights at 0, 20, 50 and 80 degrees the last two are broken; 1e300 is too large for the table's floats.
  EXPECT_EQ(table.masked(), table.entries() / 2);
  EXPECT_EQ(table.describe()["masked"], table.entries() / 2);
  for (std::size_t entry = 0; entry < table.entries(); ++entry) {
    EXPECT_EQ(table.valid[entry] != 0, table.theta_i_index(entry) < 2);
  }
}

TEST_F(TableFiles, WhatIsNotFiniteInAFileIsMasked) {
  const float nan = std::numeric_limits<float>::quiet_NaN(), infinity = std::numeric_limits<float>::infinity();
  Table table = monte_carlo(microfacet_diffuse(), {.sampling = {.samples = 320}});
  table.values[1] = nan;
  table.values[2] = infinity;
  table.stderr_values[3] = nan;
  table.stderr_values[4] = infinity;
  table.valid[5] = 0;
  table.write(file("t.exr"));
  const Table back = Table::read(file("t.exr"));
  EXPECT_EQ(back.masked(), 5u);
  for (std::size_t entry = 0; entry < 7; ++entry) EXPECT_EQ(back.valid[entry] != 0, entry == 0 || entry == 6) << entry;
}

TEST_F(TableFiles, ReplicatesThatAreNotFiniteMaskTheirEntry) {
  // They would make every error of a fit NaN.
  Table table = monte_carlo(microfacet_diffuse(), {.sampling = {.samples = 320}});
  table.replicates[5 * table.values.size() + 9] = std::numeric_limits<float>::quiet_NaN();
  table.write(file("t.exr"));
  const Table back = Table::read(file("t.exr"));
  EXPECT_EQ(back.masked(), 1u);
  EXPECT_EQ(back.valid[9], 0);
}

// ---- bad files --------------------------------------------------------------------------------------------------

/// Most memory this process ever held, in bytes.
std::size_t peak_memory() {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    if (line.starts_with("VmHWM:")) return std::stoul(line.substr(6)) * 1024;
  }
  return 0;
}

void expect_unreadable(const fs::path& path, const std::string& what) {
  const std::size_t before = peak_memory();
  expect_error(
      ExitCode::invalid_input, path.filename().string(), [&] { Table::read(path); }, what);
  EXPECT_LT(peak_memory() - before, std::size_t{512} << 20) << what << " took too much memory";
}

TEST_F(TableFiles, ForeignFilesAreRefusedByName) {
  expect_unreadable(file("missing.exr"), "no file");
  expect_unreadable(folder_, "a folder");
  const std::pair<const char*, std::string> contents[] = {
      {"empty.exr", ""},
      {"text.exr", "theta_i,theta_o,phi\n0,0,0\n"},
      {"json.exr", R"({"theta_i":[0]})"},
      {"picture.png", std::string("\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\0\1\0\0\0\1\x8\2\0\0\0", 29)},
      {"zeros.exr", std::string(4096, '\0')},
      {"magic.exr", std::string("\x76\x2f\x31\x01", 4)},
      {"magic_and_version.exr", std::string("\x76\x2f\x31\x01\x02\0\0\0", 8)},
      {"magic_and_noise.exr", std::string("\x76\x2f\x31\x01\x02\0\0\0", 8) + std::string(5000, '\xa5')}};
  for (const auto& [name, content] : contents) {
    write_bytes(file(name), content);
    expect_unreadable(file(name), name);
  }
}

TEST_F(TableFiles, TruncatedFilesAreRefused) {
  monte_carlo(microfacet_diffuse(), {.sampling = {.samples = 320}}).write(file("whole.exr"));
  const std::string bytes = bytes_of(file("whole.exr"));
  for (std::size_t k = 0; k < 20; ++k) {
    // From a few bytes to all but one.
    const std::size_t length = k < 19 ? bytes.size() * k / 19 + 2 : bytes.size() - 1;
    write_bytes(file("cut.exr"), bytes.substr(0, length));
    expect_unreadable(file("cut.exr"), std::to_string(length) + " of " + std::to_string(bytes.size()) + " bytes");
  }
}

TEST_F(TableFiles, FlippedBytesDoNoHarm) {
  // A flipped byte may go unnoticed (in a value) or not; it must not crash, hang, or throw anything but an Error.
  monte_carlo(microfacet_diffuse(), {.sampling = {.samples = 320}}).write(file("whole.exr"));
  const std::string bytes = bytes_of(file("whole.exr"));
  UniformNumbers uniform(9);
  const std::size_t before = peak_memory();
  int refused = 0;
  for (int trial = 0; trial < 600; ++trial) {
    std::string broken = bytes;
    // Half of them in the header, where a byte decides about sizes.
    const double reach = static_cast<double>(trial % 2 == 0 ? std::min<std::size_t>(bytes.size(), 5000) : bytes.size());
    const auto place = static_cast<std::size_t>(uniform() * reach);
    broken[place] = static_cast<char>(uniform() * 256.0);
    write_bytes(file("broken.exr"), broken);
    try {
      const Table table = Table::read(file("broken.exr"));
      EXPECT_EQ(table.values.size(), table.entries() * static_cast<std::size_t>(table.channels));
      for (std::size_t entry = 0; entry < table.entries(); ++entry) {
        if (table.valid[entry]) {
          EXPECT_TRUE(std::isfinite(table.value(entry))) << place;
        }
      }
    } catch (const Error& error) {
      ++refused;
      EXPECT_EQ(error.code(), ExitCode::invalid_input) << place << ": " << error.what();
      EXPECT_NE(std::string(error.what()).find("broken.exr"), std::string::npos) << error.what();
    } catch (const std::exception& error) {
      ADD_FAILURE() << "byte " << place << ": " << error.what();
    }
  }
  EXPECT_GT(refused, 50);
  EXPECT_LT(peak_memory() - before, std::size_t{512} << 20);
}

using Attributes = std::map<std::string, std::string>;

/// The attributes of a table of one pixel; tests break them one at a time.
Attributes good_attributes() {
  return {{"coordinates", "spherical"},
          {"axes", R"([{"name":"theta_o","unit":"degree","kind":"points","values":[0],"weights":[1]},
                       {"name":"theta_i","unit":"degree","kind":"points","values":[0],"weights":[1]},
                       {"name":"phi","unit":"degree","kind":"points","values":[0],"weights":[1]}])"},
          {"quantity", "brdf 1/sr"},
          {"reference", "lambert"},
          {"params", R"({"albedo":[1.0,1.0,1.0]})"},
          {"method", "exact"},
          {"seed", "0"},
          {"samples", "0"},
          {"shared_facets", "false"},
          {"version", "0.1.0"},
          {"command", ""}};
}

/// A picture by OpenEXR with these attributes; its pixels are written only if asked for.
void write_picture(const fs::path& path, int width, int height, const Attributes& attributes,
                   const std::vector<std::string>& channels = {"Y", "A", "stderr.Y"}, bool pixels = true,
                   Imf::PixelType type = Imf::FLOAT) {
  Imf::Header header(width, height);
  header.compression() = Imf::ZIP_COMPRESSION;
  for (const auto& [name, text] : attributes) header.insert("lobefit:" + name, Imf::StringAttribute(text));
  for (const std::string& channel : channels) header.channels().insert(channel, Imf::Channel(type));
  Imf::OutputFile picture(path.c_str(), header);
  if (!pixels) return;
  std::vector<float> plane(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), 1.0f);
  Imf::FrameBuffer frame;
  const std::size_t size = type == Imf::FLOAT ? 4 : 2;
  for (const std::string& channel : channels) {
    frame.insert(channel, {type, reinterpret_cast<char*>(plane.data()), size, size * static_cast<std::size_t>(width)});
  }
  picture.setFrameBuffer(frame);
  picture.writePixels(height);
}

TEST_F(TableFiles, OtherPicturesAreRefused) {
  write_picture(file("good.exr"), 1, 1, good_attributes());
  EXPECT_EQ(Table::read(file("good.exr")).value(0), 1.0f) << "the test's own file has to be a table";

  write_picture(file("plain.exr"), 4, 4, {}, {"R", "G", "B"});
  expect_error(ExitCode::invalid_input, "not a lobefit table", [&] { Table::read(file("plain.exr")); });
  for (const auto& [name, ignored] : good_attributes()) {
    if (name == "quantity") continue;  // told, never asked
    Attributes attributes = good_attributes();
    attributes.erase(name);
    write_picture(file("incomplete.exr"), 1, 1, attributes);
    expect_error(ExitCode::invalid_input, "lobefit:" + name, [&] { Table::read(file("incomplete.exr")); });
  }
  write_picture(file("size.exr"), 3, 2, good_attributes());
  expect_error(ExitCode::invalid_input, "3 × 2", [&] { Table::read(file("size.exr")); });
  for (const std::vector<std::string>& channels :
       std::vector<std::vector<std::string>>{{"Y", "A"},
                                             {"Y", "stderr.Y"},
                                             {"R", "G", "A", "stderr.R", "stderr.G"},
                                             {"A"},
                                             {"Y", "A", "stderr.Y", "replicate.0.Y"}}) {
    write_picture(file("channels.exr"), 1, 1, good_attributes(), channels);
    expect_unreadable(file("channels.exr"), "channels are missing");
  }
  write_picture(file("half.exr"), 1, 1, good_attributes(), {"Y", "A", "stderr.Y"}, true, Imf::HALF);
  expect_unreadable(file("half.exr"), "half floats");
}

TEST_F(TableFiles, BrokenAttributesAreRefused) {
  const auto axes = [](const std::string& theta_i, const std::string& kind = "points") {
    return R"([{"name":"theta_o","unit":"degree","kind":"points","values":[0],"weights":[1]},
               {"name":"theta_i","unit":"degree","kind":")" +
           kind + R"(","values":)" + theta_i + R"(,"weights":[1]},
               {"name":"phi","unit":"degree","kind":"points","values":[0],"weights":[1]}])";
  };
  const std::pair<std::string, std::string> broken[] = {{"coordinates", "rusinkiewicz"},
                                                        {"axes", ""},
                                                        {"axes", "{}"},
                                                        {"axes", "[]"},
                                                        {"axes", "[{\"name\":\"theta_i\"}]"},
                                                        {"axes", axes("[]")},
                                                        {"axes", axes("[null]")},
                                                        {"axes", axes("[NaN]")},
                                                        {"axes", axes("[1e999]")},
                                                        {"axes", axes("[\"0\"]")},
                                                        {"axes", axes("0")},
                                                        {"axes", axes("[181]")},
                                                        {"axes", axes("[-1]")},
                                                        {"axes", axes("[123456]")},
                                                        {"axes", axes("[0]", "wavelets")},
                                                        {"params", ""},
                                                        {"params", "[1]"},
                                                        {"params", "3"},
                                                        {"params", "{\"albedo\":1e999}"},
                                                        {"seed", "-1"},
                                                        {"seed", "1e3"},
                                                        {"seed", "99999999999999999999"},
                                                        {"samples", ""},
                                                        {"samples", "many"},
                                                        {"stderr_target", "small"},
                                                        {"shard", "0/3"},
                                                        {"shard", "1/2"},
                                                        {"shard", ""}};
  for (const auto& [name, text] : broken) {
    Attributes attributes = good_attributes();
    attributes[name] = text;
    write_picture(file("broken.exr"), 1, 1, attributes);
    expect_unreadable(file("broken.exr"), "lobefit:" + name + " = " + text);
  }
  // Angles that do not increase.
  Attributes attributes = good_attributes();
  attributes["axes"] = axes("[20,10]");
  write_picture(file("order.exr"), 2, 1, attributes);
  expect_unreadable(file("order.exr"), "decreasing angles");
}

TEST_F(TableFiles, GiganticClaimsTakeNoMemory) {
  // The data window is patched in the bytes: OpenEXR would not write such a file.
  write_picture(file("good.exr"), 1, 1, good_attributes());
  const std::string good = bytes_of(file("good.exr"));
  const std::size_t window = good.find(std::string("dataWindow\0box2i\0", 17)) + 17 + 4;
  for (const int largest :
       {1'000'000, 100'000'000, std::numeric_limits<int>::max() - 1, std::numeric_limits<int>::max(), -5}) {
    for (const auto& [x, y] : {std::pair{largest, 0}, {0, largest}, {largest, largest}}) {
      std::string bytes = good;
      std::memcpy(bytes.data() + window + 8, &x, 4);
      std::memcpy(bytes.data() + window + 12, &y, 4);
      write_bytes(file("huge.exr"), bytes);
      expect_unreadable(file("huge.exr"), std::to_string(x) + " × " + std::to_string(y));
    }
  }
}

TEST_F(TableFiles, GiganticAxesTakeNoMemory) {
  // Axes and picture agree on 400 million entries, in a file of a few hundred kilobytes without pixels.
  const auto values = [](int count, double step) {
    std::string text = "[0";
    for (int i = 1; i < count; ++i) text += "," + number_text(i * step);
    return text + "]";
  };
  Attributes attributes = good_attributes();
  attributes["axes"] = R"([{"name":"theta_o","unit":"degree","kind":"points","values":)" + values(2000, 0.04) +
                       R"(,"weights":[1]},{"name":"theta_i","unit":"degree","kind":"points","values":)" +
                       values(2000, 0.04) +
                       R"(,"weights":[1]},{"name":"phi","unit":"degree","kind":"points","values":)" + values(100, 1.0) +
                       R"(,"weights":[1]}])";
  write_picture(file("huge.exr"), 200'000, 2000, attributes, {"Y", "A", "stderr.Y"}, false);
  ASSERT_LT(fs::file_size(file("huge.exr")), 1u << 20);
  expect_unreadable(file("huge.exr"), "400 million entries");
}

TEST_F(TableFiles, ParametersOfATableAreHeldToTheModelsRange) {
  // A table says alpha = 7, or nonsense: whoever lays a model over it has to get an Error, not another exception.
  Table table = monte_carlo(microfacet_diffuse(), {.exact = true}).row_slice(0);
  for (const Json& nonsense : {Json(7.0), Json(nullptr), Json{{"x", 1}}, Json{0.1, 0.2}, Json(true)}) {
    table.parameters["alpha"] = nonsense;
    expect_error(
        ExitCode::invalid_input, "alpha", [&] { with_table_parameters(find_model("proxima").defaults(), table); },
        nonsense.dump());
  }
}

// ---- output files -----------------------------------------------------------------------------------------------

TEST_F(TableFiles, OutputAppearsOnCommitOnly) {
  {
    OutputFile output(file("out.txt"), false);
    output.write("half of the cont");
    EXPECT_FALSE(fs::exists(file("out.txt")));
  }
  EXPECT_EQ(files_in_folder(), 0u) << "an abandoned output leaves nothing";
  {
    OutputFile output(file("out.txt"), false);
    EXPECT_EQ(output.temporary().extension(), ".txt");
    output.write("content");
    output.commit();
  }
  EXPECT_EQ(bytes_of(file("out.txt")), "content");
  EXPECT_EQ(files_in_folder(), 1u);
}

TEST_F(TableFiles, OutputReplacesOnlyWhenTold) {
  write_bytes(file("out.txt"), "old");
  expect_error(ExitCode::usage, "out.txt", [&] { OutputFile(file("out.txt"), false); });
  { OutputFile abandoned(file("out.txt"), true); }
  EXPECT_EQ(bytes_of(file("out.txt")), "old");
  OutputFile output(file("out.txt"), true);
  output.write("new");
  EXPECT_EQ(bytes_of(file("out.txt")), "old");
  output.commit();
  EXPECT_EQ(bytes_of(file("out.txt")), "new");
  EXPECT_EQ(files_in_folder(), 1u);
}

TEST_F(TableFiles, OutputRefusesPlacesThatCannotBeWritten) {
  expect_error(ExitCode::usage, folder_.string(), [&] { OutputFile(folder_, true); });
  expect_error(ExitCode::failure, "nowhere", [&] { OutputFile(file("nowhere") / "out.txt", false); });
  write_bytes(file("plain"), "");
  expect_error(ExitCode::failure, "plain", [&] { OutputFile(file("plain") / "out.txt", false); });
  if (geteuid() != 0) {
    // Permissions do not hold root back.
    fs::permissions(folder_, fs::perms::owner_read | fs::perms::owner_exec);
    expect_error(ExitCode::failure, "out.txt", [&] { OutputFile(file("out.txt"), false); });
    fs::permissions(folder_, fs::perms::owner_all);
  }
}

TEST_F(TableFiles, FailedWritesOfTablesAreErrors) {
  const Table table = monte_carlo(microfacet_diffuse(), {.exact = true});
  expect_error(ExitCode::failure, "nowhere", [&] { table.write(file("nowhere") / "t.exr"); });
  // A full disk: the table is small, so nothing but the last flush can tell.
  if (fs::exists("/dev/full")) expect_error(ExitCode::failure, "/dev/full", [&] { table.write("/dev/full"); });
}

TEST_F(TableFiles, TextIsReadWholeOrRefused) {
  const std::string content("a\0b\r\nc", 6);
  write_bytes(file("text"), content);
  EXPECT_EQ(read_file(file("text")), content);
  expect_error(ExitCode::invalid_input, "missing", [&] { read_file(file("missing")); });
  expect_error(ExitCode::invalid_input, folder_.string(), [&] { read_file(folder_); });
}

TEST_F(TableFiles, DigestsAreSha256) {
  // FIPS 180-4, the example "abc".
  write_bytes(file("abc"), "abc");
  EXPECT_EQ(sha256_of_file(file("abc")), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
}

// ---- rendering stops when asked ---------------------------------------------------------------------------------

class StopAfter : public Monitor {
 public:
  explicit StopAfter(int checks) : left_(checks) {}
  void check() override {
    if (--left_ < 0) throw Interrupted();
  }

 private:
  std::atomic<int> left_;
};

TEST(Render, StopsWhenInterrupted) {
  StopAfter monitor(10);
  expect_error(ExitCode::interrupted, "interrupted", [&] {
    render(find_reference("microfacet_diffuse"), microfacet_diffuse(), {}, small_grid(), {.sampling = {.samples = 64}},
           monitor);
  });
}

TEST(Render, RefusesAxesThatAreNoParameters) {
  Monitor monitor;
  const auto with_axis = [&](const Axis& parameter_axis) {
    render(find_reference("microfacet_diffuse"), microfacet_diffuse(), {parameter_axis}, small_grid(), {.exact = true},
           monitor);
  };
  expect_error(ExitCode::usage, "did you mean 'alpha'", [&] { with_axis(axis("alhpa", {0.5})); });
  expect_error(ExitCode::usage, "alpha", [&] { with_axis(axis("alpha", {0.5, 1.5})); });
  expect_error(ExitCode::usage, "alpha", [&] { with_axis(axis("alpha", {std::nan("")})); });
  expect_error(ExitCode::usage, "masking", [&] { with_axis(axis("masking", {0.0, 1.0})); });
}

// ---- models over tables -----------------------------------------------------------------------------------------

TEST(AxisMapping, ParsesItsForms) {
  const AxisMapping full = AxisMapping::parse("roughness=0.4*alpha^0.5");
  EXPECT_EQ(full.parameter, "roughness");
  EXPECT_EQ(full.axis, "alpha");
  EXPECT_EQ(full.scale, 0.4);
  EXPECT_EQ(full.power, 0.5);
  const AxisMapping plain = AxisMapping::parse("sigma=alpha");
  EXPECT_EQ(plain.parameter, "sigma");
  EXPECT_EQ(plain.axis, "alpha");
  EXPECT_EQ(plain.scale, 1.0);
  EXPECT_EQ(plain.power, 1.0);
  EXPECT_EQ(AxisMapping::parse("a=-2*b").scale, -2.0);
  EXPECT_EQ(AxisMapping::parse("a=b^-1").power, -1.0);
  for (const char* text :
       {"", "=", "roughness", "=alpha", "roughness=", "roughness=0.4*", "roughness=x*alpha", "roughness=alpha^",
        "roughness=alpha^x", "roughness=*alpha", "roughness=0.4*^2", "roughness=nan*alpha", "roughness=1e999*alpha"}) {
    expect_error(
        ExitCode::usage, "", [&] { AxisMapping::parse(text); }, text);
  }
}

TEST(TableModel, FollowsTheAxes) {
  Table table;
  table.grid = small_grid();
  table.parameter_axes = {axis("alpha", {0.04, 0.25, 1.0}, "")};
  table.allocate();
  const auto row_value = [](const TableModel& on_table, const ParameterValues& values, const char* name,
                            std::size_t row) {
    return on_table.row(row)[static_cast<std::size_t>(values.info(name).offset)];
  };
  // A parameter of the axis' name follows it, a perceptual roughness its root.
  const ParameterValues proxima = find_model("proxima").defaults(), burley = find_model("burley").defaults();
  const TableModel proxima_on(find_model("proxima"), proxima, table), burley_on(find_model("burley"), burley, table);
  EXPECT_TRUE(proxima_on.set_by_axis(static_cast<std::size_t>(proxima.info("alpha").offset)));
  EXPECT_FALSE(proxima_on.set_by_axis(static_cast<std::size_t>(proxima.info("a").offset)));
  for (const auto& [row, alpha] : {std::pair{0u, 0.04}, {1u, 0.25}, {2u, 1.0}}) {
    EXPECT_DOUBLE_EQ(row_value(proxima_on, proxima, "alpha", row), alpha);
    EXPECT_DOUBLE_EQ(row_value(burley_on, burley, "roughness", row), std::sqrt(alpha));
  }
  // A mapping comes first.
  const ParameterValues eon = find_model("eon").defaults();
  const TableModel mapped(find_model("eon"), eon, table, {AxisMapping::parse("roughness=0.4*alpha^0.5")});
  EXPECT_DOUBLE_EQ(row_value(mapped, eon, "roughness", 1), 0.4 * 0.5);
  EXPECT_TRUE(mapped.set_by_axis(static_cast<std::size_t>(eon.info("roughness").offset)));

  expect_error(ExitCode::usage, "did you mean",
               [&] { TableModel(find_model("eon"), eon, table, {AxisMapping::parse("rougness=alpha")}); });
  expect_error(ExitCode::usage, "sigma",
               [&] { TableModel(find_model("eon"), eon, table, {AxisMapping::parse("roughness=sigma")}); });
  expect_error(ExitCode::usage, "out of range",
               [&] { TableModel(find_model("eon"), eon, table, {AxisMapping::parse("roughness=4*alpha")}); });
}

TEST(TableModel, RendersTheModel) {
  Table table = monte_carlo(microfacet_diffuse(), {.sampling = {.samples = 320}});
  table.valid[2] = 0;
  const Model& model = find_model("proxima");
  ParameterValues values = model.defaults();
  values.set("albedo", 0.5);
  const Table rendered = TableModel(model, values, table).render();
  EXPECT_EQ(rendered.model, "proxima");
  EXPECT_TRUE(rendered.replicates.empty());
  EXPECT_EQ(rendered.valid, table.valid);
  for (const std::size_t entry : {std::size_t{1}, std::size_t{30}, table.entries() - 1}) {
    values.set("alpha", table.parameter_values(table.parameter_row(entry))[0]);
    EXPECT_EQ(rendered.value(entry),
              static_cast<float>(model.evaluate(values.flat(), table.wi(entry), table.wo(entry)).x));
    EXPECT_EQ(rendered.standard_error(entry), 0.0f);
  }
}

TEST(TableModel, TakesParametersFromTheTable) {
  ParameterValues values = microfacet_diffuse(0.3);
  values.set("albedo", std::array{0.1, 0.2, 0.3});
  Monitor monitor;
  const Table table = render(find_reference("microfacet_diffuse"), values, {}, small_grid(), {.exact = true}, monitor);
  const ParameterValues model = with_table_parameters(find_model("proxima").defaults(), table);
  EXPECT_EQ(model.get("alpha"), 0.3);
  EXPECT_EQ(model.components(model.info("albedo"))[2], 0.3);
  EXPECT_EQ(model.get("a"), -0.55) << "what the table does not state keeps its value";
}

}  // namespace
}  // namespace lobefit
