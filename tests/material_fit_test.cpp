// Fits of materials: steps within bounds, samples that stand for all entries, starts, tiers, and what a fit says about
// itself.
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <random>

#include "fit/box_steps.h"
#include "fit/sample_entries.h"
#include "fit/starts.h"
#include "fit/tiers.h"
#include "reference/render.h"

namespace lobefit {
namespace {

Monitor silent;

// Steps within bounds
// -----------------------------------------------------------------------------------------------------------------

/// r = A x - b as normal equations.
LeastSquaresProblem linear_problem(const Eigen::MatrixXd& a, const Eigen::VectorXd& b, double lower, double upper) {
  const auto p = static_cast<std::size_t>(a.cols());
  LeastSquaresProblem problem;
  problem.residual_count = static_cast<std::size_t>(a.rows());
  for (std::size_t i = 0; i < p; ++i) problem.names.push_back("x" + std::to_string(i));
  problem.start.assign(p, 0.5 * (lower + upper));
  problem.lower.assign(p, lower);
  problem.upper.assign(p, upper);
  problem.tolerance = 1e-12;
  problem.condense = [a, b](std::span<const double> x, bool, NormalEquations& result) {
    const Eigen::VectorXd r = a * Eigen::Map<const Eigen::VectorXd>(x.data(), a.cols()) - b;
    const Eigen::VectorXd g = a.transpose() * r;
    const Eigen::MatrixXd n = a.transpose() * a;
    result.sum_of_squares = r.squaredNorm();
    result.gradient.assign(g.begin(), g.end());
    result.normal.assign(n.data(), n.data() + n.size());
    return true;
  };
  return problem;
}

TEST(BoxSteps, MeetTheConditionsOfConstrainedMinima) {
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  int at_bounds = 0;
  for (int trial = 0; trial < 50; ++trial) {
    const int n = 3 + trial % 10;
    Eigen::MatrixXd a(2 * n, n);
    Eigen::VectorXd b(2 * n);
    for (double& value : a.reshaped()) value = normal(random);
    for (double& value : b) value = 3.0 * normal(random);
    const LeastSquaresProblem problem = linear_problem(a, b, -0.3, 0.4);
    const Minimum minimum = minimise_in_box(problem, silent);
    ASSERT_TRUE(minimum.converged);
    const Eigen::VectorXd x = Eigen::Map<const Eigen::VectorXd>(minimum.x.data(), n);
    const Eigen::VectorXd gradient = a.transpose() * (a * x - b);
    EXPECT_NEAR(minimum.sum_of_squares, (a * x - b).squaredNorm(), 1e-12 * b.squaredNorm());
    // Karush, Kuhn and Tucker: no slope inside the box, outward slopes alone at its faces.
    for (int i = 0; i < n; ++i) {
      if (x[i] == -0.3 || x[i] == 0.4) ++at_bounds;
      if (x[i] == -0.3)
        EXPECT_GE(gradient[i], -1e-5);
      else if (x[i] == 0.4)
        EXPECT_LE(gradient[i], 1e-5);
      else
        EXPECT_NEAR(gradient[i], 0.0, 1e-5) << trial;
    }
  }
  EXPECT_GT(at_bounds, 100);
}

TEST(BoxSteps, FollowACurvedValleyToABound) {
  // Rosenbrock's function with x ≤ 0.5: its minimum there is y = x² = 0.25, where the sum of squares is (1 - x)².
  LeastSquaresProblem problem;
  problem.residual_count = 2;
  problem.names = {"x", "y"};
  problem.start = {-1.2, 1.0};
  problem.lower = {-2.0, -2.0};
  problem.upper = {0.5, 2.0};
  problem.tolerance = 1e-12;
  problem.condense = [](std::span<const double> x, bool, NormalEquations& result) {
    const Eigen::Vector2d r(10.0 * (x[1] - x[0] * x[0]), 1.0 - x[0]);
    Eigen::Matrix2d j;
    j << -20.0 * x[0], 10.0, -1.0, 0.0;
    const Eigen::Vector2d g = j.transpose() * r;
    const Eigen::Matrix2d n = j.transpose() * j;
    result = {r.squaredNorm(), {g[0], g[1]}, {n(0, 0), n(0, 1), n(1, 0), n(1, 1)}};
    return true;
  };
  const Minimum minimum = minimise_in_box(problem, silent);
  EXPECT_TRUE(minimum.converged);
  EXPECT_EQ(minimum.x[0], 0.5);
  EXPECT_NEAR(minimum.x[1], 0.25, 1e-6);
  problem.maximum_iterations = 2;
  EXPECT_FALSE(minimise_in_box(problem, silent).converged);
  problem.fixed = {1, 0};
  problem.maximum_iterations = 200;
  EXPECT_EQ(minimise_in_box(problem, silent).x[0], -1.2);
}

// Tables of Callisto
// -----------------------------------------------------------------------------------------------------------------

Grid grid_of(int thetas, int phis) {
  const auto midpoints = [](const char* name, int count, double end) {
    Axis axis{name, "degree", {}, true};
    for (int k = 0; k < count; ++k) axis.values.push_back((k + 0.5) * end / count);
    return axis;
  };
  return {midpoints("theta_i", thetas, 85.0), midpoints("theta_o", thetas, 85.0), midpoints("phi", phis, 180.0)};
}

ParameterValues satin() {
  ParameterValues values = find_model("callisto").defaults();
  values.set("albedo", std::vector{0.5, 0.3, 0.2});
  values.set("alpha", 0.2);
  values.set("f0", 0.06);
  return values;
}

Table colour_table(const Model& model, const ParameterValues& values, const Grid& grid) {
  Table table;
  table.grid = grid;
  table.channels = 3;
  table.allocate();
  return TableModel(model, values, table).render();
}

FitOptions full_options(const Model& model, const Table& table) {
  FitOptions options{.free = free_parameters(model.defaults(), table, {}, Tier::full)};
  options.weights = parse_weights("sin_theta_i,sin_theta_o");
  options.staged = true;
  options.starts = 6;
  options.tolerance = 1e-12;
  return options;
}

const FitParameter& parameter(const Fit& fit, std::string_view name) {
  const auto found = std::ranges::find(fit.parameters, name, &FitParameter::name);
  if (found == fit.parameters.end()) throw std::runtime_error("no parameter " + std::string(name));
  return *found;
}

TEST(TableProblems, NormalEquationsAreThoseOfTheResiduals) {
  // callisto's colours share lanes and its tints are products; disney mixes channels through its tint colour.
  for (const char* name : {"callisto", "disney"}) {
    const Model& model = find_model(name);
    const Table table = colour_table(model, model.defaults(), grid_of(6, 7));
    FitOptions options = full_options(model, table);
    options.loss = Loss::huber;
    options.loss_scale = 0.01;
    const std::vector<double> weights = entry_weights(table, options.weights, options.quantity);
    const TableProblem problem(model, model.defaults(), table, options, weights);
    std::vector<double> x = problem.variables().start;
    for (std::size_t v = 0; v < x.size(); ++v) {
      const double range = std::min(problem.variables().upper[v] - problem.variables().lower[v], 2.0);
      x[v] = problem.variables().lower[v] + range * (0.2 + 0.6 * std::fmod(0.37 * static_cast<double>(v), 1.0));
    }
    const LeastSquaresProblem raw = problem.problem(x);
    ASSERT_TRUE(raw.evaluate);
    const auto n = static_cast<Eigen::Index>(raw.residual_count), p = static_cast<Eigen::Index>(x.size());
    Eigen::VectorXd r(n);
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> j(n, p);
    raw.evaluate(x, {r.data(), raw.residual_count}, j.data());
    NormalEquations condensed;
    ASSERT_TRUE(problem.with_prior(x, 0.0).condense(x, true, condensed));
    EXPECT_NEAR(condensed.sum_of_squares, r.squaredNorm(), 1e-12 * r.squaredNorm());
    const Eigen::VectorXd g = j.transpose() * r;
    const Eigen::MatrixXd normal = j.transpose() * j;
    for (Eigen::Index k = 0; k < p; ++k) {
      EXPECT_NEAR(condensed.gradient[static_cast<std::size_t>(k)], g[k], 1e-11 * j.col(k).norm() * r.norm()) << name;
      for (Eigen::Index l = 0; l < p; ++l) {
        EXPECT_NEAR(condensed.normal[static_cast<std::size_t>(k * p + l)], normal(k, l),
                    1e-11 * j.col(k).norm() * j.col(l).norm())
            << name << " " << k << " " << l;
      }
      // And the Jacobian is that of the residuals: central differences.
      std::vector<double> moved = x;
      const double step = 1e-6 * std::max(0.1, std::abs(x[static_cast<std::size_t>(k)]));
      Eigen::VectorXd up(n), down(n);
      moved[static_cast<std::size_t>(k)] += step;
      raw.evaluate(moved, {up.data(), raw.residual_count}, nullptr);
      moved[static_cast<std::size_t>(k)] -= 2.0 * step;
      raw.evaluate(moved, {down.data(), raw.residual_count}, nullptr);
      EXPECT_LT(((up - down) / (2.0 * step) - j.col(k)).norm(), 1e-4 * (j.col(k).norm() + 1e-6))
          << name << " " << raw.names[static_cast<std::size_t>(k)];
    }
  }
}

TEST(TableProblems, KnowWhichModelsMixChannels) {
  EXPECT_TRUE(is_channelwise(find_model("callisto")));
  EXPECT_TRUE(is_channelwise(find_model("lambert")));
  // Burley 2012's tint is the base colour over its luminance: every channel's weight is in every channel.
  EXPECT_FALSE(is_channelwise(find_model("disney")));
}

TEST(TableProblems, ProductsComeBackWithTheLargestChannelAtOne) {
  const Model& model = find_model("callisto");
  ParameterValues values = satin();
  values.set("retroreflection", 2.5);
  values.set("retroreflection_tint", std::vector{0.5, 0.8, 0.2});
  values.set("terminator", -0.6);
  values.set("terminator_tint", std::vector{0.25, 0.5, 1.0});
  const Table table = colour_table(model, values, grid_of(4, 5));
  const FitOptions options = full_options(model, table);
  const TableProblem problem(model, values, table, options, entry_weights(table, options.weights, options.quantity));
  const ParameterValues back = problem.values_at(problem.variables_of(values));
  EXPECT_NEAR(back.get("retroreflection"), 2.0, 1e-15);
  const auto tint = back.components(back.info("retroreflection_tint"));
  EXPECT_NEAR(tint[0], 0.625, 1e-15);
  EXPECT_EQ(tint[1], 1.0);
  EXPECT_NEAR(tint[2], 0.25, 1e-15);
  EXPECT_NEAR(back.get("terminator"), -0.6, 1e-15);
  for (std::size_t entry = 0; entry < table.entries(); ++entry) {
    const Rgb a = model.evaluate(values.flat(), table.wi(entry), table.wo(entry)),
              b = model.evaluate(back.flat(), table.wi(entry), table.wo(entry));
    ASSERT_NEAR(a.x, b.x, 1e-14 * a.x);
    ASSERT_NEAR(a.z, b.z, 1e-14 * a.z);
  }
}

// Samples
// -----------------------------------------------------------------------------------------------------------------

// A tint can't turn the sign of its intensity, whatever each channel would like.
TEST(TableProblems, ColoursKeepToOneSign) {
  const Model& model = find_model("callisto_lambert");
  Table table = colour_table(model, model.defaults(), grid_of(8, 8));
  for (std::size_t c = 0; c < 3; ++c) {
    ParameterValues channel = model.defaults();
    channel.set("terminator", c == 0 ? -0.5 : 0.8);
    const Table one = colour_table(model, channel, table.grid);
    std::copy_n(one.values.begin() + static_cast<std::ptrdiff_t>(c * table.entries()), table.entries(),
                table.values.begin() + static_cast<std::ptrdiff_t>(c * table.entries()));
  }
  for (const bool staged : {false, true}) {
    const Fit found =
        fit(model, model.defaults(), table, {.free = {"terminator", "terminator_tint"}, .staged = staged}, silent);
    const ParameterValues values = found.values();  // throws out of range
    const std::span<const double> tint = values.components(values.info("terminator_tint"));
    EXPECT_GT(values.get("terminator"), 0.1);
    EXPECT_EQ(tint[0], 0.0);
    EXPECT_EQ(std::max(tint[1], tint[2]), 1.0);
  }
}

TEST(EntrySamples, StandForAllEntries) {
  const Model& model = find_model("callisto");
  Table table = colour_table(model, satin(), Grid::measured());
  for (std::size_t entry = 0; entry < table.entries(); entry += 7) table.valid[entry] = 0;
  const std::vector<double> weights = entry_weights(table, parse_weights("sin_theta_i,sin_theta_o"), Quantity::log);
  const EntrySampler sampler(table, weights, Quantity::log);
  const auto mean = [&](const std::vector<double>& of) {
    double sum = 0.0;
    for (std::size_t entry = 0; entry < of.size(); ++entry) {
      if (of[entry] > 0.0) sum += of[entry] * table.value(entry) * table.wi(entry).z * table.wo(entry).z;
    }
    return sum;
  };
  const double truth = mean(weights);
  constexpr int seeds = 64;
  double sum = 0.0, squares = 0.0;
  std::size_t nearest_mirror = 0, drawn_mirror = 0;
  for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
    const std::vector<double> sample = sampler.sample(2000, seed);
    double total = 0.0;
    std::size_t count = 0;
    for (std::size_t entry = 0; entry < sample.size(); ++entry) {
      total += sample[entry];
      count += sample[entry] > 0.0;
      ASSERT_TRUE(sample[entry] == 0.0 || table.valid[entry]);
      if (table.valid[entry] && table.theta_i_index(entry) == table.theta_o_index(entry) &&
          table.phi_index(entry) == 89) {
        ++nearest_mirror;
        drawn_mirror += sample[entry] > 0.0;
      }
    }
    EXPECT_NEAR(total, 1.0, 1e-12);
    EXPECT_NEAR(static_cast<double>(count), 2000.0, 25.0);
    sum += mean(sample);
    squares += square(mean(sample));
  }
  const double average = sum / seeds;
  const double error = std::sqrt((squares / seeds - square(average)) / (seeds - 1));
  // Four standard errors: false alarms in 1 of 16,000.
  EXPECT_NEAR(average, truth, 4.0 * error);
  EXPECT_LT(error * std::sqrt(static_cast<double>(seeds)), 0.02 * truth);
  // Where a spike could hide, most are drawn; of all entries it is 1 in 80.
  EXPECT_GT(static_cast<double>(drawn_mirror), 0.5 * static_cast<double>(nearest_mirror));
  EXPECT_EQ(sampler.sample(2000, 5), sampler.sample(2000, 5));
  EXPECT_EQ(sampler.sample(1u << 20, 5), weights);
}

// Starts
// -----------------------------------------------------------------------------------------------------------------

TEST(Guesses, AreNearTheLobeThatIsThere) {
  const Model& model = find_model("callisto_lambert");
  for (const double alpha : {0.1, 0.2, 0.35, 0.5}) {
    ParameterValues values = model.defaults();
    values.set("albedo", std::vector{0.3, 0.2, 0.1});
    values.set("alpha", alpha);
    values.set("f0", 0.3);
    const Table table = colour_table(model, values, Grid::measured());
    const MaterialGuess guess =
        guess_material(table, entry_weights(table, parse_weights("sin_theta_i,sin_theta_o"), Quantity::log));
    // Of wide lobes the diffuse level takes a share, and the slice ends at 80°.
    const double factor = alpha < 0.3 ? 1.6 : 2.5;
    EXPECT_LT(std::abs(std::log(guess.alpha / alpha)), std::log(factor)) << alpha << " " << guess.alpha;
    EXPECT_LT(std::abs(std::log(guess.f0.x / 0.3)), std::log(factor * factor)) << alpha << " " << guess.f0.x;
    EXPECT_LT(std::abs(std::log(guess.albedo.x / 0.3)), std::log(1.5)) << alpha << " " << guess.albedo.x;
  }
}

TEST(StagedFits, FindWhatMadeTheTable) {
  const Model& model = find_model("callisto");
  ParameterValues values = satin();
  values.set("diffuse_fresnel", 0.4);
  values.set("diffuse_fresnel_falloff", 0.6);
  values.set("retroreflection", 2.0);
  values.set("retroreflection_tint", std::vector{1.0, 0.6, 0.3});
  values.set("terminator", 0.5);
  values.set("terminator_tint", std::vector{0.2, 0.6, 1.0});
  values.set("terminator_length", 0.7);
  values.set("dual_specular_roughness_scale", 2.0);
  values.set("dual_specular_opacity", 0.4);
  const Table table = colour_table(model, values, grid_of(16, 18));
  FitOptions options = full_options(model, table);
  options.prior = 0.0;
  std::vector<std::vector<double>> results;
  for (const std::size_t threads : {std::size_t{1}, std::size_t{2}}) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    const Fit result = fit(model, model.defaults(), table, options, silent);
    const ParameterValues fitted = result.values();
    results.emplace_back(fitted.flat().begin(), fitted.flat().end());
    if (threads > 1) continue;
    EXPECT_TRUE(result.solution.converged);
    // The table's values are floats.
    EXPECT_LT(std::sqrt(result.solution.sum_of_squares), 1e-6);
    for (const char* name : {"alpha", "retroreflection", "retroreflection_tint.g", "terminator", "terminator_tint.r",
                             "terminator_length", "dual_specular_roughness_scale", "dual_specular_opacity", "f0.g"}) {
      const std::string text(name);
      const std::size_t dot = text.find('.');
      const double truth = dot == std::string::npos
                               ? values.get(text)
                               : values.components(values.info(text.substr(0, dot)))[text[dot + 1] == 'r'   ? 0
                                                                                     : text[dot + 1] == 'g' ? 1
                                                                                                            : 2];
      const auto found = std::ranges::find(result.parameters, text, &FitParameter::name);
      const double value = found != result.parameters.end() ? found->estimate.value
                                                            : parameter(result, text.substr(0, dot)).estimate.value;
      EXPECT_NEAR(value, truth, 1e-3 * std::max(1.0, std::abs(truth))) << name;
    }
  }
  EXPECT_EQ(results[0], results[1]);
}

// Tiers
// -----------------------------------------------------------------------------------------------------------------

TEST(Tiers, AreDecidedByTheData) {
  const Model& model = find_model("callisto");
  ParameterValues base = satin();
  base.set("retroreflection", 2.0);
  base.set("diffuse_fresnel", 0.5);
  ParameterValues full = base;
  full.set("diffuse_fresnel_tangent_falloff", 1.0);
  full.set("retroreflection_tangent_falloff", 1.0);
  full.set("retroreflection_tint", std::vector{1.0, 0.5, 0.2});
  std::mt19937 random(3);
  std::normal_distribution<float> normal;
  for (const bool needs_full : {false, true}) {
    Table table = colour_table(model, needs_full ? full : base, grid_of(14, 12));
    for (float& value : table.values) value *= 1.0f + 0.02f * normal(random);
    FitOptions options = full_options(model, table);
    options.starts = 3;
    options.tolerance = 1e-8;
    options.holdout = 0.25;
    options.holdout_blocks = true;
    const std::vector<TierFit> tiers = fit_tiers(model, model.defaults(), table, options, Tier::full, silent);
    ASSERT_EQ(tiers.size(), 3u);
    for (std::size_t k = 1; k < 3; ++k) {
      EXPECT_LE(tiers[k].fit.solution.sum_of_squares, tiers[k - 1].fit.solution.sum_of_squares * (1.0 + 1e-3));
      EXPECT_EQ(tiers[k].verdict(tiers[k - 1].tier).find("can't decide") == std::string::npos, tiers[k].decided);
    }
    if (needs_full) {
      EXPECT_TRUE(tiers[1].decided) << tiers[1].gain << " " << tiers[1].gain_error;
      EXPECT_TRUE(tiers[2].decided) << tiers[2].gain << " " << tiers[2].gain_error;
      EXPECT_GT(tiers[2].gain, 0.2);
    } else {
      EXPECT_LT(std::abs(tiers[1].gain) + std::abs(tiers[2].gain), 0.02);
    }
  }
}

// What a fit says about itself
// -----------------------------------------------------------------------------------------------------------------

TEST(Remarks, TellWhatHidesAParameter) {
  const Model& model = find_model("callisto");
  const Table table = colour_table(model, satin(), grid_of(5, 6));
  const auto has_remark = [](const Fit& fit, const std::string& text) {
    return std::ranges::any_of(fit.solution.remarks,
                               [&](const std::string& remark) { return remark.find(text) != std::string::npos; });
  };
  FitOptions options{
      .free = {"albedo", "terminator_length", "dual_specular_roughness_scale", "retroreflection_tangent_falloff"}};
  const Fit result = fit(model, satin(), table, options, silent);
  EXPECT_FALSE(result.solution.identifiable);
  EXPECT_TRUE(has_remark(result, "terminator_length has no effect while terminator = 0"));
  EXPECT_TRUE(has_remark(result, "dual_specular_roughness_scale has no effect while dual_specular_opacity = 0"));
  EXPECT_TRUE(has_remark(result, "retroreflection_tangent_falloff has no effect while retroreflection = 1"));
  EXPECT_FALSE(has_remark(result, "albedo has no effect"));
  EXPECT_FALSE(parameter(result, "terminator_length").estimate.identifiable);
  EXPECT_TRUE(parameter(result, "albedo.r").estimate.identifiable);
}

TEST(BlockIntervals, CoverWhatAMisfitDoesToTheValue) {
  // A Lambertian table off by a smooth random function of the angles. Over realisations the intervals should hold the
  // truth; 45 blocks share five ranges of angles, so that they are not independent and cover less than they say.
  const Model& model = find_model("lambert");
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  constexpr int tables = 200;
  int covered = 0;
  for (int t = 0; t < tables; ++t) {
    Table table;
    table.grid = grid_of(18, 6);
    table.allocate();
    std::array<double, 24> frequency, phase;
    for (double& f : frequency) f = 8.0 * normal(random);
    for (double& p : phase) p = 2.0 * pi * std::uniform_real_distribution<double>()(random);
    for (std::size_t entry = 0; entry < table.entries(); ++entry) {
      const double i = std::acos(table.wi(entry).z), o = std::acos(table.wo(entry).z);
      double ripple = 0.0;
      for (std::size_t k = 0; k < 12; ++k)
        ripple += std::cos(frequency[2 * k] * (i + o) + phase[2 * k]) * std::cos(frequency[2 * k + 1] * (i - o)) / 12.0;
      table.values[entry] = static_cast<float>(0.5 / pi * (1.0 + 0.2 * ripple));
    }
    FitOptions options{.free = {"albedo"}, .quantity = Quantity::brdf};
    options.weights = parse_weights("sin_theta_i,sin_theta_o");
    options.intervals = Intervals::blocks;
    const FittedVariable albedo = parameter(fit(model, model.defaults(), table, options, silent), "albedo").estimate;
    EXPECT_GT(albedo.standard_error, 0.0);
    covered += albedo.ci_low <= 0.5 && 0.5 <= albedo.ci_high;
  }
  RecordProperty("coverage", covered);
  // 95 % of independent blocks; from 85 % on they are of use.
  EXPECT_GE(covered, tables * 85 / 100) << covered;
}

}  // namespace
}  // namespace lobefit
