// Traced shaders: their text, that a shader compiler takes it, and that it computes what the model computes.

#include "evaluate/shader.h"

#include <gtest/gtest.h>
#include <rapidcheck.h>
#include <rapidcheck/gtest.h>

#include <algorithm>

#include "evaluate/float_model.h"
#include "tests/directions.h"
#include "tests/shader_compiler.h"
#include "tests/shader_interpreter.h"

namespace lobefit {
namespace {

std::size_t occurrences(std::string_view text, std::string_view part) {
  std::size_t count = 0;
  for (std::size_t at = text.find(part); at != std::string_view::npos; at = text.find(part, at + 1)) ++count;
  return count;
}

/// A model's parameters at their defaults, but for an albedo that tells the channels apart.
std::vector<ShaderParameter> shader_parameters(const Model& model) {
  std::vector<ShaderParameter> parameters;
  for (const ParameterInfo& info : model.parameters) {
    std::vector<double> value(static_cast<std::size_t>(info.components), info.initial);
    if (info.name == "albedo") value = {0.25, 0.5, 0.875};
    parameters.push_back({info, value, ""});
  }
  return parameters;
}

std::string print_model(const Model& model, std::string_view language) {
  return print_shader(find_float_model(model.info->name).trace(), language, *model.info, shader_parameters(model), {});
}

// ---- small graphs -----------------------------------------------------------------------------------------------

/// The body of the function that prints an expression of inputs a, b, c and a vector v: its lines, unindented.
template <class Build>
std::string body(Build&& build, std::string_view language = "hlsl") {
  Trace trace;
  const auto scalar = [&](const char* name) {
    return Expression(trace.node(Operation::input, ShaderType::scalar, {}, name));
  };
  const Vec3<Expression> v(trace.node(Operation::input, ShaderType::vector, {}, "v"));
  const auto result = build(scalar("a"), scalar("b"), scalar("c"), v);
  const Shader shader = trace.finish(
      {"test",
       {{"a", ShaderType::scalar}, {"b", ShaderType::scalar}, {"c", ShaderType::scalar}, {"v", ShaderType::vector}},
       result.node});
  constexpr ModelInfo info{.name = "test", .title = "Test", .source = "here"};
  const std::string text = print_shader(shader, language, info, {}, {});
  const std::size_t begin = text.find('\n', text.find("Lobefit_test(")) + 1;
  std::string lines = text.substr(begin, text.find("\n}", begin) - begin);
  for (std::size_t at; (at = lines.find("    ")) != std::string::npos;) lines.erase(at, 4);
  return lines;
}

using E = Expression;
using V = Vec3<Expression>;

TEST(ShaderText, KeepsTheOrderOfOperations) {
  EXPECT_EQ(body([](E a, E b, E c, V) { return a - (b - c); }), "return a - (b - c);");
  EXPECT_EQ(body([](E a, E b, E c, V) { return (a - b) - c; }), "return a - b - c;");
  EXPECT_EQ(body([](E a, E b, E c, V) { return a + (b + c); }), "return a + (b + c);");
  EXPECT_EQ(body([](E a, E b, E c, V) { return a * (b + c); }), "return a * (b + c);");
  EXPECT_EQ(body([](E a, E b, E c, V) { return a * b + c; }), "return a * b + c;");
  EXPECT_EQ(body([](E a, E b, E c, V) { return a + b * c; }), "return a + b * c;");
  EXPECT_EQ(body([](E a, E b, E c, V) { return (a / b) / c; }), "return a / b / c;");
  EXPECT_EQ(body([](E a, E b, E c, V) { return a / (b / c); }), "return a / (b / c);");
  EXPECT_EQ(body([](E a, E b, E c, V) { return a / (b * c); }), "return a / (b * c);");
  EXPECT_EQ(body([](E a, E b, E, V) { return -(a + b); }), "return -(a + b);");
  EXPECT_EQ(body([](E a, E b, E, V) { return a - (-b); }), "return a - (-b);");
  EXPECT_EQ(body([](E a, E b, E, V) { return -a * b; }), "return (-a) * b;");
  EXPECT_EQ(body([](E a, E b, E, V) { return -(a * b); }), "return -(a * b);");
}

TEST(ShaderText, PutsSelectionsInParentheses) {
  EXPECT_EQ(body([](E a, E b, E c, V) { return select(a < b, b, c); }), "return a < b ? b : c;");
  EXPECT_EQ(body([](E a, E b, E c, V) { return a * select(b >= c, b, c); }), "return a * (b >= c ? b : c);");
  EXPECT_EQ(body([](E a, E b, E c, V) { return select(a > b, a, select(b <= c, b, c)); }),
            "return a > b ? a : (b <= c ? b : c);");
  EXPECT_EQ(body([](E a, E b, E c, V) { return select(a + b > c, a + b * c, -c); }, "glsl"),
            "return a + b > c ? a + b * c : -c;");
}

TEST(ShaderText, NegativeLiteralsNeedNoGuessing) {
  EXPECT_EQ(body([](E a, E, E, V) { return a * -0.5; }), "return a * (-0.5);");
  EXPECT_EQ(body([](E a, E, E, V) { return a - -0.5; }), "return a - (-0.5);");
  EXPECT_EQ(body([](E a, E, E, V) { return -0.5 + a; }), "return -0.5 + a;");
  EXPECT_EQ(body([](E a, E, E, V) { return max(a, -0.5); }), "return max(a, -0.5);");
}

TEST(ShaderText, LiteralsAreFloats) {
  EXPECT_EQ(body([](E a, E, E, V) { return a + 1.0; }), "return a + 1.0;");
  EXPECT_EQ(body([](E a, E, E, V) { return a + 1e-7; }), "return a + 1e-07;");
  EXPECT_EQ(body([](E a, E, E, V) { return a * 1e20; }), "return a * 1e+20;");
  EXPECT_EQ(body([](E a, E, E, V) { return a + 0.1; }), "return a + 0.1;");
  EXPECT_EQ(body([](E a, E, E, V) { return a + 2.0 / 3.0; }), "return a + 0.6666667;");
  EXPECT_EQ(body([](E a, E, E, V) { return a / pi; }), "return a / LOBEFIT_PI;");
}

TEST(ShaderText, LiteralsFold) {
  EXPECT_EQ(body([](E a, E, E, V) { return E(2.0) * E(3.0) * a; }), "return 6.0 * a;");
  EXPECT_EQ(body([](E a, E, E, V) { return (E(1.0) - 0.75) * a; }), "return 0.25 * a;");
  EXPECT_EQ(body([](E a, E, E, V) { return a / -E(4.0); }), "return a / (-4.0);");
  EXPECT_EQ(body([](E a, E, E, V) { return a + E(3.0) / 2.0; }), "return a + 1.5;");
  // Not across a variable: the order of rounding is the text's.
  EXPECT_EQ(body([](E a, E, E, V) { return 2.0 * (3.0 * a); }), "return 2.0 * (3.0 * a);");
}

TEST(ShaderText, SharedSubexpressionsAreComputedOnce) {
  EXPECT_EQ(body([](E a, E b, E, V) { return (a + b) * (a + b); }), "float t0 = a + b;\nreturn t0 * t0;");
  EXPECT_EQ(body([](E a, E b, E, V) { return sqrt(a * a + b) / (a * a); }),
            "float t0 = a * a;\nreturn sqrt(max(t0 + b, 0.0)) / t0;");
  // Inputs and their components are no work: they stay where they are.
  EXPECT_EQ(body([](E a, E, E, V v) { return a * v.x + a * v.x; }), "float t0 = a * v.x;\nreturn t0 + t0;");
  EXPECT_EQ(body([](E, E, E, V v) { return (v + v) * v; }), "return (v + v) * v;");
}

TEST(ShaderText, NamesAreThoseOfTheText) {
  EXPECT_EQ(body([](E a, E b, E, V) { return let("ratio", a / b) * 2.0; }),
            "float ratio = a / b;\nreturn ratio * 2.0;");
  EXPECT_EQ(body([](E a, E b, E, V v) { return let("moved", v * a) * b; }), "float3 moved = v * a;\nreturn moved * b;");
  EXPECT_EQ(body([](E a, E b, E, V v) { return let("moved", v * a).y * b; }, "glsl"),
            "vec3 moved = v * a;\nreturn moved.y * b;");
  // A value that the text names here and writes out there has its name in both places.
  EXPECT_EQ(body([](E a, E b, E, V) { return let("ratio", a / b) + a / b; }),
            "float ratio = a / b;\nreturn ratio + ratio;");
}

TEST(ShaderText, NamesDoNotCollide) {
  const auto same_name_twice = [](E a, E b, E, V) {
    const E first = let("x", a + 1.0);
    const E second = let("x", b + 1.0);
    return first * second;
  };
  EXPECT_EQ(body(same_name_twice), "float x = a + 1.0;\nfloat x_2 = b + 1.0;\nreturn x * x_2;");
  EXPECT_EQ(body([](E a, E b, E, V) { return let("a", a + b) * 2.0; }), "float a_2 = a + b;\nreturn a_2 * 2.0;");
  const auto name_of_a_temporary = [](E a, E b, E, V) {
    const E named = let("t0", a - b);
    const E shared = a + b;
    return named * (shared * shared);
  };
  EXPECT_EQ(body(name_of_a_temporary), "float t0 = a - b;\nfloat t0_2 = a + b;\nreturn t0 * (t0_2 * t0_2);");
  // p is the parameter struct.
  EXPECT_EQ(body([](E a, E b, E, V) { return let("p", a + b) * 2.0; }), "float p_2 = a + b;\nreturn p_2 * 2.0;");
  // Words of one language or the other.
  for (const std::string word : {"half", "smooth", "sample", "saturate", "dot"}) {
    EXPECT_EQ(body([&](E a, E b, E, V) { return let(word.c_str(), a + b) * 2.0; }),
              "float " + word + "_2 = a + b;\nreturn " + word + "_2 * 2.0;");
  }
}

TEST(ShaderText, GuardsArePrinted) {
  EXPECT_EQ(body([](E a, E b, E, V) { return pow(a, b); }), "return pow(max(a, 1e-36), b);");
  EXPECT_EQ(body([](E a, E, E, V) { return log2(a); }), "return log2(max(a, 1e-36));");
  EXPECT_EQ(body([](E a, E, E, V) { return sqrt(a); }), "return sqrt(max(a, 0.0));");
  // A sum of squares needs none.
  EXPECT_EQ(body([](E a, E b, E, V) { return sqrt(a * a + b * b); }), "return sqrt(a * a + b * b);");
  EXPECT_EQ(body([](E a, E b, E, V) { return sqrt(a * a - b * b); }), "return sqrt(max(a * a - b * b, 0.0));");
}

TEST(ShaderText, LanguagesDifferInTheirWords) {
  const auto mixed = [](E a, E b, E c, V) { return lerp(a, b, saturate(c)); };
  EXPECT_EQ(body(mixed, "hlsl"), "return lerp(a, b, saturate(c));");
  EXPECT_EQ(body(mixed, "glsl"), "return mix(a, b, clamp(c, 0.0, 1.0));");
  const auto constructed = [](E a, E b, E c, V) { return V(a, b, c); };
  EXPECT_EQ(body(constructed, "hlsl"), "return float3(a, b, c);");
  EXPECT_EQ(body(constructed, "glsl"), "return vec3(a, b, c);");
}

TEST(ShaderText, CHasNoVectorOperators) {
  // The arguments wi, wo, p of the printed function are a, b, c, v here; what the text leaves unread it says.
  const auto in_c = [](auto&& build) {
    std::string text = body(build, "c");
    for (std::size_t at; (at = text.find("(void)")) != std::string::npos;) text.erase(at, text.find('\n', at) + 1 - at);
    return text;
  };
  EXPECT_EQ(in_c([](E a, E b, E, V v) { return v * a + v / b; }),
            "return Lobefit_add3(Lobefit_scale3(v, a), Lobefit_divide3(v, Lobefit_splat3(b)));");
  EXPECT_EQ(in_c([](E a, E, E, V v) { return (1.0 - v) * (a + v); }),
            "return Lobefit_multiply3(Lobefit_subtract3(Lobefit_splat3(1.0f), v), "
            "Lobefit_add3(Lobefit_splat3(a), v));");
  EXPECT_EQ(in_c([](E a, E b, E, V v) { return lerp(v, v * v, a) * (a + b); }),
            "return Lobefit_scale3(Lobefit_lerp3(v, Lobefit_multiply3(v, v), Lobefit_splat3(a)), a + b);");
  EXPECT_EQ(in_c([](E a, E b, E c, V) { return lerp(a, saturate(b), c); }),
            "return Lobefit_lerp(a, fminf(fmaxf(b, 0.0f), 1.0f), c);");
  EXPECT_EQ(in_c([](E a, E b, E, V v) { return pow(dot(v, v), a) + abs(b) * 0.1; }),
            "return powf(fmaxf(Lobefit_dot3(v, v), 1e-36f), a) + fabsf(b) * 0.1f;");
  EXPECT_EQ(in_c([](E a, E b, E, V v) { return select(a < b, v, max(normalize(v), 0.0)); }),
            "return a < b ? v : Lobefit_max3(Lobefit_normalize3(v), Lobefit_splat3(0.0f));");
  EXPECT_EQ(body([](E, E b, E, V) { return b * 2.0; }, "c"),
            "(void)p;\n(void)a;\n(void)c;\n(void)v;\nreturn b * 2.0f;");
}

TEST(ShaderText, WgslPutsTypesBehindNamesAndSelectsByFunction) {
  const auto in_wgsl = [](auto&& build) { return body(build, "wgsl"); };
  EXPECT_EQ(in_wgsl([](E a, E b, E c, V) { return select(a < b, b, c); }), "return select(c, b, a < b);");
  EXPECT_EQ(in_wgsl([](E a, E b, E c, V) { return let("mean", lerp(a, b, saturate(c))) * 2.0; }),
            "let mean = mix(a, b, saturate(c));\nreturn mean * 2.0;");
  EXPECT_EQ(in_wgsl([](E a, E, E, V v) { return max(v * a, 0.0); }), "return max(v * a, vec3f(0.0));");
  EXPECT_EQ(in_wgsl([](E a, E b, E c, V) { return V(a, b, c); }), "return vec3f(a, b, c);");
}

/// Some expression of inputs a, b, c and literals that float holds exactly.
Expression random_expression(Expression a, Expression b, Expression c, int depth) {
  const int kind = *rc::gen::inRange(0, depth > 0 ? 10 : 2);
  if (kind == 0) return std::array{a, b, c}[*rc::gen::inRange<std::size_t>(0, 3)];
  if (kind == 1) return *rc::gen::element(0.5, -0.5, 2.0, -3.0, 0.25);
  const auto operand = [&] { return random_expression(a, b, c, depth - 1); };
  const Expression x = operand();
  Expression y = operand();
  // Two literals would fold, to numbers that float may not hold.
  if (x.node->operation == Operation::literal && y.node->operation == Operation::literal) y = a;
  switch (kind) {
    case 2: return x + y;
    case 3: return x - y;
    case 4: return x * y;
    case 5: return x / y;
    case 6: return -(x + y);
    case 7: return min(x, y);
    case 8: return select(x < y, x, operand());
    default: return let("named", x - y);
  }
}

RC_GTEST_PROP(ShaderText, ReadsAsTheSameComputation, ()) {
  // Bit for bit: the text keeps the order of rounding. Missing parentheses, a lost minus or a mixed-up name would show.
  Trace trace;
  const auto scalar = [&](const char* name) {
    return Expression(trace.node(Operation::input, ShaderType::scalar, {}, name));
  };
  const Expression result = random_expression(scalar("a"), scalar("b"), scalar("c"), 5);
  const Shader shader = trace.finish(
      {"test", {{"a", ShaderType::scalar}, {"b", ShaderType::scalar}, {"c", ShaderType::scalar}}, result.node});
  constexpr ModelInfo info{.name = "test", .title = "Test", .source = "here"};
  // print_shader() names the arguments of a model's function wi, wo and p: the inputs travel as variables.
  const std::map<std::string, ShaderValue> inputs{{"a", {0.7}}, {"b", {-1.3}}, {"c", {2.9}}};
  const std::string text = print_shader(shader, *rc::gen::elementOf(shader_languages()), info, {}, {});
  RC_LOG() << text;
  const double by_graph = GraphInterpreter(shader).run(inputs).at(0);
  const double by_text = TextInterpreter(text).call("Lobefit_test", {}, inputs).at(0);
  RC_ASSERT((std::isnan(by_graph) && std::isnan(by_text)) ||
            std::bit_cast<std::uint64_t>(by_graph) == std::bit_cast<std::uint64_t>(by_text));
}

// ---- functions --------------------------------------------------------------------------------------------------

struct Luminance {
  static constexpr const char* name = "luminance";
  static constexpr std::array arguments{"colour", "scale"};

  template <class C, class S>
  static auto evaluate(const C& colour, const S& scale) {
    return dot(colour, colour) * scale;
  }
};

TEST(ShaderText, CallsBecomeFunctionsWithTypedArguments) {
  Trace trace;
  const V v(trace.node(Operation::input, ShaderType::vector, {}, "wi"));
  const E result = call<Luminance>(v, 2.0) + call<Luminance>(v * 3.0, v.x);
  const Shader shader = trace.finish({"test", {}, result.node});
  const std::string text = print_shader(shader, "hlsl", {.name = "test"}, {}, {});
  EXPECT_NE(text.find("#ifndef LOBEFIT_FUNCTION_LUMINANCE\n"
                      "#define LOBEFIT_FUNCTION_LUMINANCE\n"
                      "float Lobefit_luminance(float3 colour, float scale) {\n"
                      "    return dot(colour, colour) * scale;\n"
                      "}\n"
                      "#endif\n"),
            std::string::npos)
      << text;
  EXPECT_NE(text.find("return Lobefit_luminance(wi, 2.0) + Lobefit_luminance(wi * 3.0, wi.x);"), std::string::npos)
      << text;
  EXPECT_EQ(occurrences(text, "float Lobefit_luminance("), 1u);
}

TEST(ShaderText, CalleesComeFirstAndOnce) {
  // Burley calls schlick_scale twice, which calls pow5.
  const std::string text = print_model(find_model("burley"), "hlsl");
  EXPECT_EQ(occurrences(text, "float Lobefit_pow5(float x) {"), 1u);
  EXPECT_EQ(occurrences(text, "float Lobefit_schlick_scale(float f90, float cos_theta) {"), 1u);
  EXPECT_EQ(occurrences(text, "Lobefit_schlick_scale(f90, cos_theta_"), 2u);
  EXPECT_LT(text.find("float Lobefit_pow5("), text.find("float Lobefit_schlick_scale("));
  EXPECT_LT(text.find("float Lobefit_schlick_scale("), text.find("float3 Lobefit_burley("));
}

struct TinyTable {
  static constexpr const char* name = "tiny";
  static constexpr int columns = 2;
  static constexpr std::array<float, 4> entries{-1.0f, 0.5f, 2.0f, 1e-7f};
};

TEST(ShaderText, TablesAreConstantArrays) {
  Trace trace;
  const V v(trace.node(Operation::input, ShaderType::vector, {}, "wi"));
  const E result = lookup<TinyTable>(v.x) + lookup<TinyTable>(v.y);
  const Shader shader = trace.finish({"test", {}, result.node});
  const std::string hlsl = print_shader(shader, "hlsl", {.name = "test"}, {}, {});
  const std::string array =
      "#ifndef LOBEFIT_TABLE_TINY\n"
      "#define LOBEFIT_TABLE_TINY\n"
      "static const float Lobefit_tiny_entries[4] = {\n"
      "    -1.0, 0.5, 2.0, 1e-07\n"
      "};\n"
      "#endif\n";
  EXPECT_EQ(occurrences(hlsl, array), 1u) << hlsl;
  EXPECT_EQ(occurrences(hlsl, "Lobefit_tiny_entries[int(column + 1.0)]"), 1u) << hlsl;
  const std::string glsl = print_shader(shader, "glsl", {.name = "test"}, {}, {});
  EXPECT_NE(glsl.find("\nconst float Lobefit_tiny_entries[4] = float[4](\n    -1.0, 0.5, 2.0, 1e-07\n);\n"),
            std::string::npos)
      << glsl;
  EXPECT_EQ(count_operations(shader).table_read, 8);
}

TEST(Trace, IsOneAtATime) {
  EXPECT_THROW(Expression(1.0), std::logic_error);
  const Trace trace;
  EXPECT_THROW(Trace(), std::logic_error);
}

// ---- whole shaders ----------------------------------------------------------------------------------------------

TEST(Shader, ProximaReadsLikeHandWrittenCode) {
  const std::string expected = R"(float3 Lobefit_proxima(float3 wi, float3 wo, Lobefit_proxima_Parameters p) {
    float cos_theta_i = wi.z;
    float cos_theta_o = wo.z;
    float cos_light_view = dot(wi, wo);
    float cos_theta_k = saturate(-cos_light_view);
    float fade = 1.0 - pow(max(cos_theta_k, 1e-36), p.exponent);
    float slope = p.a + p.b / max(cos_theta_i, 1e-36);
    return min(cos_theta_i, cos_theta_o) > 0.0 ? p.albedo / LOBEFIT_PI * max(1.0 + p.alpha * slope * fade, 0.0) : float3(0.0, 0.0, 0.0);
}
)";
  const std::string text = print_model(find_model("proxima"), "hlsl");
  EXPECT_NE(text.find(expected), std::string::npos) << text;
}

TEST(Shader, StatesParametersWithRangesValuesAndProvenance) {
  const Model& model = find_model("oren_nayar");
  std::vector<ShaderParameter> parameters = shader_parameters(model);
  parameters[1].value = {0.125};
  parameters[1].comment = "0.12 to 0.13 at 95 %";
  const std::vector<std::string> provenance{"Fitted to a table.", "Residual 0.04."};
  const std::string text =
      print_shader(find_float_model("oren_nayar").trace(), "glsl", *model.info, parameters, provenance);
  for (const std::string_view part :
       {"// Oren-Nayar diffuse, full form.\n", "// Source: Oren, Nayar 1994",
        "// Fitted to a table.\n// Residual 0.04.\n", "struct Lobefit_oren_nayar_Parameters {\n    vec3 albedo;",
        "    float sigma;  // ", "Range 0 to 1.57079632679", " rad.\n",
        "vec3 Lobefit_oren_nayar(vec3 wi, vec3 wo, Lobefit_oren_nayar_Parameters p) {\n",
        "Lobefit_oren_nayar_Parameters Lobefit_oren_nayar_Fitted() {\n", "    p.albedo = vec3(0.25, 0.5, 0.875);\n",
        "    p.sigma = 0.125;  // 0.12 to 0.13 at 95 %\n", "    return p;\n}\n"}) {
    EXPECT_NE(text.find(part), std::string::npos) << "missing: " << part << "\n" << text;
  }
}

TEST(Shader, UnknownLanguageIsAUsageError) {
  EXPECT_EQ(shader_languages(), (std::vector<std::string>{"hlsl", "glsl", "c", "wgsl"}));
  try {
    print_model(find_model("lambert"), "cg");
    FAIL() << "no error was thrown";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::usage);
    const std::string message = error.what();
    EXPECT_NE(message.find("'cg'"), std::string::npos) << message;
    EXPECT_NE(message.find("hlsl, glsl, c, wgsl"), std::string::npos) << message;
  }
}

TEST(Shader, OperationsOfProximaCountedByHand) {
  // dot 5; -x 1; 1 - pow 1 and y log x 1; a + b/… 1; 1 + α·slope·fade 3; albedo/π · factor 3. Divisions: b/μ 1,
  // albedo/π 3. Comparisons: saturate, max of the base, max of μ, max with 0, min of the cosines, > and a float3
  // selection.
  const OperationCount count = count_operations(find_float_model("proxima").trace());
  EXPECT_EQ(count.add_multiply, 5 + 1 + 1 + 1 + 1 + 3 + 3);
  EXPECT_EQ(count.divide, 1 + 3);
  EXPECT_EQ(count.square_root, 0);
  EXPECT_EQ(count.transcendental, 2);
  EXPECT_EQ(count.compare_select, 6 + 3);
  EXPECT_EQ(count.total(), 15 + 4 + 2 + 9);
}

TEST(Shader, CalledFunctionsCountAtEveryCall) {
  // Burley over Lambert: two calls of 1 + (f90 - 1) pow5(1 - x), each 4 + 3; f90 4; V·H = |wi + wo|/2, 3 + 5 + 1 and a
  // root; one product of the two factors and three with the albedo.
  const OperationCount burley = count_operations(find_float_model("burley").trace());
  EXPECT_EQ(burley.add_multiply, 2 * 7 + 4 + 3 + 5 + 1 + 1 + 3);
  EXPECT_EQ(burley.square_root, 1);
  EXPECT_EQ(burley.divide, 3);
}

class ShaderOfModel : public ::testing::TestWithParam<std::tuple<std::string, std::string>> {
 protected:
  const Model& model_ = find_model(std::get<0>(GetParam()));
  const std::string language_ = std::get<1>(GetParam());
  const std::string name_ = "Lobefit_" + std::get<0>(GetParam());
  const std::string text_ = print_model(model_, language_);
  const Shader shader_ = find_float_model(model_.info->name).trace();

  /// The acos of shaders is a polynomial.
  bool has_arc_cosine() const {
    return std::any_of(shader_.functions.begin(), shader_.functions.end(),
                       [](const ShaderFunction& function) { return function.name == "acos"; });
  }
};

std::vector<std::string> model_names() {
  std::vector<std::string> names;
  for (const Model& model : models()) names.emplace_back(model.info->name);
  return names;
}

INSTANTIATE_TEST_SUITE_P(Models, ShaderOfModel,
                         ::testing::Combine(::testing::ValuesIn(model_names()),
                                            ::testing::ValuesIn(shader_languages())),
                         [](const auto& test) { return std::get<0>(test.param) + "_" + std::get<1>(test.param); });

/// A slab carries light of its own, and glints that are the lobe itself as long as no discrete lobe is modelled.
bool is_no_part_of_the_brdf(std::string_view parameter) {
  return parameter == "slab.emissive" || parameter == "slab.glint_density";
}

TEST_P(ShaderOfModel, HasItsPartsOnce) {
  EXPECT_EQ(occurrences(text_, "struct " + name_ + "_Parameters {"), 1u);
  EXPECT_EQ(occurrences(text_, " " + name_ + "("), 1u);
  EXPECT_EQ(occurrences(text_, " " + name_ + (language_ == "c" ? "_Fitted(void) " : "_Fitted() ")), 1u);
  for (const ParameterInfo& info : model_.parameters) {
    EXPECT_EQ(occurrences(text_, "    p." + std::string(info.name) + " = "), 1u) << info.name;
    const std::string place = std::string(model_.info->name) + "." + std::string(info.name);
    const std::size_t uses = occurrences(text_, "p." + std::string(info.name)) - 1;
    if (is_no_part_of_the_brdf(place)) {
      EXPECT_EQ(uses, 0u) << place;
    } else {
      EXPECT_GE(uses, 1u) << place << " is never used";
    }
  }
}

/// WGSL has a test of its own, which compiles all models in one go, and runs them.
class CompiledShaderOfModel : public ShaderOfModel {};

INSTANTIATE_TEST_SUITE_P(Models, CompiledShaderOfModel,
                         ::testing::Combine(::testing::ValuesIn(model_names()), ::testing::Values("hlsl", "glsl", "c")),
                         [](const auto& test) { return std::get<0>(test.param) + "_" + std::get<1>(test.param); });

TEST_P(CompiledShaderOfModel, IsAcceptedByAShaderCompiler) {
  if (!has_shader_compiler(language_)) {
    GTEST_SKIP() << no_shader_compiler;
  }
  const std::string call = name_ + "(" + vector_text(language_, "0.6", "0.0", "0.8") + ", " +
                           vector_text(language_, "0.0", "0.0", "1.0") + ", " + name_ + "_Fitted())";
  EXPECT_EQ(shader_complaint(language_, text_, call, std::get<0>(GetParam())), "");
}

TEST(Shader, AllModelsStandInOneText) {
  // Callees are guarded, and some models call one function on scalars and others on vectors. In C no term is among
  // them: it has the name of the function that they call.
  for (const std::string& language : shader_languages()) {
    if (language == "wgsl" || !has_shader_compiler(language)) continue;  // WGSL has no guards: a text stands alone
    std::string text;
    for (const Model& model : models()) {
      if (language != "c" || !is_term(model.info->kind)) text += print_model(model, language);
    }
    const std::string up = vector_text(language, "0.0", "0.0", "1.0");
    EXPECT_EQ(shader_complaint(language, text,
                               "Lobefit_hair_unreal(" + up + ", " + up + ", Lobefit_hair_unreal_Fitted())", "all")
                  .substr(0, 2000),
              "");
  }
}

/// Largest difference of `value(wi, wo)` from the double model over random pairs, relative to 1 + |f|.
template <class Value>
double worst_difference(const Model& model, std::span<const double> flat, Value&& value) {
  double worst = 0.0;
  std::vector<DirectionPair> pairs = random_pairs(500, 51);
  pairs.push_back({direction(0.5, 0.0), {0.6, 0.0, -0.8}});  // below the horizon
  for (const auto& [wi, wo] : pairs) {
    const Rgb truth = model.evaluate(flat, wi, wo);
    const ShaderValue shader = value(ShaderValue{wi.x, wi.y, wi.z}, ShaderValue{wo.x, wo.y, wo.z});
    const std::array<double, 3> expected{truth.x, truth.y, truth.z};
    for (std::size_t k = 0; k < 3; ++k) {
      worst = std::max(worst, std::abs(shader.at(k) - expected[k]) / (1.0 + std::abs(expected[k])));
    }
  }
  return worst;
}

TEST_P(ShaderOfModel, GraphEqualsTheModel) {
  const GraphInterpreter interpreter(shader_);
  for (const std::vector<double>& flat : interior_parameters(model_.parameters, 4, 0.0, 52)) {
    std::map<std::string, ShaderValue> inputs;
    for (const ParameterInfo& info : model_.parameters) {
      const auto first = flat.begin() + info.offset;
      inputs["p." + std::string(info.name)] = ShaderValue(first, first + info.components);
    }
    const double worst = worst_difference(model_, flat, [&](const ShaderValue& wi, const ShaderValue& wo) {
      inputs["wi"] = wi, inputs["wo"] = wo;
      return interpreter.run(inputs);
    });
    EXPECT_LE(worst, has_arc_cosine() ? 1e-7 : 1e-12);
  }
}

TEST_P(ShaderOfModel, TextEqualsTheModel) {
  TextInterpreter interpreter(text_);
  const TextInterpreter::Variables members = interpreter.members(name_ + "_Fitted");
  std::vector<double> flat;
  for (const ShaderParameter& parameter : shader_parameters(model_)) {
    flat.insert(flat.end(), parameter.value.begin(), parameter.value.end());
  }
  const double worst = worst_difference(model_, flat, [&](const ShaderValue& wi, const ShaderValue& wo) {
    return interpreter.call(name_, {wi, wo}, members);
  });
  // Literals are printed in float precision.
  EXPECT_LE(worst, 1e-6);
}

}  // namespace
}  // namespace lobefit
