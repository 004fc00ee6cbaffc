// The port's GBuffer: bytes and layout against S0's listing and Direct3D's rules, losses against what was put in,
// errors against sums of their own.

#include "evaluate/gbuffer_material.h"

#include <gtest/gtest.h>
#include <rapidcheck.h>
#include <rapidcheck/gtest.h>

#include <limits>
#include <map>
#include <set>

#include "evaluate/gbuffer_error.h"
#include "evaluate/metallic_surface.h"
#include "reference/srgb.h"
#include "reference/table_model.h"
#include "tests/directions.h"

namespace lobefit {
namespace {

constexpr std::string_view port = gbuffer_model;

const GBufferParameter& row(const GBufferMaterial& material, std::string_view name) {
  return *std::ranges::find(material.parameters, name, &GBufferParameter::name);
}

/// Amount of a kind of loss, 0 where there is none.
double loss(const GBufferParameter& parameter, GBufferLossKind kind) {
  const auto found = std::ranges::find(parameter.losses, kind, &GBufferLoss::kind);
  return found != parameter.losses.end() ? found->amount : 0.0;
}

/// All that is said of them.
std::string words(const GBufferParameter& parameter) {
  std::string all;
  for (const GBufferLoss& each : parameter.losses) all += each.words + "; ";
  return all;
}

ParameterValues with(std::string_view model,
                     std::initializer_list<std::pair<std::string_view, std::vector<double>>> set) {
  ParameterValues values = find_model(model).defaults();
  for (const auto& [name, value] : set) values.set(name, value);
  return values;
}

/// All fields hold the same byte, but for Metallic.
GBufferPixel filled(std::uint8_t byte) {
  GBufferPixel pixel;
  for (const GBufferField& field : gbuffer_fields()) {
    if (field.parameter != "metallic") std::ranges::fill(field.bytes(pixel), byte);
  }
  return pixel;
}

/// IEC 61966-2-1 in extended precision.
long double iec_decode(long double code) {
  return code <= 0.04045L ? code / 12.92L : std::pow((code + 0.055L) / 1.055L, 2.4L);
}

/// What doubles leave of srgb_decode, relative: five roundings of half an ulp in the base, times 2.4, and the power's.
constexpr double srgb_rounding = (5 * 2.4 + 2) * 0.5 * std::numeric_limits<double>::epsilon();

TEST(Srgb, IsTheStandards) {
  // Bytes decoded in 30 digits.
  for (const auto& [byte, linear] : std::initializer_list<std::pair<int, double>>{{1, 3.0352698354883749165e-4},
                                                                                  {10, 3.0352698354883749165e-3},
                                                                                  {11, 3.3465357638991584998e-3},
                                                                                  {50, 0.031896033073011515951},
                                                                                  {128, 0.21586050011389916376},
                                                                                  {188, 0.50288645803256838517},
                                                                                  {254, 0.9911020971138296993}}) {
    EXPECT_NEAR(srgb_decode(byte / 255.0), linear, srgb_rounding * linear) << byte;
  }
  EXPECT_EQ(srgb_decode(0.0), 0.0);
  EXPECT_EQ(srgb_decode(1.0), 1.0);
  EXPECT_EQ(srgb_encode(0.0), 0.0);
  EXPECT_NEAR(srgb_encode(1.0), 1.0, 1e-15);
  // The standard's two branches meet at .0031308 within 3e-8, so its functions are inverse within that.
  for (int k = 0; k <= 1000; ++k) EXPECT_NEAR(srgb_encode(srgb_decode(k / 1000.0)), k / 1000.0, 4e-8) << k;
}

TEST(GBuffer, LayoutIsThatOfTheListing) {
  // S0, "GBuffer Unpacking (CallistoBxDF)", and the engine's own five.
  const std::map<std::string, std::pair<std::string, std::string>> expected{
      {"specular_fresnel_falloff", {"CustomData.r", "GBufferD.r"}},
      {"retroreflection", {"CustomData.g", "GBufferD.g"}},
      {"terminator_length", {"CustomData.b", "GBufferD.b"}},
      {"diffuse_fresnel_falloff", {"CustomData.a", "GBufferD.a"}},
      {"diffuse_fresnel", {"Anisotropy", "GBufferF.a"}},
      {"retroreflection_falloff", {"GBufferAO", "GBufferC.a"}},
      {"albedo", {"BaseColor", "GBufferC.rgb"}},
      {"roughness", {"Roughness", "GBufferB.b"}},
      {"f0", {"Specular", "GBufferB.g"}},
      {"metallic", {"Metallic", "GBufferB.r"}}};
  EXPECT_EQ(gbuffer_fields().size(), expected.size());
  std::set<std::pair<GBufferTexture, std::size_t>> taken;
  for (const GBufferField& field : gbuffer_fields()) {
    const auto& [engine_name, place] = expected.at(std::string(field.parameter));
    EXPECT_EQ(field.engine_name, engine_name);
    EXPECT_EQ(field.place(), place);
    EXPECT_EQ(field.srgb, field.parameter == "albedo");
    for (std::size_t c = 0; c < field.components; ++c)
      EXPECT_TRUE(taken.insert({field.texture, field.channel + c}).second) << "two parameters in " << place;
  }
}

TEST(GBuffer, ReadsBackAsTheListingDoes) {
  for (int b = 0; b <= 255; ++b) {
    GBufferPixel pixel;
    // A different byte for each, so that no two can change places.
    const auto byte = [&](int k) { return static_cast<std::uint8_t>((b + 29 * k) % 256); };
    for (int t = 0; t < 4; ++t) {
      for (int c = 0; c < 4; ++c)
        pixel.bytes[static_cast<std::size_t>(t)][static_cast<std::size_t>(c)] = byte(4 * t + c);
    }
    const ParameterValues read = unpack_gbuffer(pixel);
    const auto unorm = [&](GBufferTexture texture, int c) { return byte(4 * static_cast<int>(texture) + c) / 255.0L; };
    const auto expect = [&](std::string_view name, long double value) {
      EXPECT_NEAR(read.get(name), static_cast<double>(value), 4e-16 * std::max(1.0, static_cast<double>(value)))
          << name;
    };
    expect("terminator_length", unorm(GBufferTexture::d, 2));
    expect("diffuse_fresnel", unorm(GBufferTexture::f, 3) * 256.0L);
    expect("diffuse_fresnel_falloff", unorm(GBufferTexture::d, 3));
    expect("retroreflection", unorm(GBufferTexture::d, 1));
    expect("retroreflection_falloff", unorm(GBufferTexture::c, 3));
    expect("specular_fresnel_falloff", unorm(GBufferTexture::d, 0));
    expect("roughness", unorm(GBufferTexture::b, 2));
    const std::span<const double> albedo = read.components(read.info("albedo")), f0 = read.components(read.info("f0"));
    const long double metallic = unorm(GBufferTexture::b, 0), specular = unorm(GBufferTexture::b, 1);
    for (int c = 0; c < 3; ++c) {
      const auto slot = static_cast<std::size_t>(c);
      const long double base_color = iec_decode(unorm(GBufferTexture::c, c));
      // The engine's DecodeGBufferData: BaseColor - BaseColor Metallic, and lerp(.08 Specular, BaseColor, Metallic).
      EXPECT_NEAR(albedo[slot], static_cast<double>(base_color - base_color * metallic), srgb_rounding + 4e-16);
      EXPECT_NEAR(f0[slot], static_cast<double>(0.08L * specular + metallic * (base_color - 0.08L * specular)),
                  srgb_rounding + 4e-16);
    }
    // Hard-coded in the listing.
    for (const char* name : {"diffuse_fresnel_tangent_falloff", "retroreflection_tangent_falloff"})
      EXPECT_EQ(read.get(name), 0.75);
    for (const char* name : {"diffuse_fresnel_tint", "retroreflection_tint"}) EXPECT_EQ(read.get(name), 1.0);
    EXPECT_EQ(read.get("terminator_tint"), 0.5);
  }
}

TEST(GBuffer, EveryByteOfEveryFieldComesBackBitForBit) {
  for (int b = 0; b <= 255; ++b) {
    const auto byte = static_cast<std::uint8_t>(b);
    for (const GBufferField& field : gbuffer_fields())
      EXPECT_EQ(field.encode(field.decode(byte)), byte) << field.parameter;
    const GBufferPixel pixel = filled(byte);
    const ParameterValues values = unpack_gbuffer(pixel);
    const GBufferMaterial material = gbuffer_material(values);
    EXPECT_EQ(material.pixel, pixel);
    EXPECT_TRUE(std::ranges::equal(material.port.flat(), values.flat()));
    EXPECT_TRUE(std::ranges::equal(material.decoded.flat(), values.flat()));
    for (const GBufferParameter& parameter : material.parameters) {
      EXPECT_TRUE(parameter.losses.empty()) << parameter.name << ": " << words(parameter);
      EXPECT_EQ(parameter.decoded, parameter.value) << parameter.name;
    }
    EXPECT_TRUE(material.formula.empty());
  }
}

TEST(GBuffer, AlphaOfABytesRoughnessSurvivesBitForBit) {
  for (int b = 0; b <= 255; ++b) {
    const double alpha = (b / 255.0) * (b / 255.0);
    const GBufferMaterial material = gbuffer_material(with("callisto", {{"alpha", {alpha}}}));
    EXPECT_EQ(row(material, "alpha").bytes, std::vector<std::uint8_t>{static_cast<std::uint8_t>(b)});
    EXPECT_EQ(row(material, "alpha").decoded, std::vector{alpha});
    EXPECT_TRUE(row(material, "alpha").losses.empty());
    EXPECT_EQ(material.decoded.get("roughness"), b / 255.0);
  }
}

RC_GTEST_PROP(GBuffer, BytesAreTheNearest, ()) {
  const GBufferField& field = gbuffer_fields()[*rc::gen::inRange<std::size_t>(0, gbuffer_fields().size())];
  const double value = field.full * *rc::gen::inRange(0, 1 << 24) / static_cast<double>((1 << 24) - 1);
  // In the code that is stored: linear, or sRGB's.
  const auto code = [&](long double x) {
    x /= field.full;
    if (!field.srgb) return x;
    return x <= 0.0031308L ? 12.92L * x : 1.055L * std::pow(x, 1.0L / 2.4L) - 0.055L;
  };
  const long double exact = 255.0L * code(value);
  // A tie in the last bits may go either way.
  RC_ASSERT(std::abs(field.encode(value) - exact) <= 0.5L + 1e-12L);
}

TEST(GBuffer, RoundsAtTheMiddle) {
  const GBufferField& falloff = *std::ranges::find(gbuffer_fields(), "terminator_length", &GBufferField::parameter);
  for (int b = 0; b < 255; ++b) {
    EXPECT_EQ(falloff.encode((b + 0.4999) / 255.0), b);
    EXPECT_EQ(falloff.encode((b + 0.5001) / 255.0), b + 1);
  }
  EXPECT_EQ(falloff.encode(-1.0), 0);
  EXPECT_EQ(falloff.encode(2.0), 255);
  const GBufferMaterial material = gbuffer_material(with(port, {{"terminator_length", {0.3}}}));
  const GBufferParameter& length = row(material, "terminator_length");
  EXPECT_EQ(length.bytes, std::vector<std::uint8_t>{77});  // 76.5 rounds up
  EXPECT_NEAR(loss(length, GBufferLossKind::quantised), 0.5 / 255.0, 1e-12);
}

TEST(GBuffer, DiffuseFresnelIsStoredInStepsOfMoreThanOne) {
  // 255/256 of a step: the default 1 comes back as 256/255, and everything below 128/255 as 0.
  const auto decoded = [](double value) {
    return gbuffer_material(with(port, {{"diffuse_fresnel", {value}}})).decoded.get("diffuse_fresnel");
  };
  EXPECT_EQ(decoded(1.0), 256.0 * (1 / 255.0));
  EXPECT_EQ(decoded(0.5), 0.0);
  EXPECT_EQ(decoded(0.503), 256.0 * (1 / 255.0));
  EXPECT_EQ(decoded(256.0), 256.0);
  const GBufferMaterial material = gbuffer_material(with(port, {{"diffuse_fresnel", {0.25}}}));
  EXPECT_EQ(loss(row(material, "diffuse_fresnel"), GBufferLossKind::quantised), 0.25);
  EXPECT_NE(words(row(material, "diffuse_fresnel")).find("steps of 1"), std::string::npos);
}

TEST(GBuffer, WhatIsOutOfRangeIsClampedAndSaidSo) {
  const GBufferMaterial material = gbuffer_material(with(port, {{"retroreflection", {1.75}}, {"f0", {0.125}}}));
  const GBufferParameter &retro = row(material, "retroreflection"), &f0 = row(material, "f0");
  EXPECT_EQ(retro.decoded, std::vector{1.0});
  EXPECT_EQ(loss(retro, GBufferLossKind::clamped), 0.75);
  EXPECT_EQ(loss(retro, GBufferLossKind::quantised), 0.0);
  EXPECT_NE(words(retro).find("1.75 clamped to 1"), std::string::npos) << words(retro);
  EXPECT_EQ(f0.decoded, std::vector{0.08});
  EXPECT_NEAR(loss(f0, GBufferLossKind::clamped), 0.045, 1e-16);
  EXPECT_NE(words(f0).find("0.125 clamped to 0.08"), std::string::npos) << words(f0);
  // Unstored, nothing is clamped.
  EXPECT_EQ(material.port.get("retroreflection"), 1.75);
  EXPECT_EQ(material.port.get("f0"), 0.125);
}

TEST(GBuffer, ColouredF0BecomesItsMean) {
  const GBufferMaterial material = gbuffer_material(with("callisto", {{"f0", {0.02, 0.04, 0.0}}}));
  const GBufferParameter& f0 = row(material, "f0");
  EXPECT_NEAR(loss(f0, GBufferLossKind::grey), 0.02, 1e-16);
  EXPECT_EQ(f0.bytes, std::vector<std::uint8_t>{64});  // 255 × .02/.08 = 63.75
  EXPECT_EQ(f0.decoded.size(), 1u);
  EXPECT_NEAR(f0.decoded[0], 0.08 * 64 / 255.0, 1e-17);
  EXPECT_NEAR(loss(f0, GBufferLossKind::quantised), 0.08 * 0.25 / 255.0, 1e-16);
  EXPECT_EQ(loss(f0, GBufferLossKind::clamped), 0.0);
  // The port's own formula has a coloured f0.
  EXPECT_EQ(material.port.components(material.port.info("f0"))[1], 0.04);
}

TEST(GBuffer, TintsGoIntoTheIntensityAsTheirMean) {
  const GBufferMaterial tinted =
      gbuffer_material(with("callisto", {{"retroreflection", {0.75}}, {"retroreflection_tint", {1.0, 0.5, 0.0}}}));
  EXPECT_NEAR(tinted.port.get("retroreflection"), 0.375, 1e-16);
  EXPECT_EQ(tinted.port.get("retroreflection_tint"), 1.0);
  EXPECT_NEAR(loss(row(tinted, "retroreflection_tint"), GBufferLossKind::dropped), 0.375, 1e-16);
  EXPECT_EQ(row(tinted, "retroreflection_tint").field, nullptr);
  // A grey tint is but another intensity.
  const GBufferMaterial grey =
      gbuffer_material(with("callisto", {{"retroreflection", {1.5}}, {"retroreflection_tint", {0.4}}}));
  EXPECT_EQ(grey.port.get("retroreflection"), 1.5 * 0.4);
  EXPECT_TRUE(row(grey, "retroreflection_tint").losses.empty());
  EXPECT_EQ(loss(row(grey, "retroreflection"), GBufferLossKind::clamped), 0.0);
}

TEST(GBuffer, ADroppedTerminatorIsNamed) {
  const auto pack = [](double terminator, std::vector<double> tint) {
    return gbuffer_material(
        with("callisto",
             {{"terminator", {terminator}}, {"terminator_tint", std::move(tint)}, {"terminator_length", {0.8}}}));
  };
  const GBufferMaterial strong = pack(0.9, {1.0});
  EXPECT_EQ(row(strong, "terminator").field, nullptr);
  EXPECT_EQ(row(strong, "terminator").decoded, std::vector{0.5});
  EXPECT_NEAR(loss(row(strong, "terminator"), GBufferLossKind::dropped), 0.4, 1e-16);
  EXPECT_NE(words(row(strong, "terminator")).find("always has weight 0.5"), std::string::npos);
  EXPECT_EQ(strong.port.get("terminator_length"), 0.8);
  // The one weight that the port has.
  EXPECT_TRUE(row(pack(0.5, {1.0}), "terminator").losses.empty());
  EXPECT_TRUE(row(pack(1.0, {0.5}), "terminator").losses.empty());
  // Farther from a channel of another tint.
  EXPECT_NEAR(loss(row(pack(1.0, {0.5, 0.5, 0.3}), "terminator"), GBufferLossKind::dropped), 0.2, 1e-16);
  // Off, or brightening: the port's is made as short as it gets, its length unlike its weight being free.
  for (const double weak : {0.0, -0.7, 0.2}) {
    const GBufferMaterial off = pack(weak, {1.0});
    EXPECT_EQ(off.port.get("terminator_length"), 0.0) << weak;
    EXPECT_FALSE(row(off, "terminator_length").remark.empty());
    EXPECT_NEAR(loss(row(off, "terminator"), GBufferLossKind::dropped), 0.5 - weak, 1e-16);
  }
  EXPECT_EQ(pack(0.3, {1.0}).port.get("terminator_length"), 0.8);
}

TEST(GBuffer, WithoutTerminatorLengthZeroIsTheNearer) {
  // The choice itself, as error: c2 of weight w against weight ½ with the material's length and with none.
  const Table table = [] {
    Table grid = gbuffer_directions();
    grid.grid = Grid::named_or_file("small");
    grid.allocate();
    return grid;
  }();
  const std::vector<double> weights = entry_weights(table, {}, Quantity::cosine);
  for (const double weight : {0.0, 0.15, 0.24, 0.26, 0.4, 1.0}) {
    const ParameterValues values =
        with(port, {{"terminator_tint", {weight}}, {"terminator_length", {0.8}}, {"f0", {0.0}}});
    const auto distance = [&](double length) {
      GBufferMaterial material = gbuffer_material(values);
      material.port.set("terminator_length", length);
      return gbuffer_error(values, material, table, weights, true).port_from_fit[0];
    };
    const bool none = gbuffer_material(values).port.get("terminator_length") == 0.0;
    EXPECT_EQ(none, distance(0.0) < distance(0.8)) << weight;
  }
}

TEST(GBuffer, WhatHasNoFieldIsDropped) {
  const GBufferMaterial material = gbuffer_material(with("callisto", {{"diffuse_fresnel_tangent_falloff", {0.25}},
                                                                      {"dual_specular_opacity", {0.4}},
                                                                      {"dual_specular_roughness_scale", {2.0}}}));
  EXPECT_EQ(loss(row(material, "diffuse_fresnel_tangent_falloff"), GBufferLossKind::dropped), 0.5);
  EXPECT_EQ(row(material, "diffuse_fresnel_tangent_falloff").decoded, std::vector{0.75});
  EXPECT_TRUE(row(material, "retroreflection_tangent_falloff").losses.empty());
  EXPECT_EQ(loss(row(material, "dual_specular_opacity"), GBufferLossKind::dropped), 0.4);
  EXPECT_TRUE(row(material, "dual_specular_roughness_scale").losses.empty());
  EXPECT_EQ(material.formula.size(), 2u);
  EXPECT_EQ(gbuffer_material(with("callisto_lambert", {})).formula.size(), 3u);
  // Every parameter has its row, in the model's order.
  const std::vector<ParameterInfo>& list = find_model("callisto").parameters;
  ASSERT_EQ(material.parameters.size(), list.size());
  for (std::size_t k = 0; k < list.size(); ++k) EXPECT_EQ(material.parameters[k].name, list[k].name);
}

TEST(GBuffer, StaticLightingTakesTheRetroreflectionFalloff) {
  const ParameterValues values = with(port, {{"retroreflection_falloff", {0.2}}, {"retroreflection", {0.4}}});
  const GBufferMaterial without = gbuffer_material(values), lit = gbuffer_material(values, {.static_lighting = true});
  EXPECT_EQ(without.decoded.get("retroreflection_falloff"), 51 / 255.0);
  EXPECT_EQ(lit.decoded.get("retroreflection_falloff"), 1.0);
  EXPECT_EQ(row(lit, "retroreflection_falloff").field, nullptr);
  EXPECT_NEAR(loss(row(lit, "retroreflection_falloff"), GBufferLossKind::dropped), 0.8, 1e-16);
  EXPECT_EQ(lit.port.get("retroreflection_falloff"), 0.2);
  GBufferPixel expected = without.pixel;
  expected.bytes[static_cast<std::size_t>(GBufferTexture::c)][3] = 0;
  EXPECT_EQ(lit.pixel, expected);
}

TEST(MetallicSurface, ADielectricAndAMetalAreTheirOwnNearest) {
  const MetallicSurface metal = MetallicSurface::nearest({0.0, 0.0, 0.0}, {0.9, 0.6, 0.2});
  EXPECT_EQ(metal.metallic, 1.0);
  EXPECT_EQ(metal.base_color, (MetallicSurface::Color{0.9, 0.6, 0.2}));
  EXPECT_EQ(metal.f0(), metal.base_color);
  EXPECT_EQ(metal.albedo(), (MetallicSurface::Color{}));
  const MetallicSurface dielectric = MetallicSurface::nearest({0.7, 0.2, 0.1}, {0.05, 0.05, 0.05});
  EXPECT_EQ(dielectric.metallic, 0.0);
  EXPECT_EQ(dielectric.base_color, (MetallicSurface::Color{0.7, 0.2, 0.1}));
  EXPECT_NEAR(dielectric.dielectric_f0, 0.05, 1e-16);
  const MetallicSurface plain{.base_color = {0.7, 0.2, 0.1}, .dielectric_f0 = 0.05};
  EXPECT_EQ(plain.albedo(), plain.base_color);
  EXPECT_EQ(plain.f0(), (MetallicSurface::Color{0.05, 0.05, 0.05}));
}

double distance(const MetallicSurface& surface, const MetallicSurface::Color& albedo,
                const MetallicSurface::Color& f0) {
  double sum = 0.0;
  for (std::size_t c = 0; c < 3; ++c) sum += square(surface.albedo()[c] - albedo[c]) + square(surface.f0()[c] - f0[c]);
  return sum;
}

TEST(MetallicSurface, NoOtherSurfaceIsNearer) {
  UniformNumbers uniform(3);
  for (int sample = 0; sample < 40; ++sample) {
    MetallicSurface::Color albedo, f0;
    // f0 of dielectrics and metals alike.
    const double most = sample % 2 == 0 ? 0.2 : 1.0;
    for (std::size_t c = 0; c < 3; ++c) albedo[c] = uniform(), f0[c] = most * uniform();
    const double found = distance(MetallicSurface::nearest(albedo, f0), albedo, f0);
    // All over the place, then closer and closer around the best of them.
    MetallicSurface best{.metallic = 0.5};
    for (int trial = 0; trial < 20000; ++trial) {
      const double reach = std::pow(2.0, -trial / 1500);
      MetallicSurface other = best;
      other.metallic = std::round(255.0 * std::clamp(best.metallic + reach * uniform.between(-1, 1), 0.0, 1.0)) / 255.0;
      other.dielectric_f0 = std::clamp(best.dielectric_f0 + 0.08 * reach * uniform.between(-1, 1), 0.0, 0.08);
      for (double& x : other.base_color) x = std::clamp(x + reach * uniform.between(-1, 1), 0.0, 1.0);
      if (distance(other, albedo, f0) < distance(best, albedo, f0)) best = other;
    }
    // What more metallic has to bring is 1e-10.
    EXPECT_LE(found, distance(best, albedo, f0) + 1e-10) << sample;
    // The search is no straw man.
    EXPECT_LE(distance(best, albedo, f0), found + 0.01) << sample;
  }
}

TEST(GBuffer, MetallicCarriesAColouredF0) {
  // Nearly a metal: base colour takes over, and f0 survives within a byte or two.
  const ParameterValues values = with(port, {{"albedo", {0.02, 0.0, 0.0}}, {"f0", {0.05, 0.1, 0.4}}});
  const GBufferMaterial plain = gbuffer_material(values), metal = gbuffer_material(values, {.metallic = true});
  EXPECT_NEAR(loss(row(plain, "f0"), GBufferLossKind::clamped), 0.55 / 3.0 - 0.08, 1e-15);
  EXPECT_GT(metal.pixel.bytes[static_cast<std::size_t>(GBufferTexture::b)][0], 240);
  EXPECT_LT(loss(row(metal, "f0"), GBufferLossKind::shared), 0.005);
  EXPECT_LT(loss(row(metal, "albedo"), GBufferLossKind::shared), 0.021);
  EXPECT_EQ(loss(row(metal, "f0"), GBufferLossKind::clamped), 0.0);
  EXPECT_NE(words(row(metal, "f0")).find("Metallic"), std::string::npos);
  EXPECT_TRUE(std::ranges::equal(plain.port.flat(), metal.port.flat()));
  // A dielectric has no use for it.
  const ParameterValues leaf = with(port, {{"albedo", {0.1, 0.3, 0.05}}, {"f0", {0.043}}});
  EXPECT_EQ(gbuffer_material(leaf, {.metallic = true}).pixel, gbuffer_material(leaf).pixel);
  EXPECT_GT(loss(row(gbuffer_material(leaf, {.metallic = true}), "f0"), GBufferLossKind::quantised), 0.0);
}

TEST(GBuffer, OtherModelsAreRefused) {
  const auto expect_refused = [](const auto& act) {
    try {
      act();
      ADD_FAILURE() << "no error";
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ExitCode::usage);
      EXPECT_NE(std::string(error.what()).find("callisto_ue427"), std::string::npos);
    }
  };
  expect_refused([] { gbuffer_material(find_model("eon").defaults()); });
  expect_refused([] { pack_gbuffer(find_model("callisto").defaults()); });
}

/// A grid of few angles, values of `truth` on it, or none.
Table table_of(const ParameterValues& truth) {
  Table table;
  table.grid = Grid::named_or_file("small");
  table.channels = 3;
  table.allocate();
  return TableModel(find_model(truth.owner()), truth, table).render();
}

TEST(GBufferError, RepresentableParametersLoseNothing) {
  // Bytes apart from each other, none at an end.
  GBufferPixel pixel = filled(0);
  std::uint8_t byte = 23;
  for (const GBufferField& field : gbuffer_fields()) {
    if (field.parameter == "metallic") continue;
    for (std::uint8_t& stored : field.bytes(pixel)) {
      stored = byte;
      byte = static_cast<std::uint8_t>(byte + 19);
    }
  }
  const ParameterValues values = unpack_gbuffer(pixel);
  const GBufferMaterial material = gbuffer_material(values);
  const Table table = table_of(with("callisto", {{"terminator", {0.3}}}));
  const std::vector<double> weights = entry_weights(table, {WeightFactor::sin_theta_i}, Quantity::log);
  const GBufferError error = gbuffer_error(values, material, table, weights, false);
  EXPECT_EQ(error.against_table->packed, error.against_table->port);
  EXPECT_EQ(error.against_table->port, error.against_table->fit);
  EXPECT_EQ(error.packed_from_fit, QuantityErrors{});
  EXPECT_EQ(error.alone, std::vector<double>(material.parameters.size(), 0.0));
  for (std::size_t q = 0; q < quantity_names.size(); ++q) EXPECT_GT(error.against_table->fit[q], 0.0);
}

TEST(GBufferError, IsTheSumOfItsDifferences) {
  const ParameterValues values = with("callisto", {{"albedo", {0.31, 0.52, 0.73}},
                                                   {"alpha", {0.3}},
                                                   {"retroreflection", {1.6}},
                                                   {"terminator", {0.8}},
                                                   {"f0", {0.11}}});
  const GBufferMaterial material = gbuffer_material(values);
  const Table table = table_of(with("callisto_lambert", {{"albedo", {0.4}}}));
  const std::vector<double> weights = entry_weights(table, {WeightFactor::cos_theta_o}, Quantity::cosine);
  const GBufferError error = gbuffer_error(values, material, table, weights, false);
  const auto sum = [&](const ParameterValues& a, const ParameterValues* b) {
    double squares = 0.0;
    for (std::size_t entry = 0; entry < table.entries(); ++entry) {
      const Direction wi = table.wi(entry), wo = table.wo(entry);
      const auto f = [&](const ParameterValues& p) { return find_model(p.owner()).evaluate(p.flat(), wi, wo); };
      const Rgb left = f(a),
                right = b ? f(*b) : Rgb{table.value(entry, 0), table.value(entry, 1), table.value(entry, 2)};
      const Rgb d = left - right;
      squares += weights[entry] * square(pi * wi.z) * (d.x * d.x + d.y * d.y + d.z * d.z) / 3.0;
    }
    return std::sqrt(squares);
  };
  // Tables are float: 1e-6 of values up to some 10.
  const double tolerance = 1e-5;
  EXPECT_NEAR(error.against_table->fit[0], sum(values, nullptr), tolerance);
  EXPECT_NEAR(error.against_table->port[0], sum(material.port, nullptr), tolerance);
  EXPECT_NEAR(error.against_table->packed[0], sum(material.decoded, nullptr), tolerance);
  EXPECT_NEAR(error.port_from_fit[0], sum(material.port, &values), tolerance);
  EXPECT_NEAR(error.packed_from_port[0], sum(material.decoded, &material.port), tolerance);
  EXPECT_NEAR(error.packed_from_fit[0], sum(material.decoded, &values), tolerance);
  EXPECT_GT(error.port_from_fit[0], 100.0 * tolerance);
  EXPECT_GT(error.packed_from_port[0], 100.0 * tolerance);
}

TEST(GBufferError, OneParameterAloneIsAllWhereOnlyItIsLost) {
  // Everything but retroreflection is a byte's value.
  ParameterValues values = unpack_gbuffer(filled(100));
  values.set("retroreflection", 3.0);
  const GBufferMaterial material = gbuffer_material(values);
  Table table = gbuffer_directions();
  table.grid = Grid::named_or_file("small");
  table.allocate();
  const GBufferError error = gbuffer_error(values, material, table, entry_weights(table, {}, Quantity::log), true);
  EXPECT_FALSE(error.against_table);
  const double all = error.packed_from_port[static_cast<std::size_t>(Quantity::log)];
  EXPECT_GT(all, 1e-3);
  for (std::size_t k = 0; k < material.parameters.size(); ++k) {
    const bool is_it = material.parameters[k].name == "retroreflection";
    // Added up in another order.
    EXPECT_NEAR(error.alone[k], is_it ? all : 0.0, is_it ? 1e-12 * all : 0.0);
  }
}

}  // namespace
}  // namespace lobefit
