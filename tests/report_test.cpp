// Pages of results: self-contained, whole, and of the numbers that the folder holds.
#include "report/html_report.h"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "evaluate/float_model.h"
#include "evaluate/shader.h"
#include "reference/output_file.h"
#include "report/html_page.h"
#include "tests/base64.h"
#include "tests/shader_compiler.h"

namespace lobefit {
namespace {

namespace fs = std::filesystem;

bool contains(std::string_view text, std::string_view part) { return text.find(part) != std::string_view::npos; }

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  for (std::size_t at = 0; (at = text.find(from, at)) != std::string::npos; at += to.size())
    text.replace(at, from.size(), to);
  return text;
}

/// What a browser makes of escaped text.
std::string unescaped(std::string text) {
  text = replaced(replaced(replaced(text, "&lt;", "<"), "&gt;", ">"), "&quot;", "\"");
  return replaced(text, "&amp;", "&");
}

/// The JSON that the page's scripts read.
Json page_data(const std::string& page) {
  const std::string open = "<script type=\"application/json\" id=\"data\">";
  const std::size_t begin = page.find(open) + open.size();
  return Json::parse(page.substr(begin, page.find("</script>", begin) - begin));
}

/// One packed array, by the format's own words: half floats (IEEE 754 binary16), little-endian, base64, times a scale.
std::vector<double> unpacked(const Json& array) {
  const std::string bytes = bytes_of_base64(array.at("data"));
  std::vector<double> values;
  for (std::size_t k = 0; k + 1 < bytes.size(); k += 2) {
    const unsigned bits = static_cast<unsigned char>(bytes[k]) + 256u * static_cast<unsigned char>(bytes[k + 1]);
    const int exponent = static_cast<int>(bits >> 10 & 31u);
    const double fraction = bits & 1023u, sign = bits & 0x8000u ? -1.0 : 1.0;
    const double value = exponent == 31  ? (fraction > 0.0 ? std::nan("") : INFINITY)
                         : exponent == 0 ? std::ldexp(fraction, -24)
                                         : std::ldexp(1024.0 + fraction, exponent - 25);
    values.push_back(sign * value * array.at("scale").get<double>());
  }
  return values;
}

struct Attribute {
  std::string element, name, value;
};

/// The attributes of all elements, as a browser reads them; what scripts and styles hold is no element.
std::vector<Attribute> attributes(const std::string& page) {
  std::vector<Attribute> result;
  for (std::size_t at = 0; (at = page.find('<', at)) != std::string::npos;) {
    std::size_t end = ++at;
    while (std::isalnum(static_cast<unsigned char>(page[end]))) ++end;
    const std::string element = page.substr(at, end - at);
    for (at = end; !element.empty() && page[at] != '>';) {
      if (std::isspace(static_cast<unsigned char>(page[at]))) {
        ++at;
        continue;
      }
      end = page.find_first_of("= >\n", at);
      Attribute attribute{element, page.substr(at, end - at), ""};
      at = end;
      if (page[end] == '=') {
        EXPECT_EQ(page[end + 1], '"') << "unquoted attribute of " << element;
        const std::size_t close = page.find('"', end + 2);
        attribute.value = page.substr(end + 2, close - end - 2);
        at = close + 1;
      }
      result.push_back(std::move(attribute));
    }
    if (element == "script" || element == "style") at = page.find("</" + element, at);
  }
  return result;
}

/// Every address that a browser would fetch, and every word that fetches one, must stay in the page.
void expect_self_contained(const std::string& page) {
  for (const Attribute& a : attributes(page)) {
    for (const char* address : {"src", "href", "srcset", "action", "formaction", "poster", "background", "style"}) {
      if (a.name != address) continue;
      EXPECT_TRUE(a.value.starts_with("data:") || a.value.starts_with("#"))
          << a.element << " " << a.value.substr(0, 99);
    }
    EXPECT_FALSE(a.name.starts_with("on")) << a.element << " " << a.name;
  }
  const std::string own = std::string(html_page.style) + std::string(html_page.script);
  EXPECT_TRUE(contains(page, html_page.style) && contains(page, html_page.script));
  for (const char* word :
       {"@import", "url(", "fetch(", "XMLHttpRequest", "import(", "sendBeacon", "WebSocket", "https:"})
    EXPECT_FALSE(contains(own, word)) << word;
  EXPECT_TRUE(contains(page, "default-src 'none'"));
}

Table small_table(int channels) {
  Table table;
  table.grid = {{"theta_i", "", {0, 30, 60}, false}, {"theta_o", "", {0, 45}, false}, {"phi", "", {0, 180}, false}};
  table.parameter_axes = {{"alpha", "", {0.1, 0.5, 1.0}, false}};
  table.channels = channels;
  table.allocate();
  for (std::size_t k = 0; k < table.values.size(); ++k)
    table.values[k] = static_cast<float>(0.3 + 0.2 * std::sin(1.0 + static_cast<double>(k)));
  return table;
}

HtmlReport report_of(std::shared_ptr<const Table> table, std::vector<HtmlLine> lines) {
  HtmlReport report{.title = "Test", .conclusion = "Done.", .command = "lobefit refit test"};
  report.rows.push_back({.name = "row"});
  report.rows.front().slices = {.reference = std::move(table), .label = "truth", .lines = std::move(lines)};
  return report;
}

TEST(HtmlReport, TextsCanNotBecomeMarkup) {
  const std::string hostile = "</script><script>alert(1)</script> <img src=x onerror=alert(2)> \"&amp;' {{data}} <!--";
  HtmlReport report = report_of(std::make_shared<Table>(small_table(1)), {{hostile, small_table(1).values}});
  report.title = report.description = report.conclusion = report.command = hostile;
  report.tables = {{.caption = hostile, .header = {hostile}, .lines = {{hostile}}, .note = hostile}};
  report.provenance = {{hostile, hostile}};
  report.remarks = {hostile};
  HtmlRow& row = report.rows.front();
  row.name = row.note = row.slices.label = hostile;
  row.shaders = {{"glsl", hostile}};
  row.matrices = {{.caption = hostile, .names = {hostile}, .values = {{1.0}}, .note = hostile}};
  row.charts = report.charts = {{.title = hostile,
                                 .horizontal = hostile,
                                 .vertical = hostile,
                                 .lines = {{hostile, {{1.0, 2.0}, {2.0, 3.0}}}},
                                 .note = hostile}};
  row.figures = {{.title = hostile, .media_type = "image/svg+xml", .content = "<svg>\"><script>'%#</svg>"}};
  const std::string page = html_report(report);
  const auto count = [&](const char* part) {
    std::size_t n = 0;
    for (std::size_t at = 0; (at = page.find(part, at)) != std::string::npos; ++at) ++n;
    return n;
  };
  EXPECT_EQ(count("<script"), 2u);  // the data, and the page's own
  EXPECT_EQ(count("</script"), 2u);
  EXPECT_EQ(count("<img"), 1u);
  EXPECT_EQ(count("<!--"), 0u);
  expect_self_contained(page);
  const Json data = page_data(page);
  EXPECT_EQ(data.at("rows").at(0).at("name"), hostile);
  EXPECT_EQ(data.at("rows").at(0).at("slices").at("lines").at(0).at("label"), hostile);
  // And they are all there, as they were.
  EXPECT_TRUE(contains(unescaped(page), "<title>" + hostile + "</title>"));
}

TEST(HtmlReport, ValuesAreThoseOfTheTable) {
  for (const int channels : {1, 3}) {
    Table table = small_table(channels);
    table.values[5] = 4e4f;  // a highlight must not cost the rest its digits
    table.values[6] = 1e-4f;
    table.valid[7] = 0;
    std::vector<float> line = table.values;
    for (std::size_t k = 0; k < line.size(); ++k)
      line[k] += 1e-4f * static_cast<float>(std::cos(static_cast<double>(k)));
    const Json data = page_data(html_report(report_of(std::make_shared<Table>(table), {{"model", line}})));
    const Json& slices = data.at("rows").at(0).at("slices");
    EXPECT_EQ(slices.at("theta_i"), Json(table.grid.theta_i.values));
    EXPECT_EQ(slices.at("rows"), Json({"alpha 0.1", "alpha 0.5", "alpha 1"}));
    EXPECT_EQ(slices.at("channels"), channels);
    const std::vector<double> reference = unpacked(data.at("arrays").at(slices.at("reference").get<std::size_t>()));
    const std::vector<double> difference =
        unpacked(data.at("arrays").at(slices.at("lines").at(0).at("difference").get<std::size_t>()));
    ASSERT_EQ(reference.size(), table.values.size());
    ASSERT_EQ(difference.size(), table.values.size());
    for (std::size_t k = 0; k < reference.size(); ++k) {
      if (table.valid[k % table.entries()] == 0) {
        EXPECT_TRUE(std::isnan(reference[k]));
        continue;
      }
      // Half precision rounds to 11 bits.
      EXPECT_NEAR(reference[k], table.values[k], std::abs(table.values[k]) / 2048.0) << k;
      const double truth = static_cast<double>(line[k] - table.values[k]);
      EXPECT_NEAR(difference[k], truth, std::abs(truth) / 2048.0 + 1e-12) << k;
    }
  }
}

TEST(HtmlReport, LargeTablesKeepTheirEnds) {
  Table table = small_table(1);
  table.parameter_axes.front().values.clear();
  for (int k = 0; k < 60000; ++k) table.parameter_axes.front().values.push_back(k);
  table.allocate();
  const std::string page = html_report(report_of(std::make_shared<Table>(table), {{"model", table.values}}));
  EXPECT_LT(page.size(), 3'500'000u);
  EXPECT_TRUE(contains(page, "evenly spread"));
  const Json rows = page_data(page).at("rows").at(0).at("slices").at("rows");
  EXPECT_GT(rows.size(), 1000u);
  EXPECT_EQ(rows.front(), "alpha 0");
  EXPECT_EQ(rows.back(), "alpha 59999");
}

/// The numbers of "cx" or "cy" of a chart's points, in their order.
std::vector<double> coordinates(const std::string& page, const std::string& name) {
  std::vector<double> list;
  for (const Attribute& a : attributes(page)) {
    if (a.element == "circle" && a.name == name) list.push_back(std::stod(a.value));
  }
  return list;
}

TEST(HtmlReport, ChartsPutNumbersWhereTheyBelong) {
  HtmlReport report{.title = "Test"};
  report.charts = {{.title = "powers",
                    .horizontal = "x",
                    .vertical = "y",
                    .logarithmic = true,
                    .lines = {{"a", {{0, 1}, {1, 10}, {2, 0.0}, {4, 1000}, {5, std::nan("")}, {6, INFINITY}}}}}};
  const std::string page = html_report(report);
  expect_self_contained(page);
  const std::vector<double> x = coordinates(page, "cx"), y = coordinates(page, "cy");
  ASSERT_EQ(x.size(), 3u) << "neither zero nor what is not finite can stand on a logarithmic axis";
  EXPECT_NEAR((x[2] - x[1]) / (x[1] - x[0]), 3.0, 0.01);
  EXPECT_NEAR((y[2] - y[1]) / (y[1] - y[0]), 2.0, 0.01);
  EXPECT_GT(y[0], y[1]);  // downwards in an SVG
  EXPECT_TRUE(contains(page, ">100<") && contains(page, ">10<"));

  report.charts.front().logarithmic = false;
  const std::vector<double> linear = coordinates(html_report(report), "cy");
  ASSERT_EQ(linear.size(), 4u);
  EXPECT_NEAR((linear[3] - linear[0]) / (linear[1] - linear[0]), 111.0, 10.0);

  report.charts.front().lines.front().points = {{1.0, std::nan("")}};
  EXPECT_FALSE(contains(html_report(report), "<circle")) << "nothing to draw, nothing drawn";
}

TEST(HtmlReport, MatricesAreShadedBySize) {
  HtmlReport report{.title = "Test"};
  report.rows.push_back({.name = "row"});
  report.rows.front().matrices = {
      {.caption = "Correlation", .names = {"a", "b"}, .values = {{1.0, -0.97}, {0.2, 0.0}}, .note = ""}};
  const std::string page = html_report(report);
  for (const char* cell : {"<td class=\"high s10\">1.00</td>", "<td class=\"low s10\">-0.97</td>",
                           "<td class=\"high s2\">0.20</td>", "<td class=\"high s0\">0.00</td>"})
    EXPECT_TRUE(contains(page, cell)) << cell;
}

/// Dense tables without parameter rows are thinned in their angles; what is left is the table's own.
TEST(HtmlReport, DenseTablesAreThinnedInTheirAngles) {
  Table table = small_table(3);
  table.parameter_axes.clear();
  for (Axis* axis : {&table.grid.theta_i, &table.grid.theta_o}) {
    axis->values.clear();
    for (int k = 0; k < 45; ++k) axis->values.push_back(2.0 * k);
  }
  table.grid.phi.values.clear();
  for (int k = 0; k < 91; ++k) table.grid.phi.values.push_back(2.0 * k);
  table.allocate();
  for (std::size_t k = 0; k < table.values.size(); ++k)
    table.values[k] = static_cast<float>(k / table.entries() + 1) + static_cast<float>(k % table.entries()) / 4e5f;
  const std::string page = html_report(report_of(std::make_shared<Table>(table), {{"model", table.values}}));
  EXPECT_LT(page.size(), 2'500'000u);
  EXPECT_TRUE(contains(page, "evenly spread"));
  const Json data = page_data(page), &slices = data.at("rows").at(0).at("slices");
  const std::vector<double> reference = unpacked(data.at("arrays").at(slices.at("reference").get<std::size_t>()));
  const std::vector<double> theta_o = slices.at("theta_o"), theta_i = slices.at("theta_i"), phi = slices.at("phi");
  ASSERT_EQ(reference.size(), 3 * theta_o.size() * theta_i.size() * phi.size());
  for (const std::vector<double>* axis : {&theta_o, &theta_i}) {
    EXPECT_EQ(axis->front(), 0.0);
    EXPECT_EQ(axis->back(), 88.0);
    EXPECT_GT(axis->size(), 15u);
  }
  EXPECT_EQ(phi.back(), 180.0);
  for (std::size_t k = 0; k < reference.size(); ++k) {
    const std::size_t p = k % phi.size(), i = k / phi.size() % theta_i.size(),
                      o = k / phi.size() / theta_i.size() % theta_o.size(),
                      channel = k / phi.size() / theta_i.size() / theta_o.size();
    const double entry = (theta_o[o] / 2.0 * 45.0 + theta_i[i] / 2.0) * 91.0 + phi[p] / 2.0;
    const double truth = static_cast<double>(channel + 1) + entry / 4e5;
    ASSERT_NEAR(reference[k], truth, truth / 2048.0) << k;
  }
}

TEST(HtmlReport, RefusesTablesWithoutPolarAngles) {
  Table table = small_table(1);
  table.coordinates = Coordinates::rusinkiewicz;
  EXPECT_THROW(html_report(report_of(std::make_shared<Table>(table), {})), Error);
}

/// The text around the exported function, as the page's script has it.
std::string sphere_shader(const std::string& text, const std::string& model) {
  const std::string script(html_page.script), open = "const fragmentShader = (text, model) => `";
  const std::size_t begin = script.find(open) + open.size();
  const std::string shader = script.substr(begin, script.find('`', begin) - begin);
  return replaced(replaced(shader, "${model}", model), "${text}", text);
}

/// OpenGL ES 3.00 takes the GLSL of every surface model: what the spheres of a page are drawn with.
TEST(HtmlReport, SpheresTakeTheExportedText) {
  if (!has_shader_compiler("glsl")) GTEST_SKIP() << "glslangValidator is not installed";
  int compiled = 0;
  for (const Model& model : models()) {
    if (model.info->kind != ModelKind::brdf || model.info->transmits) continue;
    std::vector<ShaderParameter> parameters;
    const ParameterValues values = model.defaults();
    for (const ParameterInfo& info : model.parameters) {
      const auto slots = values.components(info);
      parameters.push_back({info, {slots.begin(), slots.end()}, ""});
    }
    const std::string name(model.info->name);
    const std::string text = print_shader(find_float_model(name).trace(), "glsl", *model.info, parameters, {});
    const std::string stem = ::testing::TempDir() + "lobefit_sphere_" + name + std::to_string(getpid());
    std::ofstream(stem + ".frag") << sphere_shader(text, name);
    EXPECT_EQ(command_complaint("glslangValidator -S frag '" + stem + ".frag'", stem), "");
    std::remove((stem + ".frag").c_str());
    ++compiled;
  }
  EXPECT_GT(compiled, 30);
}

// ---- the verb ------------------------------------------------------------------------------------------------------

struct Outcome {
  int code;
  std::string out, err;
};

/// A folder of its own, with a small result of a user's recipe.
class ReportOfFolder : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::path(::testing::TempDir()) / ("lobefit_report_" + std::to_string(getpid()));
    fs::create_directories(folder_);
    std::ofstream(folder_ / "recipe.json") << R"({
      "recipe": "small", "title": "Is 2 < 3 & </script> safe?", "description": "A recipe of the tests.",
      "model": "proxima", "fixed": {"albedo": 0.6}, "published": {"a": -0.55, "b": 0.19},
      "axes": {"alpha": [0.25, 0.5, 1.0]}, "samples": 256, "tolerance": 0.01,
      "rivals": [{"model": "lambert"}],
      "rows": [
        {"name": "all", "views": "all", "reference": {"name": "microfacet_diffuse", "set": {"masking": "area_mean", "albedo": 0.6}},
         "grid": "small", "metric": "cosine", "weights": "uniform", "free": [["a", "b"], ["albedo", "a"]]},
        {"name": "slice", "views": "normal_slice", "reference": {"name": "microfacet_diffuse"},
         "grid": {"theta_i": [0, 20, 40, 60, 80], "theta_o": [0], "phi": [0]},
         "metric": "brdf", "weights": "sin_theta_i", "free": [["a", "b"]]}]})";
    ASSERT_EQ(run("refit recipe.json -o result").code, 0);
  }
  void TearDown() override { fs::remove_all(folder_); }

  Outcome run(const std::string& arguments) const {
    const std::string command = "cd '" + folder_.string() + "' && '" LOBEFIT_PROGRAM "' " + arguments + " >.out 2>.err";
    const int status = std::system(command.c_str());
    return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, read_file(folder_ / ".out"), read_file(folder_ / ".err")};
  }
  void expect_refused(const std::string& arguments, int code, std::initializer_list<const char*> fragments) const {
    const Outcome outcome = run(arguments);
    EXPECT_EQ(outcome.code, code) << outcome.err;
    for (const char* fragment : fragments) EXPECT_TRUE(contains(outcome.err, fragment)) << outcome.err;
    for (const auto& file : fs::recursive_directory_iterator(folder_))
      EXPECT_NE(file.path().extension(), ".html") << "left by " << arguments;
  }
  Json read(const std::string& name) const { return Json::parse(read_file(folder_ / name)); }
  void write(const std::string& name, const std::string& text) const { std::ofstream(folder_ / name) << text; }

  fs::path folder_;
};

std::string decimals(const char* format, double value) {
  char buffer[64];
  std::snprintf(buffer, sizeof buffer, format, value);
  return buffer;
}

TEST_F(ReportOfFolder, HoldsTheResult) {
  const Outcome outcome = run("report result --json");
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(outcome.err, "");
  const std::string page = read_file(folder_ / "result/report.html");
  EXPECT_EQ(Json::parse(outcome.out).at("bytes"), page.size());
  EXPECT_LT(page.size(), 1'500'000u);
  expect_self_contained(page);
  EXPECT_TRUE(contains(page, "<h1>Is 2 &lt; 3 &amp; &lt;/script&gt; safe?</h1>"));
  EXPECT_TRUE(contains(page, "A recipe of the tests."));
  EXPECT_TRUE(contains(page, "lobefit refit recipe.json"));

  const Json result = read("result/result.json");
  for (const Json& row : result.at("rows")) {
    for (const auto& [name, constant] : row.at("params").items()) {
      const double value = constant.at("value");
      EXPECT_TRUE(contains(page, "<td>" + decimals("%.5f", value))) << row.at("name") << name;
      if (row.at("method") == "exact") continue;
      EXPECT_TRUE(contains(page, decimals("%.5f", value) + " [" + decimals("%.5f", constant.at("ci95").at(0)) + ", " +
                                     decimals("%.5f", constant.at("ci95").at(1)) + "]"))
          << row.at("name") << name;
    }
    for (const auto& [name, rms] : row.at("rms").items())
      EXPECT_TRUE(contains(page, "<td>" + decimals("%.5f", rms) + "</td>")) << row.at("name") << name;
  }
  const std::string text = unescaped(page);
  for (const char* file : {"all.glsl", "all.hlsl", "slice.wgsl", "slice.c"})
    EXPECT_TRUE(contains(text, "<code>" + read_file(folder_ / "result" / file) + "</code>")) << file;
  EXPECT_TRUE(contains(page, "src=\"data:image/"));
  EXPECT_TRUE(contains(page, "3 of 3 checks passed"));
}

/// The slices' lines against the reference give the result's own rms.
TEST_F(ReportOfFolder, SlicesHaveTheResultsErrors) {
  ASSERT_EQ(run("report result").code, 0);
  const Json data = page_data(read_file(folder_ / "result/report.html"));
  const Json result = read("result/result.json");
  std::size_t compared = 0;
  for (const Json& row : data.at("rows")) {
    const Json& slices = row.at("slices");
    ASSERT_FALSE(slices.is_null());
    for (const Json& line : slices.at("lines")) {
      const std::vector<double> difference = unpacked(data.at("arrays").at(line.at("difference").get<std::size_t>()));
      const std::size_t n_phi = slices.at("phi").size(), n_theta = slices.at("theta_i").size();
      double sum = 0.0, total = 0.0;
      for (std::size_t k = 0; k < difference.size(); ++k) {
        const double theta = slices.at("theta_i").at(k / n_phi % n_theta).get<double>() * pi / 180.0;
        const bool cosine = slices.at("quantity") == "cosine";
        const double weight = cosine ? 1.0 : std::sin(theta), factor = pi * (cosine ? std::cos(theta) : 1.0);
        sum += weight * factor * factor * difference[k] * difference[k];
        total += weight;
      }
      for (const Json& stated : result.at("rows")) {
        std::string label = "refit";
        for (const Json& name : stated.at("free")) label += (label == "refit" ? " " : ", ") + name.get<std::string>();
        if (stated.at("name") != row.at("name") || stated.at("method") != "exact") continue;
        if (line.at("label") != "published" && line.at("label") != label) continue;
        const double rms = stated.at("rms").at(line.at("label") == "published" ? "published" : "refit");
        EXPECT_NEAR(std::sqrt(sum / total), rms, 1e-3 * rms) << row.at("name") << line.at("label");
        ++compared;
      }
    }
  }
  // Two free sets of "all", each with the published line too; "slice" has one.
  EXPECT_EQ(compared, 6u);
  const Json& explorer = data.at("rows").at(0).at("explorer");
  EXPECT_EQ(explorer.at("spheres"), Json({"published", "refit a, b", "refit albedo, a"}));
  for (const Json& parameter : explorer.at("parameters")) {
    const Json& values = parameter.at("values");  // [parameter row][sphere][component]
    ASSERT_EQ(values.size(), 3u);
    if (parameter.at("name") == "a") {
      EXPECT_EQ(values.at(0).at(0).at(0), -0.55);
      EXPECT_NE(values.at(0).at(1).at(0), -0.55);
    }
    if (parameter.at("name") == "alpha") {
      EXPECT_EQ(values, Json::parse("[[[0.25],[0.25],[0.25]],[[0.5],[0.5],[0.5]],[[1.0],[1.0],[1.0]]]"));
    }
  }
}

TEST_F(ReportOfFolder, SaysWhatIsMissing) {
  for (const char* file : {"all.exact.exr", "slice.glsl", "slice.exact-a-b.fit.json"})
    fs::remove(folder_ / "result" / file);
  const Outcome outcome = run("report result");
  EXPECT_EQ(outcome.code, 0);
  EXPECT_TRUE(contains(outcome.err, "all.exact-a-b.fit.json")) << outcome.err;
  EXPECT_TRUE(contains(outcome.err, "lacks slice.exact-a-b.fit.json")) << outcome.err;
  const std::string page = read_file(folder_ / "result/report.html");
  EXPECT_TRUE(contains(page, "lacks slice.exact-a-b.fit.json"));
  EXPECT_TRUE(page_data(page).at("rows").at(0).at("slices").is_null());
}

TEST_F(ReportOfFolder, RefusesWhatIsNoResult) {
  expect_refused("report", 2, {"DIR"});
  expect_refused("report nowhere", 3, {"nowhere", "no such folder"});
  fs::create_directory(folder_ / "empty");
  expect_refused("report empty", 3, {"empty", "result.json", "validation.json", "a fit"});
  const std::string fit = read_file(folder_ / "result/all.exact-a-b.fit.json");
  write("result/all.exact-a-b.fit.json", replaced(fit, "\"upper\": 2.0", "\"upper\": \"two\""));
  expect_refused("report result", 3, {"all.exact-a-b.fit.json", "$.params[1].upper", "expected a number"});
  write("result/all.exact-a-b.fit.json", fit.substr(0, fit.size() / 2));
  expect_refused("report result", 3, {"all.exact-a-b.fit.json, line"});
  // A fit that the result does not tell of.
  Json other = Json::parse(fit);
  other.at("params").at(1).at("value") = -0.3;
  write("result/all.exact-a-b.fit.json", other.dump());
  expect_refused("report result", 3, {"result.json", "rms.refit", "run the recipe again"});
  write("result/all.exact-a-b.fit.json", fit);
  const std::string result = read_file(folder_ / "result/result.json");
  write("result/result.json", replaced(result, "\"ci95\"", "\"ci96\""));
  expect_refused("report result", 3, {"result.json", "$.rows[0].params.a", "ci95"});
}

TEST_F(ReportOfFolder, IsTheSamePageAndReplacesNone) {
  ASSERT_EQ(run("report result -o page.html").code, 0);
  const std::string page = read_file(folder_ / "page.html");
  const Outcome again = run("report result -o page.html");
  EXPECT_EQ(again.code, 2);
  EXPECT_TRUE(contains(again.err, "--force")) << again.err;
  ASSERT_EQ(run("report result -o page.html --force").code, 0);
  EXPECT_EQ(read_file(folder_ / "page.html"), page);
}

TEST_F(ReportOfFolder, TellsOfClosedForms) {
  ASSERT_EQ(run("refit fresnel -o fresnel").code, 0);
  const Outcome outcome = run("report fresnel");
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const std::string page = read_file(folder_ / "fresnel/report.html");
  expect_self_contained(page);
  EXPECT_LT(page.size(), 1'500'000u);
  const Json result = read("fresnel/result.json");
  std::size_t numbers = 0;
  for (const Json& row : result.at("rows")) {
    for (const auto& [name, constant] : row.at("params").items()) {
      EXPECT_TRUE(contains(page, decimals("%.6g", constant.at("value")))) << row.at("name") << name;
      ++numbers;
    }
    EXPECT_TRUE(contains(page, "<td>" + decimals("%.3g", row.at("rms").at("refit")) + "</td>")) << row.at("name");
  }
  EXPECT_GT(numbers, 20u);
  EXPECT_TRUE(contains(unescaped(page), read_file(folder_ / "fresnel/schlick_exponent_of_ior.ior_1.5.glsl")));
}

TEST_F(ReportOfFolder, TellsOfMaterials) {
  ASSERT_EQ(run("render lambert --grid small --set albedo=0.25 -o one.exr").code, 0);
  ASSERT_EQ(run("render lambert --grid small --set albedo=0.5 -o two.exr").code, 0);
  ASSERT_EQ(run("fit lambert one.exr two.exr -o fits").code, 0);
  const Outcome outcome = run("report fits");
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const std::string page = read_file(folder_ / "fits/report.html");
  expect_self_contained(page);
  EXPECT_TRUE(contains(page, "lambert fitted to 2 materials"));
  EXPECT_TRUE(contains(page, "<th scope=\"row\">one</th>"));
  EXPECT_TRUE(contains(page, "<th scope=\"row\">albedo"));
  EXPECT_TRUE(contains(page, "<td>0.25</td>"));
  EXPECT_TRUE(contains(page, "vec3 Lobefit_lambert("));
  EXPECT_EQ(page_data(page).at("rows").at(1).at("explorer").at("spheres"), Json({"fitted"}));
  const std::string summary = read_file(folder_ / "fits/summary.json");
  fs::remove(folder_ / "fits/report.html");
  write("fits/summary.json", replaced(summary, "\"converged\": true", "\"converged\": 1"));
  expect_refused("report fits", 3, {"summary.json", "$.fits[0].converged"});
}

/// Every control operated, no console error, no request; spheres and lobes are those of `lobefit sphere` and `eval`.
TEST_F(ReportOfFolder, BrowserHasNoComplaint) {
  if (std::system("command -v chromium > /dev/null && command -v python3 > /dev/null") != 0)
    GTEST_SKIP() << "chromium is not installed";
  fs::create_directory(folder_ / "pages");
  ASSERT_EQ(run("report result -o pages/report.html").code, 0);
  const std::string command = "cd '" + folder_.string() +
                              "' && '" LOBEFIT_REPORT_PICTURES
                              "' pages/report.html --rows 2 -o pictures --lobefit '" LOBEFIT_PROGRAM "' >.out 2>&1";
  EXPECT_EQ(std::system(command.c_str()), 0) << read_file(folder_ / ".out");
  // Three models of the first row and two of the second.
  const std::string said = read_file(folder_ / ".out");
  std::size_t compared = 0;
  for (std::size_t at = 0; (at = said.find("from lobefit sphere", at)) != std::string::npos; ++at) ++compared;
  EXPECT_EQ(compared, 5u) << said;
  for (const char* picture : {"light.png", "dark.png", "narrow.png", "narrow_dark.png", "operated.png"})
    EXPECT_GT(fs::file_size(folder_ / "pictures/pages" / picture), 10'000u) << picture;
}

/// How sure the fits of a row are stands beside them, as their files have it.
TEST_F(ReportOfFolder, TellsHowSureFitsAre) {
  ASSERT_EQ(run("report result").code, 0);
  const std::string page = read_file(folder_ / "result/report.html");
  const Json fit = read("result/all.exact-a-b.fit.json");
  EXPECT_TRUE(contains(page, "<h4>Correlation, a, b</h4>"));
  const double correlation = fit.at("correlation").at(0).at(1);
  EXPECT_NE(correlation, 0.0);
  EXPECT_TRUE(contains(page, ">" + decimals("%.2f", correlation) + "</td>"));
  const Json& history = fit.at("solver").at("history");
  ASSERT_GT(history.size(), 1u);
  EXPECT_TRUE(contains(page, "<figcaption>Convergence, a, b</figcaption>"));
  EXPECT_TRUE(contains(page, "From " + decimals("%.6g", history.front()) + " to " + decimals("%.6g", history.back())));
}

TEST_F(ReportOfFolder, TellsOfASingleFit) {
  ASSERT_EQ(run("render lambert --grid small --set albedo=0.25 -o data.exr").code, 0);
  fs::create_directory(folder_ / "single");
  ASSERT_EQ(run("fit lambert data.exr --free albedo=0.6 --metric brdf --starts 3 -o single/grey.json").code, 0);
  const Json fit = read("single/grey.json");
  // π f of Lambert is its albedo: how far the start is off. Of several starts the best one may be another.
  ASSERT_EQ(run("fit lambert data.exr --free albedo=0.6 --metric brdf -o alone.json").code, 0);
  const Json alone = read("alone.json");
  const Json& history = alone.at("solver").at("history");
  EXPECT_NEAR(history.front(), 0.35, 1e-6);
  EXPECT_NEAR(history.back(), 0.0, 1e-6);
  for (std::size_t k = 1; k < history.size(); ++k) EXPECT_LE(history.at(k), history.at(k - 1));
  EXPECT_EQ(fit.at("solver").at("start_misfits").size(), 3u);

  const Outcome outcome = run("report single");
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(outcome.err, "");
  const std::string page = read_file(folder_ / "single/report.html");
  expect_self_contained(page);
  EXPECT_TRUE(contains(page, "<h1>lambert fitted to data.exr</h1>"));
  EXPECT_TRUE(contains(page, "<td>0.25</td>"));
  EXPECT_TRUE(contains(page, "<figcaption>Starts</figcaption>"));
  const Json data = page_data(page);
  const Json& slices = data.at("rows").at(0).at("slices");
  for (const double v : unpacked(data.at("arrays").at(slices.at("reference").get<std::size_t>())))
    EXPECT_NEAR(v, 0.25 / pi, 0.25 / pi / 2048.0);
  EXPECT_EQ(data.at("rows").at(0).at("explorer").at("spheres"), Json({"fitted"}));

  // The file may have moved beside the fit, or be gone; another of its name is not taken for it.
  fs::rename(folder_ / "data.exr", folder_ / "single/data.exr");
  ASSERT_EQ(run("report single --force").code, 0);
  EXPECT_EQ(read_file(folder_ / "single/report.html"), page);
  fs::remove(folder_ / "single/data.exr");
  ASSERT_EQ(run("render lambert --grid small --set albedo=0.5 -o data.exr").code, 0);
  const Outcome without = run("report single --force");
  EXPECT_EQ(without.code, 0);
  EXPECT_TRUE(contains(without.err, "data of grey are not where the fit found them")) << without.err;
  EXPECT_TRUE(page_data(read_file(folder_ / "single/report.html")).at("rows").at(0).at("slices").is_null());
}

TEST_F(ReportOfFolder, RefusesBrokenFits) {
  ASSERT_EQ(run("render proxima --grid small --set alpha=0.5 -o data.exr").code, 0);
  fs::create_directory(folder_ / "single");
  ASSERT_EQ(run("fit proxima data.exr --free a,b -o single/one.fit.json").code, 0);
  const std::string text = read_file(folder_ / "single/one.fit.json");
  Json fit = Json::parse(text);
  const auto refused = [&](const Json& broken, std::initializer_list<const char*> fragments) {
    write("single/one.fit.json", broken.dump());
    expect_refused("report single", 3, fragments);
  };
  Json broken = fit;
  for (Json& p : broken.at("params")) {
    if (p.at("name") == "a") p.at("value") = -0.2;
  }
  refused(broken, {"one.fit.json", "$.metrics.log", "fit again"});
  broken = fit;
  broken.at("correlation").erase(0);
  refused(broken, {"one.fit.json", "$.correlation", "2 parameters are free"});
  broken = fit;
  broken.at("solver").at("history").at(0) = "high";
  refused(broken, {"one.fit.json", "$.solver.history[0]", "expected a number"});
  broken = fit;
  broken.erase("params");
  refused(broken, {"one.fit.json", "missing 'params'"});
  write("single/one.fit.json", text.substr(0, text.size() - 20));
  expect_refused("report single", 3, {"one.fit.json", "not valid JSON"});
  write("single/one.fit.json", text);
  write("single/notes.json", "{");
  expect_refused("report single", 3, {"notes.json", "not valid JSON"});
}

TEST_F(ReportOfFolder, TellsOfCurves) {
  write("curves.json", R"({
    "recipe": "tiny", "kind": "curves", "title": "Tiny curves", "description": "For tests.", "alpha": [0.2, 0.5, 1],
    "grid": {"theta_i": [5, 25, 45, 65, 85], "theta_o": [5, 25, 45, 65, 85], "phi": [0, 30, 60, 90, 120, 150, 180]},
    "metric": "brdf", "weights": "cos_theta_i,cos_theta_i,sin_theta_i,sin_theta_o",
    "references": [{"name": "one", "reference": "microfacet_diffuse", "set": {"bounces": "1"}, "albedo": [1]},
                   {"name": "all", "reference": "microfacet_diffuse", "set": {"bounces": "all"}, "albedo": [0.3]}],
    "models": [{"model": "callisto_lambert", "label": "slides", "fixed": {"f0": 0, "specular_fresnel_falloff": 0}}],
    "free": ["albedo", "diffuse_fresnel"],
    "contested": {"name": "tangent", "parameters": ["diffuse_fresnel_tangent_falloff"], "claim": "low"},
    "bounds": {"albedo": [0, 4]}, "wide_bounds": {"diffuse_fresnel": [-256, 256]}, "usable": {"albedo": [0.4, 1.6]},
    "starts": [{"diffuse_fresnel": 0.5}], "tolerance": 0.1,
    "comparisons": [{"name": "facets", "reference": "microfacet_diffuse",
      "set": {"facet": "callisto", "masking": "view_only"}, "model": "callisto_lambert",
      "shared": {"diffuse_fresnel": 4}, "alpha": [0.3], "samples": 64}]})");
  ASSERT_EQ(run("refit curves.json -o curves").code, 0);
  const Outcome outcome = run("report curves");
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(outcome.err, "");
  const std::string page = read_file(folder_ / "curves/report.html");
  expect_self_contained(page);
  const Json result = read("curves/result.json"), data = page_data(page);
  ASSERT_EQ(data.at("rows").size(), 2u);
  EXPECT_TRUE(contains(page, "What is called negligible"));
  std::size_t compared = 0;
  for (const Json& row : result.at("rows")) {
    EXPECT_TRUE(contains(page, "<td>" + decimals("%.4f", row.at("rms").at("refit"))));
    for (const auto& [name, estimate] : row.at("params").items())
      EXPECT_TRUE(contains(page, decimals("%.4g", estimate.at("value")))) << name;
    // The slices' line against the reference, weighted as the recipe says and per unit of albedo, is the row's rms.
    const bool bounces = row.at("table") == "all";
    const Json& slices = data.at("rows").at(bounces ? 1 : 0).at("slices");
    const std::size_t alpha = row.at("alpha") == 0.2 ? 0 : row.at("alpha") == 0.5 ? 1 : 2;
    const Json& line = slices.at("lines").at(row.at("tangent") == "free" ? 0 : 1);
    const std::vector<double> difference = unpacked(data.at("arrays").at(line.at("difference").get<std::size_t>()));
    double sum = 0.0, total = 0.0;
    for (std::size_t k = 0; k < 175; ++k) {
      const double theta_i = slices.at("theta_i").at(k / 7 % 5).get<double>() * pi / 180.0;
      const double theta_o = slices.at("theta_o").at(k / 35).get<double>() * pi / 180.0;
      const double weight = std::pow(std::cos(theta_i), 2) * std::sin(theta_i) * std::sin(theta_o);
      sum += weight * std::pow(pi * difference[alpha * 175 + k], 2);
      total += weight;
    }
    const double rms = row.at("rms").at("refit");
    EXPECT_NEAR(std::sqrt(sum / total) / row.at("albedo").get<double>(), rms, 2e-3 * rms + 1e-6);
    ++compared;
  }
  EXPECT_EQ(compared, 12u);
  // How sure the fits at the alpha that the shader is of are.
  EXPECT_TRUE(contains(page, "<h4>Correlation, tangent free, α = 1</h4>"));
  const Json& last = result.at("rows").at(2);
  ASSERT_EQ(last.at("alpha"), 1.0);
  EXPECT_TRUE(contains(page, " to " + decimals("%.6g", last.at("history").back()) + " in "));
  const double correlation = last.at("correlation").at(0).at(1);
  EXPECT_TRUE(contains(page, ">" + decimals("%.2f", correlation) + "</td>"));
  const Json& explorer = data.at("rows").at(0).at("explorer");
  EXPECT_EQ(explorer.at("spheres"), Json({"tangent free", "tangent fixed"}));
  EXPECT_TRUE(contains(page, "vec3 Lobefit_callisto_lambert("));

  const std::string text = read_file(folder_ / "curves/result.json");
  fs::remove(folder_ / "curves/report.html");
  Json other = result;
  other.at("rows").at(0).at("params").at("albedo").at("value") = 0.9;
  write("curves/result.json", other.dump());
  expect_refused("report curves", 3, {"result.json", "$.rows[0].rms.refit", "run the recipe again"});
  other = result;
  other.at("rows").erase(0);
  write("curves/result.json", other.dump());
  expect_refused("report curves", 3, {"result.json", "rows of callisto_lambert on one", "missing"});
  write("curves/result.json", text);
  fs::remove(folder_ / "curves/one.exr");
  const Outcome without = run("report curves");
  EXPECT_EQ(without.code, 0);
  EXPECT_TRUE(contains(without.err, "lacks one.exr")) << without.err;
}

/// With a data folder of one shipped tree: the whole of them take minutes.
TEST_F(ReportOfFolder, TellsOfSubstrate) {
  const fs::path data = folder_ / "data";
  fs::create_directories(data / "substrate");
  const fs::path shipped = LOBEFIT_DATA_FOLDER;
  fs::copy_file(shipped / "substrate/coated_metal.json", data / "substrate/coated_metal.json");
  fs::copy_file(shipped / "substrate_rules.json", data / "substrate_rules.json");
  ::setenv("LOBEFIT_DATA", data.c_str(), 1);
  write("rules.json",
        R"({"recipe": "rules", "kind": "substrate_rules", "title": "Few pairs", "description": "For tests.",
    "pairs": 20, "held_out": 20, "pairs_seed": 1, "samples": 32, "albedo_paths": 64, "diffuse_model": "chan",
    "brdf_weight": 0.2, "tree_samples": 32})");
  const Outcome validated = run("slab validate coated_metal --samples 32 -o slab"),
                refitted = run("refit rules.json -o rules");
  const Outcome of_slab = run("report slab"), of_rules = run("report rules");
  ::unsetenv("LOBEFIT_DATA");
  ASSERT_EQ(validated.code, 0) << validated.err;
  ASSERT_EQ(refitted.code, 0) << refitted.err;
  ASSERT_EQ(of_slab.code, 0) << of_slab.err;
  EXPECT_EQ(of_slab.err, "");
  ASSERT_EQ(of_rules.code, 0) << of_rules.err;

  const Json validation = read("slab/validation.json"), result = read("rules/result.json");
  const std::string slab = read_file(folder_ / "slab/report.html"), rules = read_file(folder_ / "rules/report.html");
  const auto expect_stages = [](const std::string& page, const Json& document) {
    for (const auto& [name, stages] : document.at("strategies").items()) {
      EXPECT_TRUE(contains(page, "<h4>Stages, " + name + "</h4>"));
      for (const Json& stage : stages) {
        for (const char* against : {"simplification", "model"}) {
          for (const char* error : {"error", "brdf_rms_log", "albedo_rms_relative"})
            EXPECT_TRUE(contains(page, "<td>" + decimals("%.4f", stage.at(against).at(error)) + "</td>"))
                << name << error;
        }
      }
    }
  };
  for (const std::string* page : {&slab, &rules}) {
    expect_self_contained(*page);
    EXPECT_LT(page->size(), 1'000'000u);
    EXPECT_TRUE(contains(*page, "Lobefit_BlendVertical"));
    EXPECT_TRUE(contains(*page, "Against the layers as matter"));
  }
  expect_stages(slab, validation);
  EXPECT_TRUE(contains(unescaped(slab), "What simplifying " + validation.at("title").get<std::string>() + " costs"));
  EXPECT_TRUE(contains(slab, validation.at("provenance").at("tree_sha256").get<std::string>()));
  expect_stages(rules, result.at("trees").at("coated_metal"));
  EXPECT_EQ(page_data(rules).at("rows").size(), 2u);
  EXPECT_TRUE(contains(rules, "<h4>Correlation</h4>"));
  EXPECT_TRUE(contains(rules, " to " + decimals("%.6g", result.at("history").back()) + " in "));
  for (const auto& [name, constant] : result.at("constants").items())
    EXPECT_TRUE(contains(rules, "<td>" + decimals("%.4f", constant.at("value")) + "</td>")) << name;
  for (const Json& row : result.at("rows")) {
    const Json& fitted = row.at("albedo_error").at("fitted");
    if (fitted.at("count") == 0) continue;
    EXPECT_TRUE(contains(rules, decimals("%.3f", fitted.at("median")) + " / " + decimals("%.3f", fitted.at("p90"))));
  }

  for (const char* page : {"slab/report.html", "rules/report.html"}) fs::remove(folder_ / page);
  Json broken = validation;
  broken.at("strategies").at("fitted").at(0).at("model").erase("error");
  write("slab/validation.json", broken.dump());
  expect_refused("report slab", 3, {"validation.json", "$.strategies.fitted[0].model", "error"});
  write("slab/validation.json", validation.dump().substr(0, 500));
  expect_refused("report slab", 3, {"validation.json", "not valid JSON"});
  broken = result;
  broken.at("constants").at("blur").at("ci95") = {1.0};
  write("rules/result.json", broken.dump());
  expect_refused("report rules", 3, {"result.json", "$.constants.blur.ci95", "two numbers"});
}

}  // namespace
}  // namespace lobefit
