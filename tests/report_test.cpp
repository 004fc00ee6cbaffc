// Pages of results: self-contained, whole, and of the numbers that the folder holds.
#include "report/html_report.h"

#include <gtest/gtest.h>
#include <openssl/evp.h>
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
  const std::string text = array.at("data");
  std::string bytes(text.size(), '\0');
  int size = EVP_DecodeBlock(reinterpret_cast<unsigned char*>(bytes.data()),
                             reinterpret_cast<const unsigned char*>(text.data()), static_cast<int>(text.size()));
  size -= static_cast<int>(std::ranges::count(text, '='));
  std::vector<double> values;
  for (int k = 0; k + 1 < size; k += 2) {
    const unsigned bits = static_cast<unsigned char>(bytes[static_cast<std::size_t>(k)]) +
                          256u * static_cast<unsigned char>(bytes[static_cast<std::size_t>(k) + 1]);
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
    const Json& values = parameter.at("values");
    if (parameter.at("name") == "a") {
      EXPECT_EQ(values.at(0).at(0), -0.55);
      EXPECT_NE(values.at(1).at(0), -0.55);
    }
    // The middle of the recipe's axis.
    if (parameter.at("name") == "alpha") {
      EXPECT_EQ(values.at(1).at(0), 0.5);
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
  expect_refused("report empty", 3, {"empty", "result.json"});
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

}  // namespace
}  // namespace lobefit
