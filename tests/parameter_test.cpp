// Parameters by name and as text, and what their errors tell the user.

#include "models/parameter.h"

#include <gtest/gtest.h>
#include <rapidcheck.h>
#include <rapidcheck/gtest.h>

#include <bit>
#include <limits>

#include "models/registry.h"

namespace lobefit {
namespace {

/// Runs `action`, which has to throw an Error with code usage whose message holds every one of `fragments`.
template <class Action>
void expect_usage_error(Action&& action, std::initializer_list<std::string_view> fragments) {
  try {
    action();
    ADD_FAILURE() << "no error was thrown";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::usage);
    const std::string message = error.what();
    for (const std::string_view fragment : fragments) {
      EXPECT_NE(message.find(fragment), std::string::npos) << "'" << fragment << "' is missing in: " << message;
    }
  }
}

constexpr std::array<std::string_view, 3> distributions{"ggx", "beckmann", "none"};

ParameterValues example() {
  std::vector<ParameterInfo> list{
      {.name = "albedo", .initial = 0.8, .components = 3, .offset = 0},
      {.name = "alpha", .lower = 0.25, .upper = 4.0, .initial = 0.5, .offset = 3},
      {.name = "distribution", .upper = 2.0, .initial = 1.0, .choices = distributions, .offset = 4},
  };
  return ParameterValues(list, "example");
}

std::vector<double> flat(const ParameterValues& values) { return {values.flat().begin(), values.flat().end()}; }

// ---- names ------------------------------------------------------------------------------------------------------

TEST(NearestName, ForgivesTypingErrors) {
  const std::vector<std::string> names{"albedo", "alpha", "roughness", "sigma"};
  EXPECT_EQ(nearest_name("roughnes", names), "roughness");  // one letter missing
  EXPECT_EQ(nearest_name("albbedo", names), "albedo");      // one too many
  EXPECT_EQ(nearest_name("zigma", names), "sigma");         // one wrong
  EXPECT_EQ(nearest_name("ahpla", names), "alpha");         // two swapped
  EXPECT_EQ(nearest_name("Alpha", names), "alpha");
  EXPECT_EQ(nearest_name("alpha", names), "alpha");
}

TEST(NearestName, PrefersTheFirstOfEquals) { EXPECT_EQ(nearest_name("b", std::vector<std::string>{"a", "c"}), "a"); }

TEST(NearestName, HasNothingToOfferFromAnEmptyList) { EXPECT_EQ(nearest_name("alpha", {}), ""); }

RC_GTEST_PROP(NearestName, FindsANameThatIsThere, (const std::vector<std::string>& names)) {
  RC_PRE(!names.empty());
  const std::string name = *rc::gen::elementOf(names);
  RC_ASSERT(nearest_name(name, names) == name);
}

// ---- numbers ----------------------------------------------------------------------------------------------------

TEST(ParseNumber, TakesWhatPeopleWrite) {
  EXPECT_EQ(parse_number("0.5", ""), 0.5);
  EXPECT_EQ(parse_number(".5", ""), 0.5);
  EXPECT_EQ(parse_number("5.", ""), 5.0);
  EXPECT_EQ(parse_number("-0.55", ""), -0.55);
  EXPECT_EQ(parse_number("+3", ""), 3.0);
  EXPECT_EQ(parse_number("1e-3", ""), 1e-3);
  EXPECT_EQ(parse_number("2.5E+2", ""), 250.0);
}

TEST(ParseNumber, RejectsEverythingElse) {
  for (const std::string_view text :
       {"",  " ",    "abc", "0.5x", "0.5 ", " 0.5", "0,5", "1.2.3", "--1",  "+-1",      "+",     "-",
        ".", "0x10", "1e",  "nan",  "NaN",  "-nan", "inf", "-inf",  "+inf", "infinity", "1e999", "-1e999"}) {
    SCOPED_TRACE(text);
    expect_usage_error([&] { parse_number(text, "the place"); },
                       {"'" + std::string(text) + "'", "not a finite number", "the place", "such as 0.5"});
  }
}

TEST(ParseNumber, StopsAtTheEndOfItsView) {
  // A view into a longer text, as of "0.1,0.2": what follows is not part of the number.
  EXPECT_EQ(parse_number(std::string_view("0.12").substr(0, 3), ""), 0.1);
}

TEST(ParseNumbers, SplitsAtCommas) {
  EXPECT_EQ(parse_numbers("0.5", ""), (std::vector{0.5}));
  EXPECT_EQ(parse_numbers("1,-2,3e1", ""), (std::vector{1.0, -2.0, 30.0}));
  for (const std::string_view text : {"", ",", "1,", ",1", "1,,2", "1, 2", "1;2", "1,nan"}) {
    SCOPED_TRACE(text);
    expect_usage_error([&] { parse_numbers(text, "the place"); }, {"not a finite number", "the place"});
  }
}

TEST(NumberText, IsShort) {
  EXPECT_EQ(number_text(0.1), "0.1");
  EXPECT_EQ(number_text(-0.55), "-0.55");
  EXPECT_EQ(number_text(64.0), "64");
  EXPECT_EQ(number_text(1e-7), "1e-07");
}

RC_GTEST_PROP(NumberText, ReadsBackAsTheSameDouble, (std::uint64_t bits)) {
  // From bits: all magnitudes, subnormals included.
  const double value = std::bit_cast<double>(bits);
  RC_PRE(std::isfinite(value));
  RC_ASSERT(std::bit_cast<std::uint64_t>(parse_number(number_text(value), "")) == bits);
}

TEST(NumberText, ReadsBackAtTheEnds) {
  using Limits = std::numeric_limits<double>;
  for (const double value : {Limits::max(), Limits::lowest(), Limits::min(), Limits::denorm_min(), -0.0, 0.1 + 0.2}) {
    EXPECT_EQ(std::bit_cast<std::uint64_t>(parse_number(number_text(value), "")), std::bit_cast<std::uint64_t>(value));
  }
}

// ---- values -----------------------------------------------------------------------------------------------------

TEST(ParameterValues, StartAtTheirInitialValues) {
  const ParameterValues values = example();
  EXPECT_EQ(flat(values), (std::vector{0.8, 0.8, 0.8, 0.5, 1.0}));
  EXPECT_EQ(values.get("alpha"), 0.5);
  EXPECT_EQ(values.choice("distribution"), "beckmann");
  EXPECT_TRUE(values.has("albedo"));
  EXPECT_FALSE(values.has("albed"));
}

TEST(ParameterValues, SetsOneOrThreeChannels) {
  ParameterValues values = example();
  values.set("albedo", 0.25);
  EXPECT_EQ(flat(values), (std::vector{0.25, 0.25, 0.25, 0.5, 1.0}));
  values.set("albedo", std::array{0.1, 0.2, 0.3});
  EXPECT_EQ(flat(values), (std::vector{0.1, 0.2, 0.3, 0.5, 1.0}));
  values.set_text("albedo", "0.4");
  EXPECT_EQ(flat(values), (std::vector{0.4, 0.4, 0.4, 0.5, 1.0}));
  values.set_text("albedo", "0.5,0.6,0.7");
  EXPECT_EQ(flat(values), (std::vector{0.5, 0.6, 0.7, 0.5, 1.0}));
}

TEST(ParameterValues, TakeBothEndsOfTheirRange) {
  ParameterValues values = example();
  values.set("alpha", 0.25);
  EXPECT_EQ(values.get("alpha"), 0.25);
  values.set("alpha", 4.0);
  EXPECT_EQ(values.get("alpha"), 4.0);
}

TEST(ParameterValues, RefuseValuesOutsideTheirRange) {
  ParameterValues values = example();
  const std::vector<double> before = flat(values);
  for (const double value :
       {0.2499, 4.0001, -1.0, std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    expect_usage_error([&] { values.set("alpha", value); },
                       {number_text(value) + " is out of range", "example", "alpha", "from 0.25 to 4"});
  }
  // One bad channel: none is set.
  expect_usage_error([&] { values.set("albedo", std::array{0.1, 0.2, 1.5}); }, {"1.5 is out of range", "from 0 to 1"});
  expect_usage_error([&] { values.set_text("alpha", "5"); },
                     {"5 is out of range", "example", "alpha", "from 0.25 to 4"});
  EXPECT_EQ(flat(values), before);
}

TEST(ParameterValues, RefuseTheWrongNumberOfComponents) {
  ParameterValues values = example();
  expect_usage_error([&] { values.set_text("albedo", "0.1,0.2"); }, {"one number or three", "got 2", "albedo"});
  expect_usage_error([&] { values.set_text("albedo", "0.1,0.2,0.3,0.4"); }, {"one number or three", "got 4", "r,g,b"});
  expect_usage_error([&] { values.set_text("alpha", "0.3,0.3,0.3"); }, {"one number", "got 3", "alpha", "NAME=VALUE"});
  expect_usage_error([&] { values.set("alpha", std::span<const double>()); }, {"one number", "got 0"});
}

TEST(ParameterValues, SuggestTheNearestName) {
  ParameterValues values = example();
  expect_usage_error([&] { values.set("alhpa", 0.5); }, {"'alhpa'", "example", "did you mean 'alpha'?"});
  expect_usage_error([&] { values.set_text("albdo", "0.5"); }, {"'albdo'", "did you mean 'albedo'?"});
  expect_usage_error([&] { values.get("distributions"); }, {"did you mean 'distribution'?"});
  expect_usage_error([&] { values.info("sigma"); }, {"'sigma'"});
}

TEST(ParameterValues, ChoicesAreSetByTheirNames) {
  ParameterValues values = example();
  values.set_text("distribution", "none");
  EXPECT_EQ(values.get("distribution"), 2.0);
  EXPECT_EQ(values.choice("distribution"), "none");
  for (const std::string_view text : {"phong", "GGX", "", "1"}) {
    expect_usage_error([&] { values.set_text("distribution", text); },
                       {"'" + std::string(text) + "' is not a choice", "distribution", "ggx, beckmann, none"});
  }
  EXPECT_EQ(values.choice("distribution"), "none");
  // A number names a choice only if it is whole.
  expect_usage_error([&] { values.set("distribution", 0.5); }, {"0.5 is not a choice", "distribution"});
  EXPECT_EQ(values.choice("distribution"), "none");
}

TEST(ParameterValues, SayTheirTextAsPeopleWriteIt) {
  ParameterValues values = example();
  EXPECT_EQ(values.text(values.info("albedo")), "0.8");
  EXPECT_EQ(values.text(values.info("distribution")), "beckmann");
  values.set("albedo", std::array{0.1, 0.2, 0.3});
  EXPECT_EQ(values.text(values.info("albedo")), "0.1,0.2,0.3");
  // Two equal channels are not grey.
  values.set("albedo", std::array{0.1, 0.1, 0.3});
  EXPECT_EQ(values.text(values.info("albedo")), "0.1,0.1,0.3");
  values.set("albedo", std::array{0.1, 0.3, 0.1});
  EXPECT_EQ(values.text(values.info("albedo")), "0.1,0.3,0.1");
}

RC_GTEST_PROP(ParameterValues, TextReadsBackAsTheSameValues, ()) {
  const auto fraction = [] { return *rc::gen::inRange<std::uint32_t>(0, 1u << 31) * 0x1p-31; };
  ParameterValues values = example();
  values.set("albedo", std::array{fraction(), fraction(), fraction()});
  values.set("alpha", 0.25 + 3.75 * fraction());
  values.set("distribution", static_cast<double>(*rc::gen::inRange(0, 3)));
  ParameterValues read = example();
  for (const ParameterInfo& info : values.list()) read.set_text(info.name, values.text(info));
  RC_ASSERT(flat(read) == flat(values));
}

// ---- what models declare ----------------------------------------------------------------------------------------

TEST(Models, DeclareCoherentParameters) {
  for (const Model& model : models()) {
    SCOPED_TRACE(model.info->name);
    int offset = 0;
    std::vector<std::string_view> names;
    for (const ParameterInfo& info : model.parameters) {
      SCOPED_TRACE(info.name);
      EXPECT_EQ(info.offset, offset);
      EXPECT_TRUE(info.components == 1 || info.components == 3);
      offset += info.components;
      EXPECT_LT(info.lower, info.upper);
      EXPECT_GE(info.initial, info.lower);
      EXPECT_LE(info.initial, info.upper);
      EXPECT_FALSE(info.doc.empty());
      EXPECT_EQ(std::count(names.begin(), names.end(), info.name), 0) << "declared twice";
      names.push_back(info.name);
    }
    EXPECT_EQ(model.defaults().flat().size(), static_cast<std::size_t>(offset));
    EXPECT_EQ(model.defaults().owner(), model.info->name);
  }
}

TEST(Models, AreFoundByNameOrSuggested) {
  for (const Model& model : models()) EXPECT_EQ(&find_model(model.info->name), &model);
  expect_usage_error([] { find_model("lambret"); }, {"'lambret'", "did you mean 'lambert'?", "lobefit models"});
}

struct Described {
  template <class T>
  struct Parameters {
    T first;
    Vec3<T> colour;
    T last;
  };
  static void describe(auto& p, auto&& visit) {
    visit(p.first, ParameterInfo{.name = "first"});
    visit(p.colour, ParameterInfo{.name = "colour"});
    visit(p.last, ParameterInfo{.name = "last"});
  }
};

TEST(Flatten, GoesByTheOrderOfTheDescription) {
  const std::vector<ParameterInfo> list = describe_parameters<Described>();
  ASSERT_EQ(list.size(), 3u);
  EXPECT_EQ(list[1].components, 3);
  EXPECT_EQ(list[2].offset, 4);
  const std::vector<double> slots{1.0, 2.0, 3.0, 4.0, 5.0};
  const auto p = unflatten<Described, double>(std::span<const double>(slots));
  EXPECT_EQ(p.first, 1.0);
  EXPECT_EQ(p.colour.x, 2.0);
  EXPECT_EQ(p.colour.y, 3.0);
  EXPECT_EQ(p.colour.z, 4.0);
  EXPECT_EQ(p.last, 5.0);
}

}  // namespace
}  // namespace lobefit
