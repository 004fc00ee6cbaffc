// The fitted rules as shader text: that a compiler takes it, and that it makes the slabs that the rules make.

#include "evaluate/substrate_shader.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>

#include "evaluate/float_model.h"
#include "evaluate/shader.h"
#include "evaluate/single.h"
#include "tests/directions.h"
#include "tests/shader_compiler.h"
#include "tests/shader_interpreter.h"

namespace lobefit {
namespace {

using SlabValues = Slab::Parameters<double>;

/// Inside the bounds, each its own: constants that changed places would show.
FittedBlend::Constants<double> random_constants(std::uint64_t seed) {
  UniformNumbers uniform(seed);
  FittedBlend::Constants<double> constants{};
  FittedBlend::describe(constants, [&](double& member, const ParameterInfo& info) {
    // Powers of means: the extremes leave the range of floats.
    const double share = info.lower == -3.0 && info.upper == 3.0 ? 0.1 : 1.0;
    const double middle = 0.5 * (info.lower + info.upper), half = 0.5 * (info.upper - info.lower);
    member = middle + share * half * (2.0 * uniform() - 1.0);
  });
  return constants;
}

struct SlabPair {
  SlabValues first, second;
  double share, cos_theta_o;
};

/// Opaque and translucent, bare, dielectric and metal, with and without a second lobe.
std::vector<SlabPair> slab_pairs(std::size_t count, std::uint64_t seed) {
  UniformNumbers uniform(seed);
  const std::vector<std::vector<double>> sets =
      interior_parameters(describe_parameters<Slab>(), 2 * count, 0.0, seed + 1);
  const auto slab = [&](std::span<const double> flat) {
    SlabValues values = unflatten<Slab, double, double>(flat);
    // From lengths of the same order come depths around 1.
    values.thickness *= 1e-3;
    const double medium = uniform();
    values.mean_free_path = values.mean_free_path * (medium < 0.3 ? 0.0 : medium < 0.6 ? 1e-4 : 1e-3);
    const double interface = uniform();
    values.f0 = values.f0 * (interface < 0.2 ? 0.0 : interface < 0.6 ? 0.08 : 1.0);
    if (uniform() < 0.3) values.second_roughness_weight = 0.0;
    if (uniform() < 0.5) values.fuzz_amount = 0.0;
    return values;
  };
  std::vector<SlabPair> pairs;
  for (std::size_t i = 0; i < count; ++i) {
    // One by one: the order of a call's arguments is the compiler's.
    SlabPair pair;
    pair.first = slab(sets[2 * i]);
    pair.second = slab(sets[2 * i + 1]);
    pair.share = uniform();
    pair.cos_theta_o = 1.0 - uniform();
    pairs.push_back(pair);
  }
  return pairs;
}

/// One rule as the shader has it and as the text computes it.
struct Rule {
  std::string function;
  std::array<std::string, 2> slabs;
  std::function<SlabValues(const SlabPair&, const FittedBlend::Constants<double>&)> in_double;
  std::function<SlabValues(const SlabPair&, const FittedBlend::Constants<double>&)> in_float;
};

Slab::Parameters<Single> rounded(const SlabValues& slab) {
  SlabValues from = slab;
  std::vector<double> flat;
  Slab::describe(from, [&](const auto& member, const ParameterInfo&) {
    if constexpr (is_vector<std::remove_cvref_t<decltype(member)>>) {
      flat.insert(flat.end(), {member.x, member.y, member.z});
    } else {
      flat.push_back(member);
    }
  });
  return unflatten<Slab, Single, double>(flat);
}

FittedBlend::Constants<Single> rounded(const FittedBlend::Constants<double>& constants) {
  std::vector<double> flat;
  FittedBlend::describe(constants, [&](const double& member, const ParameterInfo&) { flat.push_back(member); });
  FittedBlend::Constants<Single> result{};
  std::size_t slot = 0;
  FittedBlend::describe(result, [&](Single& member, const ParameterInfo&) { member = Single(flat[slot++]); });
  return result;
}

SlabValues widened(const Slab::Parameters<Single>& slab) {
  std::vector<double> flat;
  Slab::describe(slab, [&](const auto& member, const ParameterInfo&) {
    if constexpr (is_vector<std::remove_cvref_t<decltype(member)>>) {
      flat.insert(flat.end(), {member.x.value, member.y.value, member.z.value});
    } else {
      flat.push_back(member.value);
    }
  });
  return unflatten<Slab, double, double>(flat);
}

template <LobeMerge merge>
std::array<Rule, 2> rules_with_lobes() {
  using C = FittedBlend::Constants<double>;
  const std::string ending = merge == LobeMerge::both ? "Haze" : "";
  return {Rule{"Lobefit_BlendVertical" + ending,
               {"top", "bottom"},
               [](const SlabPair& s, const C& c) {
                 return FittedBlend::vertical<merge>(s.first, s.second, s.cos_theta_o, c);
               },
               [](const SlabPair& s, const C& c) {
                 return widened(FittedBlend::vertical<merge>(rounded(s.first), rounded(s.second), Single(s.cos_theta_o),
                                                             rounded(c)));
               }},
          Rule{"Lobefit_BlendHorizontal" + ending,
               {"background", "foreground"},
               [](const SlabPair& s, const C& c) {
                 return FittedBlend::horizontal<merge>(s.first, s.second, s.share, s.cos_theta_o, c);
               },
               [](const SlabPair& s, const C& c) {
                 return widened(FittedBlend::horizontal<merge>(rounded(s.first), rounded(s.second), Single(s.share),
                                                               Single(s.cos_theta_o), rounded(c)));
               }}};
}

std::vector<Rule> rules() {
  std::vector<Rule> all;
  for (const Rule& rule : rules_with_lobes<LobeMerge::mean>()) all.push_back(rule);
  for (const Rule& rule : rules_with_lobes<LobeMerge::both>()) all.push_back(rule);
  return all;
}

/// Visits the members of two slabs: what they are, and their components.
template <class Visit>
void each_member(const SlabValues& a, const SlabValues& b, Visit&& visit) {
  std::vector<std::vector<double>> first;
  const auto components = [](const auto& member) {
    if constexpr (is_vector<std::remove_cvref_t<decltype(member)>>) {
      return std::vector{member.x, member.y, member.z};
    } else {
      return std::vector{member};
    }
  };
  Slab::describe(a, [&](const auto& member, const ParameterInfo&) { first.push_back(components(member)); });
  std::size_t index = 0;
  Slab::describe(
      b, [&](const auto& member, const ParameterInfo& info) { visit(info, first[index++], components(member)); });
}

/// Largest difference of each member, relative to what the pair has of it or, of shares and albedos, to 1.
class Differences {
 public:
  void add(const SlabPair& pair, const SlabValues& truth, const SlabValues& value) {
    std::vector<double> scales;
    each_member(pair.first, pair.second, [&](const ParameterInfo& info, const auto& first, const auto& second) {
      for (std::size_t k = 0; k < first.size(); ++k) {
        const double one = info.upper <= 1.0 ? 1.0 : 0.0;
        scales.push_back(std::max({one, std::abs(first[k]), std::abs(second[k])}));
      }
    });
    std::size_t slot = 0;
    each_member(truth, value, [&](const ParameterInfo& info, const auto& expected, const auto& found) {
      for (std::size_t k = 0; k < expected.size(); ++k) {
        const double scale = std::max({scales[slot++], std::abs(expected[k]), 1e-9});
        double& worst = worst_[std::string(info.name)];
        const double difference = std::abs(found[k] - expected[k]) / scale;
        if (!(difference <= worst)) worst = difference;
      }
    });
  }
  const std::map<std::string, double>& worst() const { return worst_; }

 private:
  std::map<std::string, double> worst_;
};

class BlendShader : public ::testing::TestWithParam<std::string> {};

INSTANTIATE_TEST_SUITE_P(Languages, BlendShader, ::testing::ValuesIn(shader_languages()),
                         [](const auto& test) { return test.param; });

TEST_P(BlendShader, TextMakesTheSlabsOfTheRules) {
  for (std::uint64_t seed = 0; seed < 3; ++seed) {
    const FittedBlend::Constants<double> constants = random_constants(60 + seed);
    TextInterpreter interpreter(blend_shader(GetParam(), constants, {}));
    for (const Rule& rule : rules()) {
      Differences differences;
      for (const SlabPair& pair : slab_pairs(100, 70 + seed)) {
        const SlabValues truth = rule.in_double(pair, constants);
        TextInterpreter::Variables variables{{"foreground_share", {pair.share}}, {"cos_theta_o", {pair.cos_theta_o}}};
        each_member(pair.first, pair.second, [&](const ParameterInfo& info, const auto& first, const auto& second) {
          variables[rule.slabs[0] + "." + std::string(info.name)] = first;
          variables[rule.slabs[1] + "." + std::string(info.name)] = second;
        });
        const TextInterpreter::Variables out = interpreter.members(rule.function, variables);
        SlabValues slab{};
        Slab::describe(slab, [&](auto& member, const ParameterInfo& info) {
          const ShaderValue& value = out.at("p." + std::string(info.name));
          if constexpr (is_vector<std::remove_cvref_t<decltype(member)>>) {
            member = {value.at(0), value.at(1), value.at(2)};
          } else {
            member = value.at(0);
          }
        });
        differences.add(pair, truth, slab);
      }
      // Literals and constants are printed in float precision.
      for (const auto& [name, worst] : differences.worst()) EXPECT_LE(worst, 1e-6) << rule.function << ": " << name;
    }
  }
}

TEST(BlendRules, FloatStaysNearDouble) {
  for (std::uint64_t seed = 0; seed < 3; ++seed) {
    const FittedBlend::Constants<double> constants = seed == 0 ? FittedBlend::initial() : random_constants(60 + seed);
    for (const Rule& rule : rules()) {
      Differences differences;
      for (const SlabPair& pair : slab_pairs(1000, 80 + seed)) {
        differences.add(pair, rule.in_double(pair, constants), rule.in_float(pair, constants));
      }
      for (const auto& [name, worst] : differences.worst()) {
        // Worst where a metal that hardly lets light out lies on top, with a medium that hardly absorbs it.
        EXPECT_LE(worst, name == "diffuse_albedo" ? 5e-4 : 5e-5) << rule.function << ": " << name;
      }
    }
  }
}

TEST_P(BlendShader, StatesItsConstants) {
  const FittedBlend::Constants<double> constants = random_constants(90);
  TextInterpreter interpreter(blend_shader(GetParam(), constants, {}));
  const TextInterpreter::Variables members = interpreter.members("Lobefit_Blend_Fitted");
  FittedBlend::describe(constants, [&](const double& member, const ParameterInfo& info) {
    EXPECT_FLOAT_EQ(static_cast<float>(members.at("p." + std::string(info.name)).at(0)), static_cast<float>(member));
  });
  const std::array<std::string, 2> provenance{"Fitted to pairs.", "Residual .04."};
  const std::string text = blend_shader(GetParam(), constants, provenance);
  EXPECT_NE(text.find("// Fitted to pairs.\n// Residual .04.\n"), std::string::npos);
}

TEST_P(BlendShader, IsAcceptedByAShaderCompiler) {
  if (!has_shader_compiler(GetParam())) {
    GTEST_SKIP() << no_shader_compiler;
  }
  const std::string blends = blend_shader(GetParam(), FittedBlend::initial(), {});
  std::vector<ShaderParameter> parameters;
  for (const ParameterInfo& info : describe_parameters<Slab>()) {
    parameters.push_back({info, std::vector<double>(static_cast<std::size_t>(info.components), info.initial), ""});
  }
  const std::string slab = print_shader(find_float_model("slab").trace(), GetParam(), Slab::info, parameters, {});
  const std::string one = "Lobefit_slab_Fitted()";
  for (const Rule& rule : rules()) {
    if (GetParam() == "wgsl") break;  // without a preprocessor a text stands alone
    const std::string share = rule.slabs[0] == "background" ? ", 0.25" : "";
    const std::string blend = rule.function + "(" + one + ", " + one + share + ", 0.5)";
    // With the slab's own shader, before it and after it.
    const std::string shaded = "Lobefit_slab(" + vector_text(GetParam(), "0.6", "0.0", "0.8") + ", " +
                               vector_text(GetParam(), "0.0", "0.0", "1.0") + ", " + blend + ")";
    EXPECT_EQ(shader_complaint(GetParam(), blends + slab, shaded, rule.function), "");
    EXPECT_EQ(shader_complaint(GetParam(), slab + blends, shaded, rule.function), "");
  }
  // And alone.
  const std::string struct_type = "Lobefit_slab_Parameters";
  const std::string head = GetParam() == "wgsl" ? "fn Middle(a: " + struct_type + ") -> " + struct_type
                                                : struct_type + " Middle(" + struct_type + " a)";
  const std::string middle = head + " { return Lobefit_BlendVertical(a, a, 0.5); }\n";
  EXPECT_EQ(shader_complaint(GetParam(), blends + middle, vector_text(GetParam(), "0.0", "0.0", "0.0"), "blends"), "");
}

TEST(BlendRules, UnknownLanguageIsAUsageError) {
  try {
    blend_shader("cg", FittedBlend::initial(), {});
    FAIL() << "no error was thrown";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::usage);
  }
}

}  // namespace
}  // namespace lobefit
