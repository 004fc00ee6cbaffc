// Figures: gnuplot programs that hold a table's numbers, and pictures that appear whole or not at all.
#include "report/figure.h"

#include <gtest/gtest.h>
#include <stdlib.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <numbers>
#include <sstream>
#include <string>
#include <vector>

#include "models/error.h"
#include "models/model.h"
#include "reference/output_file.h"
#include "report/image_slice.h"
#include "report/material_figure.h"
#include "report/pareto_figure.h"

namespace lobefit {

namespace {

namespace fs = std::filesystem;

Axis axis(const std::string& name, std::vector<double> values) { return {name, "", std::move(values), false}; }

/// A table whose every entry has a value and an error of its own, near `level`.
Table make_table(double level, int channels = 1) {
  Table table;
  table.grid = {axis("theta_i", {0, 20, 50, 80}), axis("theta_o", {0, 40, 70}), axis("phi", {0, 90, 180})};
  table.parameter_axes = {axis("alpha", {0.1, 0.25, 0.5, 1.0})};
  table.channels = channels;
  table.model = "made_up";
  table.allocate();
  for (std::size_t i = 0; i < table.values.size(); ++i) {
    table.values[i] = static_cast<float>(level + 0.05 * std::sin(1.0 + static_cast<double>(i)));
    table.stderr_values[i] = static_cast<float>(0.001 + 0.0005 * std::cos(static_cast<double>(i)));
  }
  return table;
}

/// Entry by the layout that the table's format states: x = i_phi + Nphi i_theta_i, y = i_theta_o + Ntheta_o
/// i_parameter.
std::size_t entry_of(const Table& table, std::size_t row, std::size_t theta_o, std::size_t theta_i, std::size_t phi) {
  const std::size_t x = phi + table.grid.phi.size() * theta_i, y = theta_o + table.grid.theta_o.size() * row;
  return x + table.grid.phi.size() * table.grid.theta_i.size() * y;
}

/// π f cos θi, and what the same factor makes of the standard error.
double scaled(const Table& table, float value, std::size_t theta_i) {
  return std::numbers::pi * static_cast<double>(value) *
         std::cos(table.grid.theta_i.values[theta_i] * std::numbers::pi / 180.0);
}

/// The lines of a program's datablock as numbers; an empty line is an empty vector.
std::vector<std::vector<double>> block(const std::string& program, const std::string& name) {
  std::istringstream lines(program.substr(std::min(program.find("$" + name + " << EOD\n"), program.size())));
  std::vector<std::vector<double>> result;
  std::string line;
  std::getline(lines, line);
  while (std::getline(lines, line) && line != "EOD") {
    std::istringstream numbers(line);
    result.emplace_back();
    for (std::string number; numbers >> number;) result.back().push_back(std::stod(number));  // NaN too
  }
  return result;
}

template <class Function>
ExitCode code_of(Function&& function) {
  try {
    function();
  } catch (const Error& error) {
    return error.code();
  }
  return ExitCode::done;
}

TEST(SliceFigure, HoldsTheTablesNumbers) {
  const Table reference = make_table(0.3), model = make_table(0.25);
  const std::string program =
      slice_figure(reference, {{"model", model}}, {.theta_o = 2, .phi = 1, .parameter_rows = {3, 1}}, "title");
  for (const auto& [panel, row] : std::map<std::string, std::size_t>{{"1", 3}, {"2", 1}}) {
    const auto points = block(program, "reference_" + panel), line = block(program, "model_1_" + panel);
    ASSERT_EQ(points.size(), 4u);
    ASSERT_EQ(line.size(), 4u);
    for (std::size_t i = 0; i < 4; ++i) {
      const std::size_t entry = entry_of(reference, row, 2, i, 1);
      EXPECT_EQ(points[i][0], reference.grid.theta_i.values[i]);
      EXPECT_NEAR(points[i][1], scaled(reference, reference.values[entry], i), 1e-7);
      // Four digits of the error; 2.0395 is the 97.5 % quantile of Student's t with 31 degrees of freedom.
      EXPECT_NEAR(points[i][2] / (2.0395 * scaled(reference, reference.stderr_values[entry], i)), 1.0, 1e-3);
      EXPECT_NEAR(line[i][1], scaled(model, model.values[entry], i), 1e-7);
    }
  }
  EXPECT_NE(program.find("'alpha = 1'"), std::string::npos);
  EXPECT_NE(program.find("'alpha = 0.25'"), std::string::npos);
}

TEST(SliceFigure, AveragesChannels) {
  const Table reference = make_table(0.3, 3);
  const auto points = block(slice_figure(reference, {}, {}, ""), "reference_1");
  ASSERT_EQ(points.size(), 4u);
  for (std::size_t i = 0; i < 4; ++i) {
    const std::size_t entry = entry_of(reference, 0, 0, i, 0), n = reference.entries();
    const float mean = (reference.values[entry] + reference.values[entry + n] + reference.values[entry + 2 * n]) / 3.0f;
    EXPECT_NEAR(points[i][1], scaled(reference, mean, i), 1e-6);
  }
}

TEST(SliceFigure, LeavesAGapWhereTheTableIsMasked) {
  Table reference = make_table(0.3);
  reference.valid[entry_of(reference, 0, 0, 1, 0)] = 0;
  reference.values[entry_of(reference, 0, 0, 1, 0)] = 1e9f;
  const auto points = block(slice_figure(reference, {}, {}, ""), "reference_1");
  ASSERT_EQ(points.size(), 4u);
  EXPECT_EQ(points[0][0], 0.0);
  EXPECT_TRUE(points[1].empty());
  EXPECT_EQ(points[2][0], 50.0);
}

TEST(SliceFigure, ShowsTheOppositeAzimuthAtNegativeAngles) {
  const Table reference = make_table(0.3);
  const auto points =
      block(slice_figure(reference, {}, {.theta_o = 1, .parameter_rows = {2}, .both_sides = true}, ""), "reference_1");
  const std::vector<double> angles{-80, -50, -20, 0, 20, 50, 80};
  ASSERT_EQ(points.size(), angles.size());
  for (std::size_t i = 0; i < angles.size(); ++i) {
    const std::size_t theta_i = i < 3 ? 3 - i : i - 3, phi = i < 3 ? 2 : 0;
    EXPECT_EQ(points[i][0], angles[i]);
    EXPECT_NEAR(points[i][1], scaled(reference, reference.values[entry_of(reference, 2, 1, theta_i, phi)], theta_i),
                1e-7);
  }
  Table one_sided = reference;
  one_sided.grid.phi.values = {0, 90, 170};
  EXPECT_EQ(code_of([&] { slice_figure(one_sided, {}, {.both_sides = true}, ""); }), ExitCode::usage);
}

TEST(SliceFigure, SpreadsPanelsOverTheParameterAxis) {
  Table reference = make_table(0.3);
  reference.parameter_axes[0].values.clear();
  for (int i = 1; i <= 20; ++i) reference.parameter_axes[0].values.push_back(i / 20.0);
  reference.allocate();
  const std::string program = slice_figure(reference, {}, {}, "");
  EXPECT_NE(program.find("'alpha = 0.05'"), std::string::npos);
  EXPECT_NE(program.find("'alpha = 1'"), std::string::npos);
  EXPECT_FALSE(block(program, "reference_6").empty());
  EXPECT_TRUE(block(program, "reference_7").empty());
}

TEST(SliceFigure, RefusesWhatTheTableHasNot) {
  const Table reference = make_table(0.3);
  Table other = reference;
  other.grid.theta_i.values[1] = 30;
  EXPECT_EQ(code_of([&] { slice_figure(reference, {{"other", other}}, {}, ""); }), ExitCode::usage);
  EXPECT_EQ(code_of([&] { slice_figure(reference, {}, {.theta_o = 3}, ""); }), ExitCode::usage);
  EXPECT_EQ(code_of([&] { slice_figure(reference, {}, {.phi = 3}, ""); }), ExitCode::usage);
  EXPECT_EQ(code_of([&] { slice_figure(reference, {}, {.parameter_rows = {4}}, ""); }), ExitCode::usage);
}

TEST(ResidualFigure, HoldsTheDifferencesAndTheirRms) {
  Table reference = make_table(0.3);
  const Table model = make_table(0.25, 3);
  reference.valid[entry_of(reference, 2, 1, 3, 2)] = 0;
  const std::string program = residual_figure(reference, {{"model", model}}, {.phi = 2, .parameter_rows = {2}}, "");
  const auto cells = block(program, "residual_1_1");
  ASSERT_EQ(cells.size(), 11u);
  double squares = 0.0;
  std::size_t next = 0;
  for (std::size_t o = 0; o < 3; ++o) {
    for (std::size_t i = 0; i < 4; ++i) {
      const std::size_t entry = entry_of(reference, 2, o, i, 2), n = model.entries();
      if (!reference.valid[entry]) continue;
      const float mean = (model.values[entry] + model.values[entry + n] + model.values[entry + 2 * n]) / 3.0f;
      const double expected = scaled(model, mean, i) - scaled(reference, reference.values[entry], i);
      const std::vector<double>& cell = cells[next++];
      ASSERT_EQ(cell.size(), 5u);
      EXPECT_LE(cell[0], reference.grid.theta_i.values[i]);
      EXPECT_GT(cell[1], reference.grid.theta_i.values[i]);
      EXPECT_LE(cell[2], reference.grid.theta_o.values[o]);
      EXPECT_GT(cell[3], reference.grid.theta_o.values[o]);
      EXPECT_NEAR(cell[4], expected, 1e-6);
      squares += expected * expected;
    }
  }
  const std::size_t title = program.find("'rms ");
  ASSERT_NE(title, std::string::npos);
  const double rms = std::sqrt(squares / 11.0);
  EXPECT_NEAR(std::stod(program.substr(title + 5)) / rms, 1.0, 0.05);  // two digits are printed
}

TEST(ResidualFigure, NeedsSeveralViewsAndAModel) {
  Table single = make_table(0.3);
  single.grid.theta_o.values = {0};
  single.allocate();
  EXPECT_EQ(code_of([&] { residual_figure(single, {{"model", single}}, {}, ""); }), ExitCode::usage);
  EXPECT_EQ(code_of([&] { residual_figure(make_table(0.3), {}, {}, ""); }), ExitCode::usage);
}

/// Runs in a folder of its own, which a failed figure must leave empty: no picture, no partial one.
TEST(MaterialFigure, HoldsTheSlicesOfBothSides) {
  Table table;
  table.grid = {axis("theta_i", {10, 30, 60}), axis("theta_o", {5, 30, 55, 75}), axis("phi", {0, 90, 180})};
  table.channels = 3;
  table.allocate();
  for (std::size_t i = 0; i < table.values.size(); ++i) table.values[i] = 0.1f + 0.001f * static_cast<float>(i);
  table.valid[entry_of(table, 0, 2, 1, 2)] = 0;
  std::vector<float> fitted = table.values;
  for (float& value : fitted) value *= 2.0f;
  table.values[table.entries() + entry_of(table, 0, 1, 0, 0)] = -0.5f;
  const std::string program = material_figure(table, fitted, {}, "title", "subtitle");
  // View 55°, blue: the mirror side first, without its masked entry.
  const auto line = block(program, "slice_2_2");
  ASSERT_EQ(line.size(), 5u);
  const std::array<double, 5> angles{-60, -10, 10, 30, 60};
  for (std::size_t k = 0; k < 5; ++k) {
    const std::size_t theta_i = k == 0 || k == 4 ? 2 : k == 3 ? 1 : 0;
    const std::size_t entry = 2 * table.entries() + entry_of(table, 0, 2, theta_i, k < 2 ? 2 : 0);
    const double cosine = std::cos(std::abs(angles[k]) * std::numbers::pi / 180.0);
    EXPECT_EQ(line[k][0], angles[k]);
    EXPECT_NEAR(line[k][1], cosine * table.values[entry], 1e-6);
    EXPECT_NEAR(line[k][2], 2.0 * line[k][1], 2e-6);
  }
  // A negative measurement has no logarithm: a gap, not a value.
  EXPECT_NE(program.find("10 NaN "), std::string::npos);
  EXPECT_EQ(program.find("rgbimage"), std::string::npos);

  SphereImage sphere{.size = 2, .rgb = std::vector<float>(12, 0.25f), .cover = {0, 1, 1, 1}};
  const auto with_spheres = material_figure(table, fitted, std::vector{sphere, sphere}, "title", "subtitle");
  // The first pixel is outside: white; the others are as bright as the brightest.
  const auto pixels = block(with_spheres, "sphere_0");
  ASSERT_EQ(pixels.size(), 4u);
  for (const auto& pixel : pixels) EXPECT_EQ(pixel[2], 255.0);
  EXPECT_EQ(pixels[0][1], 1.0);  // the top line
  sphere.rgb[3] = 0.125f;        // half of it, by the formula of IEC 61966-2-1: 1.055 · .5^(1/2.4) - .055 = .7354
  EXPECT_EQ(block(material_figure(table, fitted, std::vector{sphere, sphere}, "t", "s"), "sphere_1")[1][2], 188.0);

  table.coordinates = Coordinates::list;
  EXPECT_THROW(material_figure(table, fitted, {}, "title", "subtitle"), Error);
}

class WriteFigure : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string pattern = (fs::temp_directory_path() / "lobefit_figure_XXXXXX").string();
    ASSERT_NE(mkdtemp(pattern.data()), nullptr);
    folder = pattern;
  }
  void TearDown() override { fs::remove_all(folder); }

  static std::string small_slice() {
    return slice_figure(make_table(0.3), {{"model", make_table(0.25)}}, {}, "A small slice");
  }

  fs::path folder;
};

TEST_F(WriteFigure, GivesTheSameBytesTwice) {
  const std::string residual = residual_figure(make_table(0.3), {{"model", make_table(0.25)}}, {}, "A small map");
  for (const std::string& program : {small_slice(), residual}) {
    for (const std::string extension : {".svg", ".png"}) {
      const fs::path first = folder / ("first" + extension), second = folder / ("second" + extension);
      write_figure(program, first, true);
      write_figure(program, second, true);
      EXPECT_EQ(read_file(first), read_file(second));
      EXPECT_GT(fs::file_size(first), 5000u);
    }
  }
}

TEST_F(WriteFigure, KnowsItsFormats) {
  write_figure(small_slice(), folder / "a.png", false, {800, 600});
  const std::string png = read_file(folder / "a.png");
  EXPECT_EQ(png.substr(0, 8), "\x89PNG\r\n\x1a\n");
  const auto big_endian = [&](std::size_t offset) {
    return static_cast<unsigned char>(png[offset + 2]) * 256 + static_cast<unsigned char>(png[offset + 3]);
  };
  EXPECT_EQ(big_endian(16), 800);
  EXPECT_EQ(big_endian(20), 600);
  write_figure(small_slice(), folder / "a.svg", false, {800, 600});
  const std::string svg = read_file(folder / "a.svg");
  EXPECT_NE(svg.find("width=\"800\" height=\"600\""), std::string::npos);
  EXPECT_NE(svg.find("</svg>"), std::string::npos);
  // Fonts in CSS's terms, with others to fall back on.
  EXPECT_EQ(svg.find(":Bold"), std::string::npos);
  EXPECT_EQ(svg.find("DejaVu Sans\""), std::string::npos);
  for (const char* name : {"a.pdf", "a", "a.SVG"}) {
    EXPECT_EQ(code_of([&] { write_figure(small_slice(), folder / name, false); }), ExitCode::usage) << name;
    EXPECT_FALSE(fs::exists(folder / name));
  }
}

TEST_F(WriteFigure, ShowsLabelsAsTheyAre) {
  const std::string label = "it's a_b^c {d} @e %d \\n `touch " + (folder / "injected").string() + "`";
  write_figure(slice_figure(make_table(0.3), {{label, make_table(0.25)}}, {}, "<b> & \"title\"\n$(id)"),
               folder / "a.svg", false);
  const std::string svg = read_file(folder / "a.svg");
  EXPECT_NE(svg.find(label), std::string::npos);
  EXPECT_NE(svg.find("&lt;b"), std::string::npos);
  EXPECT_NE(svg.find("&amp; \"title\" $(id)"), std::string::npos);
  EXPECT_FALSE(fs::exists(folder / "injected"));
}

TEST_F(WriteFigure, ReplacesBytesThatAreNoText) {
  const std::string program = slice_figure(make_table(0.3), {{"\xE9t\xC3\xA9 \xE2\x82", make_table(0.25)}}, {}, "");
  EXPECT_NE(program.find("'?t\xC3\xA9 ?\?'"), std::string::npos);
}

TEST_F(WriteFigure, ToleratesPathsThatAShellWouldNot) {
  const fs::path path = folder / "it's a \"$(touch x)\" `y`; z.svg";
  write_figure(small_slice(), path, false);
  EXPECT_TRUE(fs::exists(path));
  EXPECT_EQ(std::distance(fs::directory_iterator(folder), fs::directory_iterator()), 1);
}

TEST_F(WriteFigure, RefusesToOverwrite) {
  OutputFile existing(folder / "a.svg", false);
  existing.write("precious");
  existing.commit();
  EXPECT_EQ(code_of([&] { write_figure(small_slice(), folder / "a.svg", false); }), ExitCode::usage);
  EXPECT_EQ(read_file(folder / "a.svg"), "precious");
  write_figure(small_slice(), folder / "a.svg", true);
  EXPECT_NE(read_file(folder / "a.svg").find("</svg>"), std::string::npos);
}

TEST_F(WriteFigure, RefusesUnworkableSizes) {
  EXPECT_EQ(code_of([&] { write_figure(small_slice(), folder / "a.svg", false, {10, 700}); }), ExitCode::usage);
  EXPECT_EQ(code_of([&] { write_figure(small_slice(), folder / "a.svg", false, {1000, 100000}); }), ExitCode::usage);
  // Large enough for gnuplot, but not for four panels with their labels.
  EXPECT_EQ(code_of([&] { write_figure(small_slice(), folder / "a.svg", false, {200, 200}); }), ExitCode::usage);
  EXPECT_TRUE(fs::is_empty(folder));
}

TEST_F(WriteFigure, SaysThatGnuplotIsMissing) {
  const std::string path = std::getenv("PATH");
  setenv("PATH", folder.c_str(), 1);
  try {
    write_figure(small_slice(), folder / "a.svg", false);
    ADD_FAILURE() << "drawn without gnuplot";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::missing_part);
    EXPECT_NE(std::string(error.what()).find("gnuplot-nox"), std::string::npos);
  }
  setenv("PATH", path.c_str(), 1);
  EXPECT_TRUE(fs::is_empty(folder));
}

TEST_F(WriteFigure, LeavesNothingWhenGnuplotFails) {
  const std::map<std::string, std::string> programs{
      {"plot x\nplot $absent\n", "no datablock named $absent"},
      {"plot [0:1] sin(\n", "invalid expression"},
      {"x = 1\n", "no message"},  // succeeds, but draws nothing
      {"plot x\nsystem 'kill -9 $PPID'\nplot x\n", "signal 9"},
  };
  for (const auto& [program, message] : programs) {
    for (const char* name : {"a.svg", "a.png"}) {
      try {
        write_figure(program, folder / name, false);
        ADD_FAILURE() << "drawn: " << program;
      } catch (const Error& error) {
        EXPECT_EQ(error.code(), ExitCode::failure) << program;
        EXPECT_NE(std::string(error.what()).find(message), std::string::npos) << error.what();
        EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos) << error.what();
      }
      EXPECT_TRUE(fs::is_empty(folder)) << program;
    }
  }
}

TEST_F(WriteFigure, LeavesNothingInAFolderThatIsNotThere) {
  EXPECT_EQ(code_of([&] { write_figure(small_slice(), folder / "absent" / "a.svg", false); }), ExitCode::failure);
  EXPECT_TRUE(fs::is_empty(folder));
}

TEST_F(WriteFigure, SuggestsSizesThatFitThePanels) {
  const Table reference = make_table(0.3);
  const std::vector<LabelledTable> models(5, {"model", reference});
  const fs::path path = folder / "a.svg";
  write_figure(slice_figure(reference, models, {}, ""), path, true, slice_figure_size(reference, {}));
  write_figure(residual_figure(reference, models, {}, ""), path, true, residual_figure_size(reference, 5, {}));
}

TEST(ParetoFigure, FrontHoldsWhatNothingBeats) {
  const std::vector<ParetoPoint> points{{"cheap", 1, 9}, {"beaten", 6, 5},  {"middle", 5, 4}, {"twin", 5, 4},
                                        {"best", 9, 1},  {"as dear", 9, 2}, {"as far", 7, 4}};
  EXPECT_EQ(pareto_front(points), (std::vector<std::size_t>{0, 2, 3, 4}));
  EXPECT_EQ(pareto_front({}), std::vector<std::size_t>{});
}

TEST(ParetoFigure, HoldsItsNumbersAndNamesEveryPoint) {
  const std::vector<ParetoPoint> points{{"one's", 10, 0.2}, {"two", 10.5, 0.2}, {"three", 20, 0.3}};
  const std::string program = pareto_figure({{"a", points}, {"b", points}}, "title", "", "cost", "error", {800, 400});
  for (const char* name : {"points_1", "points_2"})
    EXPECT_EQ(block(program, name), (std::vector<std::vector<double>>{{10, 0.2}, {10.5, 0.2}, {20, 0.3}}));
  EXPECT_EQ(block(program, "front_1"), (std::vector<std::vector<double>>{{10, 0.2}}));
  for (const char* label : {"'one''s'", "'two'", "'three'"}) EXPECT_NE(program.find(label), std::string::npos) << label;
}

// ---- Image slices -----------------------------------------------------------------------------------------------

std::vector<double> cells(const std::string& program, const std::string& name) {
  std::vector<double> values;
  for (const std::vector<double>& line : block(program, name)) values.insert(values.end(), line.begin(), line.end());
  return values;
}

TEST(ImageSlice, ShowsLogarithmsOverHalfAndDifferenceAngles) {
  const auto constant = [](double f) {
    return [f](const Direction&, const Direction&) { return std::optional<Rgb>(grey(f)); };
  };
  const auto of_vectors = [](const Direction& wi, const Direction& wo) {
    const Direction h = normalize(wi + wo);
    return std::optional<Rgb>(grey(std::exp2(2.0 * h.z * h.z - dot(h, wi)) / pi));
  };
  const std::string program =
      image_slice_figure({{"one", constant(1.0 / pi)}, {"half", constant(0.5 / pi)}, {"angles", of_vectors}},
                         {.phi_d = 90.0, .steps = 6}, "slices");
  const std::vector<double> one = cells(program, "slice_1"), half = cells(program, "ratio_2"),
                            values = cells(program, "ratio_3");
  ASSERT_EQ(one.size(), 36u);
  ASSERT_EQ(half.size(), 36u);
  ASSERT_EQ(values.size(), 36u);
  EXPECT_EQ(program.find("$ratio_1 "), std::string::npos);
  for (std::size_t k = 0; k < 36; ++k) {
    // At phi_d = 90° both directions have the cosine cos theta_h cos theta_d: all pairs are above the surface.
    EXPECT_EQ(one[k], 0.0);
    EXPECT_EQ(half[k], -1.0);
    const double theta_h = radians(15.0 * static_cast<double>(k % 6) + 7.5);
    const double theta_d = radians(15.0 * static_cast<double>(k / 6) + 7.5);
    EXPECT_NEAR(values[k], 2.0 * square(std::cos(theta_h)) - std::cos(theta_d), 1e-3);
  }
  // In the plane of incidence the pair leaves the hemisphere where theta_h + theta_d exceed 90°.
  const std::vector<double> plane =
      cells(image_slice_figure({{"one", constant(1.0 / pi)}}, {.phi_d = 0.0, .steps = 7}, "plane"), "slice_1");
  ASSERT_EQ(plane.size(), 49u);
  for (std::size_t k = 0; k < 49; ++k) {
    const std::size_t sum = k % 7 + k / 7 + 1;  // 7: on the horizon
    if (sum != 7) {
      EXPECT_EQ(std::isnan(plane[k]), sum > 7) << k;
    }
  }
}

TEST(ImageSlice, RefusesNothing) {
  const auto black = [](const Direction&, const Direction&) { return std::optional<Rgb>(); };
  EXPECT_THROW(image_slice_figure({}, {}, ""), Error);
  EXPECT_THROW(image_slice_figure({{"black", black}}, {}, ""), Error);
  EXPECT_THROW(image_slice_figure({{"black", black}}, {.phi_d = 200.0}, ""), Error);
}

}  // namespace

}  // namespace lobefit
