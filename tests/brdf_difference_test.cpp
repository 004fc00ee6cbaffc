// Every metric of two BRDFs against closed forms, under refinement, on each kind of table, and on measured data.
#include "reference/brdf_difference.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>
#include <cstdlib>
#include <functional>

#include "models/error.h"
#include "reference/albedo.h"
#include "reference/formats/brdf_file.h"
#include "reference/half_vector_rule.h"
#include "tests/directions.h"

namespace lobefit {
namespace {

using Brdf = std::function<double(const Direction& wi, const Direction& wo)>;

Brdf lambert(double albedo) {
  return [=](const Direction&, const Direction&) { return albedo / pi; };
}

Axis points(const std::string& name, int count, double last) {
  Axis axis{name, "degree", {}, false};
  for (int k = 0; k < count; ++k) axis.values.push_back(count == 1 ? 0.0 : k * last / (count - 1));
  return axis;
}

Axis midpoints(const std::string& name, int count, double last) {
  Axis axis{name, "degree", {}, true};
  for (int k = 0; k < count; ++k) axis.values.push_back((k + 0.5) * last / count);
  return axis;
}

Grid cells(int thetas, int phis) {
  return {midpoints("theta_i", thetas, 90.0), midpoints("theta_o", thetas, 90.0), midpoints("phi", phis, 180.0)};
}

/// Bins over half and difference angles, masked where a direction lies under the surface.
Table rusinkiewicz(int bins) {
  Table table;
  table.coordinates = Coordinates::rusinkiewicz;
  table.grid = {.theta_i = midpoints("theta_d", bins, 90.0),
                .theta_o = midpoints("theta_h", bins, 90.0),
                .phi = midpoints("phi_d", 2 * bins, 180.0)};
  table.allocate();
  for (std::size_t entry = 0; entry < table.entries(); ++entry) {
    table.valid[entry] = table.wi(entry).z > 0.0 && table.wo(entry).z > 0.0 ? 1 : 0;
  }
  return table;
}

/// All pairs of patches of two hemispheres, as in Klems' matrices.
Table patches(int rings, int sectors) {
  struct Patch {
    Direction middle;
    double solid_angle;
  };
  std::vector<Patch> all;
  for (int r = 0; r < rings; ++r) {
    const double low = 0.5 * pi * r / rings, high = 0.5 * pi * (r + 1) / rings;
    for (int s = 0; s < sectors; ++s) {
      all.push_back({direction(0.5 * (low + high), 2.0 * pi * (s + 0.5) / sectors),
                     (std::cos(low) - std::cos(high)) * 2.0 * pi / sectors});
    }
  }
  Table table;
  table.coordinates = Coordinates::list;
  table.grid = {.theta_i = {"block", "", {0.0}}, .theta_o = {"light", "", {}}, .phi = {"view", "", {}}};
  for (std::size_t k = 0; k < all.size(); ++k) {
    table.grid.theta_o.values.push_back(static_cast<double>(k));
    table.grid.phi.values.push_back(static_cast<double>(k));
  }
  table.allocate();
  for (std::size_t entry = 0; entry < table.entries(); ++entry) {
    const Patch &light = all[entry / all.size()], &view = all[entry % all.size()];
    table.set_directions(entry, light.middle, view.middle);
    table.measure[entry] = static_cast<float>(light.solid_angle * view.solid_angle);
  }
  return table;
}

Table on_grid(const Grid& grid) {
  Table table;
  table.grid = grid;
  table.allocate();
  return table;
}

std::vector<float> values_of(const Table& table, const Brdf& brdf) {
  std::vector<float> values(table.values.size());
  for (std::size_t entry = 0; entry < table.entries(); ++entry) {
    if (!table.valid[entry]) continue;
    const auto value = static_cast<float>(brdf(table.wi(entry), table.wo(entry)));
    for (int c = 0; c < table.channels; ++c) values[static_cast<std::size_t>(c) * table.entries() + entry] = value;
  }
  return values;
}

Table filled(Table table, const Brdf& brdf) {
  table.values = values_of(table, brdf);
  return table;
}

RowBrdf anywhere(const Brdf& brdf) {
  return [brdf](std::size_t, const Direction& wi, const Direction& wo) -> std::optional<Rgb> {
    const double f = wi.z > 0.0 && wo.z > 0.0 ? brdf(wi, wo) : 0.0;
    return Rgb{f, f, f};
  };
}

double rms(const BrdfDifference& difference, Quantity quantity) {
  return difference.rms[static_cast<std::size_t>(quantity)].solid_angle.value();
}

bool lacks(const BrdfDifference& difference, const std::string& metric) {
  return std::ranges::find(difference.not_formed, metric, &NotFormed::metric) != difference.not_formed.end();
}

TEST(BrdfDifference, OfTwoLambertsHasItsClosedForms) {
  constexpr double a = 0.8, b = 0.5;
  for (const Table& table :
       {on_grid(cells(40, 10)),
        on_grid({points("theta_i", 46, 90.0 - 1e-9), points("theta_o", 46, 90.0 - 1e-9), points("phi", 7, 180.0)})}) {
    const Table truth = filled(table, lambert(a));
    const std::vector<float> other = values_of(table, lambert(b));
    const BrdfDifference difference = brdf_difference({.table = &truth, .values = other});
    EXPECT_TRUE(difference.not_formed.empty());
    EXPECT_EQ(difference.entries, table.entries());
    constexpr double rounding = 1e-6;  // values are float
    EXPECT_NEAR(rms(difference, Quantity::brdf), a - b, rounding);
    EXPECT_NEAR(difference.rms[static_cast<std::size_t>(Quantity::brdf)].uniform, a - b, rounding);
    EXPECT_NEAR(difference.smape.uniform, (a - b) / (a + b), rounding);
    EXPECT_NEAR(difference.smape.solid_angle.value(), (a - b) / (a + b), rounding);
    EXPECT_NEAR(difference.bihemispherical->absolute, pi * (a - b), 4.0 * rounding);
    EXPECT_NEAR(difference.bihemispherical->relative.value(), (a - b) / a, rounding);
    EXPECT_NEAR(difference.albedo->absolute.worst, a - b, rounding);
    EXPECT_NEAR(difference.albedo->absolute.mean, a - b, rounding);
    EXPECT_NEAR(difference.albedo->relative->worst, (a - b) / a, rounding);
    EXPECT_NEAR(difference.albedo->relative->mean, (a - b) / a, rounding);
    EXPECT_EQ(difference.albedo->angles.size(), table.grid.theta_o.size());
    for (const AlbedoAtAngle& angle : difference.albedo->angles) {
      EXPECT_NEAR(angle.truth[0], a, rounding);
      EXPECT_NEAR(angle.other[0], b, rounding);
      EXPECT_NEAR(angle.coverage, 1.0, 1e-3);
    }
    // Over the solid angle the cosine is uniform on [0, 1]; the quadrature's own error is of second order.
    const double step = 1e-3;
    EXPECT_NEAR(rms(difference, Quantity::cosine), (a - b) / std::sqrt(3.0), step);
    // ∫ log(1 + kc) dc = ((1 + k) log(1 + k) - k)/k at k = albedo/π.
    const auto log_mean = [](double albedo) {
      const double k = albedo / pi;
      return (1.0 + k) * std::log1p(k) / k - 1.0;
    };
    EXPECT_NEAR(difference.mean_absolute_log.solid_angle.value(), log_mean(a) - log_mean(b), step);
    // (∫ c^(2/3) dc)^½ = √(3/5).
    EXPECT_NEAR(rms(difference, Quantity::cube_root), (std::cbrt(a / pi) - std::cbrt(b / pi)) * std::sqrt(0.6), step);
  }
}

TEST(BrdfDifference, ConvergesToItsIntegralsAsGridsRefine) {
  // f = 1/π against g = (1 + k cos θ_i)/π: over solid angle c = cos θ_i is uniform on [0, 1].
  constexpr double k = 0.6;
  const Brdf f = lambert(1.0), g = [](const Direction&wi, const Direction&) { return (1.0 + k * wi.z) / pi; };
  struct Case {
    const char* name;
    double truth;
    std::function<double(const BrdfDifference&)> found;
  };
  const std::vector<Case> cases{
      {"rms brdf", k / std::sqrt(3.0), [](const BrdfDifference& d) { return rms(d, Quantity::brdf); }},
      {"rms cosine", k / std::sqrt(5.0), [](const BrdfDifference& d) { return rms(d, Quantity::cosine); }},
      {"smape", 1.0 - 2.0 / k * std::log1p(0.5 * k),
       [](const BrdfDifference& d) { return d.smape.solid_angle.value(); }},
      {"bihemispherical", 2.0 * pi * k / 3.0, [](const BrdfDifference& d) { return d.bihemispherical->absolute; }},
      {"its share", 2.0 * k / 3.0, [](const BrdfDifference& d) { return d.bihemispherical->relative.value(); }},
      {"albedo", 2.0 * k / 3.0, [](const BrdfDifference& d) { return d.albedo->absolute.worst; }}};
  for (const Case& one : cases) {
    double previous = one.truth;
    for (const int count : {8, 16, 32}) {
      const Table truth = filled(on_grid(cells(count, 4)), f);
      const std::vector<float> other = values_of(truth, g);
      const double error = std::abs(one.found(brdf_difference({.table = &truth, .values = other})) - one.truth);
      EXPECT_LT(error, 0.3 * previous + 1e-7) << one.name << ": halving the step quarters the error";
      previous = error;
    }
    EXPECT_LT(previous, 1e-3 * one.truth) << one.name;
  }
}

TEST(BrdfDifference, MeetsTheMetricsThatFitsMinimise) {
  // On each kind of table the weighted means are those of entry_weights() and rms_difference().
  const Brdf f = [](const Direction& wi, const Direction& wo) { return 0.2 + wi.z * wo.z + 0.3 * (wi.x * wo.x); };
  const Brdf g = [](const Direction& wi, const Direction& wo) { return 0.3 + wi.z + 0.1 * wo.z * wo.z; };
  for (const Table& table : {on_grid(cells(7, 5)), rusinkiewicz(12), patches(4, 6)}) {
    Table truth = filled(table, f);
    truth.valid[11] = 0;
    const std::vector<float> other = values_of(table, g);
    const BrdfDifference difference = brdf_difference({.table = &truth, .values = other});
    EXPECT_EQ(difference.entries, truth.entries() - truth.masked());
    for (std::size_t q = 0; q < quantity_names.size(); ++q) {
      const auto quantity = static_cast<Quantity>(q);
      const double uniform = rms_difference(truth, other, quantity, entry_weights(truth, {}, quantity));
      const double solid = rms_difference(
          truth, other, quantity, entry_weights(truth, parse_weights("sin_theta_i,sin_theta_o,quadrature"), quantity));
      EXPECT_NEAR(difference.rms[q].uniform, uniform, 1e-12 * uniform) << quantity_names[q];
      EXPECT_NEAR(difference.rms[q].solid_angle.value(), solid, 1e-9 * solid) << quantity_names[q];
    }
  }
}

TEST(BrdfDifference, IsSymmetricButForWhatIsRelative) {
  const Brdf f = [](const Direction& wi, const Direction& wo) { return 0.2 + wi.z * wo.z; };
  const Brdf g = [](const Direction& wi, const Direction& wo) { return 0.6 - 0.3 * wi.z * wo.z; };
  const Table first = filled(on_grid(cells(12, 4)), f), second = filled(on_grid(cells(12, 4)), g);
  const BrdfDifference there = brdf_difference({.table = &first, .values = second.values});
  const BrdfDifference back = brdf_difference({.table = &second, .values = first.values});
  for (std::size_t q = 0; q < quantity_names.size(); ++q) {
    EXPECT_DOUBLE_EQ(there.rms[q].uniform, back.rms[q].uniform);
    EXPECT_DOUBLE_EQ(there.rms[q].solid_angle.value(), back.rms[q].solid_angle.value());
  }
  EXPECT_DOUBLE_EQ(there.smape.uniform, back.smape.uniform);
  EXPECT_DOUBLE_EQ(there.mean_absolute_log.uniform, back.mean_absolute_log.uniform);
  EXPECT_DOUBLE_EQ(there.bihemispherical->absolute, back.bihemispherical->absolute);
  EXPECT_DOUBLE_EQ(there.albedo->absolute.worst, back.albedo->absolute.worst);
  EXPECT_NE(there.bihemispherical->relative.value(), back.bihemispherical->relative.value());
}

TEST(BrdfDifference, VanishesForEqualBrdfsAlone) {
  const Table table =
      filled(on_grid(cells(6, 3)), [](const Direction& wi, const Direction& wo) { return wi.z + wo.z; });
  const Json same = brdf_difference({.table = &table, .values = table.values}).json(table);
  for (const char* metric : {"mean_absolute_log", "smape"}) EXPECT_EQ(same[metric]["solid_angle"], 0.0) << metric;
  for (const std::string_view name : quantity_names) EXPECT_EQ(same["rms"][std::string(name)]["uniform"], 0.0);
  EXPECT_EQ(same["bihemispherical"]["absolute"], 0.0);
  EXPECT_EQ(same["albedo"]["absolute"]["worst"], 0.0);
  std::vector<float> other = table.values;
  other[40] += 0.1f;
  const BrdfDifference one = brdf_difference({.table = &table, .values = other});
  EXPECT_GT(one.smape.uniform, 0.0);
  EXPECT_GT(one.bihemispherical->absolute, 0.0);
  EXPECT_GT(one.albedo->absolute.worst, 0.0);
}

TEST(BrdfDifference, KnowsTheSolidAnglesOfHalfAndDifferenceAngles) {
  constexpr double a = 0.9, b = 0.3;
  const Table truth = filled(rusinkiewicz(45), lambert(a));
  const std::vector<float> other = values_of(truth, lambert(b));
  const BrdfDifference alone = brdf_difference({.table = &truth, .values = other});
  EXPECT_NEAR(alone.bihemispherical->absolute, pi * (a - b), 1e-5);
  EXPECT_TRUE(lacks(alone, "albedo")) << "bins have no views of their own";
  const BrdfDifference both =
      brdf_difference({.table = &truth, .values = other, .truth = anywhere(lambert(a)), .other = anywhere(lambert(b))});
  EXPECT_EQ(both.albedo->method, "half_vector");
  EXPECT_EQ(both.albedo->angles.size(), 9u);
  EXPECT_NEAR(both.albedo->absolute.worst, a - b, 1e-9);
  EXPECT_NEAR(both.albedo->relative->mean, (a - b) / a, 1e-9);
}

TEST(BrdfDifference, TakesAListsOwnMeasure) {
  constexpr double a = 0.9, b = 0.3;
  Table truth = filled(patches(9, 12), lambert(a));
  const std::vector<float> other = values_of(truth, lambert(b));
  const BrdfDifference measured = brdf_difference({.table = &truth, .values = other});
  EXPECT_NEAR(measured.bihemispherical->absolute, pi * (a - b), 1e-5);
  EXPECT_EQ(measured.albedo->method, "rings");
  EXPECT_EQ(measured.albedo->angles.size(), 9u);
  EXPECT_NEAR(measured.albedo->absolute.worst, a - b, 1e-6);
  // Entries that do not say what they stand for, as in ALTA's texts.
  for (std::size_t entry = 0; entry < truth.entries(); ++entry) {
    truth.measure[entry] = static_cast<float>(measured_sine(truth.wi(entry)) * measured_sine(truth.wo(entry)));
  }
  const BrdfDifference scattered = brdf_difference({.table = &truth, .values = other});
  EXPECT_TRUE(lacks(scattered, "bihemispherical"));
  EXPECT_TRUE(lacks(scattered, "albedo"));
  EXPECT_NEAR(scattered.smape.uniform, (a - b) / (a + b), 1e-6);
}

TEST(BrdfDifference, SaysWhatASliceCannotTell) {
  const auto compare = [](const Grid& grid) {
    const Table truth = filled(on_grid(grid), lambert(0.9));
    const std::vector<float> other = values_of(truth, lambert(0.3));
    return brdf_difference({.table = &truth, .values = other});
  };
  const BrdfDifference plane = compare({points("theta_i", 18, 85.0), points("theta_o", 18, 85.0), points("phi", 1, 0)});
  EXPECT_TRUE(lacks(plane, "bihemispherical"));
  EXPECT_TRUE(lacks(plane, "albedo"));
  EXPECT_FALSE(lacks(plane, "solid_angle"));
  const BrdfDifference cone =
      compare({points("theta_i", 10, 45.0), points("theta_o", 18, 85.0), points("phi", 19, 180.0)});
  EXPECT_TRUE(lacks(cone, "albedo")) << "lights to 45 degrees are half of the cosine-weighted hemisphere";
  const BrdfDifference normal_views =
      compare({points("theta_i", 18, 85.0), points("theta_o", 1, 0), points("phi", 19, 180.0)});
  EXPECT_TRUE(lacks(normal_views, "bihemispherical"));
  EXPECT_TRUE(lacks(normal_views, "solid_angle"));
  EXPECT_FALSE(normal_views.smape.solid_angle.has_value());
  ASSERT_TRUE(normal_views.albedo.has_value());
  EXPECT_NEAR(normal_views.albedo->absolute.worst, 0.6, 1e-6);
  const BrdfDifference below =
      compare({points("theta_i", 19, 180.0), points("theta_o", 10, 80.0), points("phi", 19, 180.0)});
  EXPECT_TRUE(lacks(below, "albedo"));
  EXPECT_NE(below.not_formed.front().reason.find("below the horizon"), std::string::npos);
  Table hair = filled(on_grid(cells(8, 4)), lambert(0.5));
  hair.model = "hair_unreal";
  const BrdfDifference fibre = brdf_difference({.table = &hair, .values = hair.values});
  EXPECT_TRUE(lacks(fibre, "albedo"));
  EXPECT_NE(fibre.not_formed.front().reason.find("fibre"), std::string::npos);
}

TEST(BrdfDifference, HasNoRelativeErrorWhereTheTruthIsBlack) {
  const Table black = filled(on_grid(cells(8, 4)), lambert(0.0));
  const std::vector<float> grey_values = values_of(black, lambert(0.5));
  const BrdfDifference difference = brdf_difference({.table = &black, .values = grey_values});
  EXPECT_FALSE(difference.albedo->relative.has_value());
  EXPECT_FALSE(difference.bihemispherical->relative.has_value());
  EXPECT_EQ(difference.smape.uniform, 1.0);
  const Json json = difference.json(black);
  EXPECT_TRUE(json["albedo"]["relative"].is_null());
  EXPECT_TRUE(json["albedo"]["angles"][0]["relative"][0].is_null());
}

TEST(BrdfDifference, KeepsTheRowsOfATableApart) {
  Table truth;
  truth.grid = cells(10, 4);
  truth.channels = 3;
  truth.parameter_axes = {{"alpha", "", {0.25, 0.5}, false}};
  truth.allocate();
  std::vector<float> other(truth.values.size());
  for (std::size_t c = 0; c < 3; ++c) {
    for (std::size_t entry = 0; entry < truth.entries(); ++entry) {
      truth.values[c * truth.entries() + entry] = static_cast<float>(0.5 / pi);
      const double off = 0.1 * static_cast<double>(c + 1) * (truth.parameter_row(entry) == 0 ? 1.0 : -0.5);
      other[c * truth.entries() + entry] = static_cast<float>((0.5 + off) / pi);
    }
  }
  const BrdfDifference difference = brdf_difference({.table = &truth, .values = other});
  ASSERT_EQ(difference.albedo->angles.size(), 20u);
  EXPECT_NEAR(difference.albedo->absolute.worst, 0.3, 1e-6);
  // Over rows .1 .2 .3 and .05 .1 .15.
  EXPECT_NEAR(difference.albedo->absolute.mean, 0.15, 1e-6);
  EXPECT_NEAR(difference.bihemispherical->absolute, 0.15 * pi, 1e-6);
  const Json json = difference.json(truth);
  EXPECT_EQ(json["albedo"]["angles"][10]["alpha"], 0.5);
  EXPECT_NEAR(json["albedo"]["angles"][10]["b"][2].get<double>(), 0.35, 1e-6);
}

TEST(BrdfDifference, HasTheSameBitsForAnyNumberOfThreads) {
  const Brdf f = [](const Direction& wi, const Direction& wo) { return 0.2 + wi.z * wo.z; };
  const Table truth = filled(rusinkiewicz(30), f);
  const std::vector<float> other = values_of(truth, lambert(0.7));
  const BrdfPair pair{.table = &truth, .values = other, .truth = anywhere(f), .other = anywhere(lambert(0.7))};
  const auto with_threads = [&](std::size_t threads) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    return brdf_difference(pair).json(truth).dump();
  };
  EXPECT_EQ(with_threads(1), with_threads(4));
}

TEST(BrdfDifference, RefusesBrdfsWithNothingInCommon) {
  Table truth = filled(on_grid(cells(4, 2)), lambert(0.5));
  std::fill(truth.valid.begin(), truth.valid.end(), std::uint8_t{0});
  EXPECT_THROW(brdf_difference({.table = &truth, .values = truth.values}), Error);
}

TEST(HalfVectorRule, IntegratesWhatTheCosineWeights) {
  for (const double theta : {0.0, 10.0, 45.0, 80.0, 89.0, 89.9}) {
    for (const double phi : {0.0, 130.0}) {
      for (const int n : {1, 2}) {
        double cosine = 0.0, squares = 0.0;
        Direction mean{};
        for (const LightNode& node : HalfVectorRule(n).lights(direction(radians(theta), radians(phi)))) {
          EXPECT_GT(node.wi.z, 0.0);
          EXPECT_NEAR(dot(node.wi, node.wi), 1.0, 1e-12);
          cosine += node.weight * node.wi.z;
          squares += node.weight * node.wi.z * node.wi.z;
          mean = mean + node.wi * (node.weight * node.wi.z);
        }
        EXPECT_NEAR(cosine, pi, n == 1 ? 1e-6 : 1e-12) << theta;
        EXPECT_NEAR(squares, 2.0 * pi / 3.0, n == 1 ? 5e-5 : 5e-6) << theta;
        // The hemisphere's centre lies over the origin, wherever the view is.
        EXPECT_NEAR(mean.x, 0.0, n == 1 ? 1e-6 : 1e-12) << theta;
        EXPECT_NEAR(mean.y, 0.0, n == 1 ? 1e-6 : 1e-12) << theta;
      }
    }
  }
}

TEST(HalfVectorRule, ResolvesNarrowLobes) {
  // Against nested Gauss-Legendre panels in the light's own angles.
  const Model& model = find_model("specular_ggx");
  struct Case {
    double alpha, coarse, fine;  // relative errors of rules 1 and 2
  };
  for (const Case& one : {Case{0.4, 3e-4, 1e-6}, Case{0.1, 1e-3, 1e-5}, Case{0.05, 1e-3, 1e-5}}) {
    ParameterValues values = model.defaults();
    values.set("alpha", one.alpha);
    for (const double theta : {0.0, 30.0, 60.0, 80.0}) {
      const Direction wo = direction(radians(theta), 0.0);
      const double truth =
          directional_albedo(
              [&](const Direction& wi, const Direction& view) { return model.evaluate(values.flat(), wi, view); },
              radians(theta), FixedDirection::view)
              .value.x;
      const auto error = [&](int n) {
        double sum = 0.0;
        for (const LightNode& node : HalfVectorRule(n).lights(wo)) {
          sum += node.weight * node.wi.z * model.evaluate(values.flat(), node.wi, wo).x;
        }
        return std::abs(sum / truth - 1.0);
      };
      EXPECT_LT(error(1), one.coarse) << "alpha " << one.alpha << ", view " << theta;
      EXPECT_LT(error(2), one.fine) << "alpha " << one.alpha << ", view " << theta;
    }
  }
}

TEST(BrdfDifferenceOfMeasuredData, FindsTheAlbedoOfAnRglFile) {
  const char* folder = std::getenv("LOBEFIT_TEST_DATA");
  if (!folder) GTEST_SKIP() << "LOBEFIT_TEST_DATA is unset: no measured files";
  const BrdfFile file = read_brdf_file(std::filesystem::path(folder) / "rgl" / "aurora_white_rgb.bsdf");
  const Model& model = find_model("lambert");
  ParameterValues parameters = model.defaults();
  parameters.set("albedo", std::vector{0.7, 0.75, 0.7});
  const TableModel on_table(model, parameters, file.table);
  const Table rendered = on_table.render();
  const BrdfDifference difference = brdf_difference(
      {.table = &file.table, .values = rendered.values, .truth = row_brdf(file), .other = row_brdf(on_table)});
  ASSERT_TRUE(difference.albedo.has_value());
  EXPECT_EQ(difference.albedo->method, "half_vector");
  EXPECT_TRUE(difference.bihemispherical.has_value());
  for (const std::size_t k : {0u, 3u, 6u}) {
    const AlbedoAtAngle& angle = difference.albedo->angles[k];
    const Albedo truth =
        directional_albedo([&](const Direction& wi, const Direction& wo) { return file.evaluate(wi, wo); },
                           radians(angle.theta_o), FixedDirection::view, AlbedoDomain::hemisphere, 1e-4);
    EXPECT_NEAR(angle.truth[0], truth.value.x, 2e-3) << angle.theta_o;
    EXPECT_NEAR(angle.truth[1], truth.value.y, 2e-3) << angle.theta_o;
    EXPECT_NEAR(angle.truth[2], truth.value.z, 2e-3) << angle.theta_o;
    EXPECT_NEAR(angle.other[1], 0.75, 1e-6);
    EXPECT_NEAR(angle.coverage, 1.0, 1e-6);
  }
  // A gonioreflectometer's scattered samples cover no hemisphere.
  const BrdfFile tape = read_brdf_file(std::filesystem::path(folder) / "retro" / "retro-3M-jaune.dat");
  EXPECT_TRUE(lacks(brdf_difference({.table = &tape.table, .values = tape.table.values}), "bihemispherical"));
  // A Klems matrix has rings of views.
  const BrdfFile cloth = read_brdf_file(std::filesystem::path(folder) / "lbnl" / "2011-SA1.XML");
  const BrdfDifference itself = brdf_difference({.table = &cloth.table, .values = cloth.table.values});
  ASSERT_TRUE(itself.albedo.has_value());
  EXPECT_EQ(itself.albedo->method, "rings");
  EXPECT_EQ(itself.albedo->angles.size(), 9u);
}

}  // namespace
}  // namespace lobefit
