// Fits: certified results, closed forms of linear problems, recovery of known constants, and honesty about what the
// data can't decide.
#include "fit/fit.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numeric>

#include "fit/dual_model.h"
#include "reference/json_reader.h"
#include "reference/render.h"
#include "tests/directions.h"

namespace lobefit {
namespace {

Monitor silent;

Axis axis(const std::string& name, std::vector<double> values) { return {name, "degree", std::move(values), false}; }

Grid small_grid() {
  return {axis("theta_i", {0.0, 15.0, 30.0, 45.0, 60.0, 75.0, 85.0}), axis("theta_o", {0.0, 25.0, 50.0, 70.0, 85.0}),
          axis("phi", {0.0, 45.0, 90.0, 135.0, 180.0})};
}

/// View along the normal: θ_i = 0, 5, …, 85 degrees.
Grid normal_slice() {
  Axis theta_i = axis("theta_i", {});
  for (int k = 0; k < 18; ++k) theta_i.values.push_back(5.0 * k);
  return {theta_i, axis("theta_o", {0.0}), axis("phi", {0.0})};
}

Axis alphas(int count) {
  Axis result{"alpha", "", {}, false};
  for (int k = 1; k <= count; ++k) result.values.push_back(static_cast<double>(k) / count);
  return result;
}

Table render_model(const std::string& name, const ParameterValues& values, const Grid& grid = small_grid(),
                   std::vector<Axis> axes = {}) {
  return render(find_model(name), values, std::move(axes), grid, silent);
}

Table render_reference(std::string_view masking, const std::vector<Axis>& axes, const Grid& grid,
                       const RenderOptions& options = {.exact = true}) {
  ParameterValues values = find_reference("microfacet_diffuse").defaults();
  values.set_text("masking", masking);
  return render(find_reference("microfacet_diffuse"), values, axes, grid, options, silent);
}

/// A Lambertian table of albedo πf by entry.
template <class F>
Table lambertian_table(F&& albedo, const Grid& grid = small_grid()) {
  Table table = render_model("lambert", find_model("lambert").defaults(), grid);
  for (std::size_t entry = 0; entry < table.entries(); ++entry) {
    table.values[entry] = static_cast<float>(albedo(entry) / pi);
  }
  return table;
}

const FitParameter& parameter(const Fit& fit, std::string_view name) {
  const auto found =
      std::find_if(fit.parameters.begin(), fit.parameters.end(), [&](const FitParameter& p) { return p.name == name; });
  if (found == fit.parameters.end()) throw std::runtime_error("no parameter " + std::string(name));
  return *found;
}
double value(const Fit& fit, std::string_view name) { return parameter(fit, name).estimate.value; }

double metric(const std::vector<FitMetric>& metrics, std::string_view name) {
  const auto found = std::find_if(metrics.begin(), metrics.end(), [&](const FitMetric& m) { return m.name == name; });
  return found == metrics.end() ? std::nan("") : found->value;
}

std::string remarks(const LeastSquaresSolution& solution) {
  std::string text;
  for (const std::string& remark : solution.remarks) text += remark + "; ";
  return text;
}

template <class Act>
void expect_error(ExitCode code, const std::string& fragment, Act&& act, const std::string& what = "") {
  try {
    act();
    ADD_FAILURE() << what << ": no error";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), code) << what << ": " << error.what();
    EXPECT_NE(std::string(error.what()).find(fragment), std::string::npos) << what << ": " << error.what();
  } catch (const std::exception& error) {
    ADD_FAILURE() << what << ": another exception: " << error.what();
  }
}

// ---- the solver -------------------------------------------------------------------------------------------------

struct Observation {
  double x, y;
};

// NIST Statistical Reference Datasets, nonlinear regression, Kirby2 (R. Kirby, NIST: scanning electron microscope line
// width standards; average difficulty), https://www.itl.nist.gov/div898/strd/nls/data/kirby2.shtml
constexpr Observation kirby2[] = {
    {9.65, 0.0082},   {10.74, 0.0112},  {11.81, 0.0149},  {12.88, 0.0198},  {14.06, 0.0248},  {15.28, 0.0324},
    {16.63, 0.042},   {18.19, 0.0549},  {19.88, 0.0719},  {21.84, 0.0963},  {24, 0.1291},     {26.25, 0.171},
    {28.86, 0.2314},  {31.85, 0.3227},  {35.79, 0.4809},  {40.18, 0.7084},  {44.74, 1.022},   {49.53, 1.458},
    {53.94, 1.952},   {58.29, 2.541},   {62.63, 3.223},   {67.03, 3.999},   {71.25, 4.852},   {75.22, 5.732},
    {79.33, 6.727},   {83.56, 7.835},   {87.75, 9.025},   {91.93, 10.267},  {96.1, 11.578},   {100.28, 12.944},
    {104.46, 14.377}, {108.66, 15.856}, {112.71, 17.331}, {116.88, 18.885}, {121.33, 20.575}, {125.79, 22.32},
    {125.79, 22.303}, {128.74, 23.46},  {130.27, 24.06},  {133.33, 25.272}, {134.79, 25.853}, {137.93, 27.11},
    {139.33, 27.658}, {142.46, 28.924}, {143.9, 29.511},  {146.91, 30.71},  {148.51, 31.35},  {151.41, 32.52},
    {153.17, 33.23},  {155.97, 34.33},  {157.76, 35.06},  {160.56, 36.17},  {162.3, 36.84},   {165.21, 38.01},
    {166.9, 38.67},   {169.92, 39.87},  {170.32, 40.03},  {171.54, 40.5},   {173.79, 41.37},  {174.57, 41.67},
    {176.25, 42.31},  {177.34, 42.73},  {179.19, 43.46},  {181.02, 44.14},  {182.08, 44.55},  {183.88, 45.22},
    {185.75, 45.92},  {186.8, 46.3},    {188.63, 47},     {190.45, 47.68},  {191.48, 48.06},  {193.35, 48.74},
    {195.22, 49.41},  {196.23, 49.76},  {198.05, 50.43},  {199.97, 51.11},  {201.06, 51.5},   {202.83, 52.12},
    {204.69, 52.76},  {205.86, 53.18},  {207.58, 53.78},  {209.5, 54.46},   {210.65, 54.83},  {212.33, 55.4},
    {215.43, 56.43},  {217.16, 57.03},  {220.21, 58},     {221.98, 58.61},  {225.06, 59.58},  {226.79, 60.11},
    {229.92, 61.1},   {231.69, 61.65},  {234.77, 62.59},  {236.6, 63.12},   {239.63, 64.03},  {241.5, 64.62},
    {244.48, 65.49},  {246.4, 66.03},   {249.35, 66.89},  {251.32, 67.42},  {254.22, 68.23},  {256.24, 68.77},
    {259.11, 69.59},  {261.18, 70.11},  {264.02, 70.86},  {266.13, 71.43},  {268.94, 72.16},  {271.09, 72.7},
    {273.87, 73.4},   {276.08, 73.93},  {278.83, 74.6},   {281.08, 75.16},  {283.81, 75.82},  {286.11, 76.34},
    {288.81, 76.98},  {291.08, 77.48},  {293.75, 78.08},  {295.99, 78.6},   {298.64, 79.17},  {300.84, 79.62},
    {302.02, 79.88},  {303.48, 80.19},  {305.65, 80.66},  {308.27, 81.22},  {310.41, 81.66},  {313.01, 82.16},
    {315.12, 82.59},  {317.71, 83.14},  {319.79, 83.5},   {322.36, 84},     {324.42, 84.4},   {326.98, 84.89},
    {329.01, 85.26},  {331.56, 85.74},  {333.56, 86.07},  {336.1, 86.54},   {338.08, 86.89},  {340.6, 87.32},
    {342.57, 87.65},  {345.08, 88.1},   {347.02, 88.43},  {349.52, 88.83},  {351.44, 89.12},  {353.93, 89.54},
    {355.83, 89.85},  {358.32, 90.25},  {360.2, 90.55},   {362.67, 90.93},  {364.53, 91.2},   {367, 91.55},
    {371.3, 92.2}};

struct CertifiedParameter {
  double value, standard_deviation;
};
constexpr CertifiedParameter kirby2_certified[] = {{1.6745063063E+00, 8.7989634338E-02},
                                                   {-1.3927397867E-01, 4.1182041386E-03},
                                                   {2.5961181191E-03, 4.1856520458E-05},
                                                   {-1.7241811870E-03, 5.8931897355E-05},
                                                   {2.1664802578E-05, 2.0129761919E-07}};
constexpr double kirby2_sum_of_squares = 3.9050739624E+00;

/// y = (b1 + b2 x + b3 x²)/(1 + b4 x + b5 x²), differentiated by Dual.
LeastSquaresProblem kirby2_problem(std::vector<double> start) {
  LeastSquaresProblem problem;
  problem.residual_count = std::size(kirby2);
  problem.names = {"b1", "b2", "b3", "b4", "b5"};
  problem.start = std::move(start);
  problem.lower.assign(5, -std::numeric_limits<double>::infinity());
  problem.upper.assign(5, std::numeric_limits<double>::infinity());
  problem.evaluate = [](std::span<const double> b, std::span<double> residuals, double* jacobian) {
    using D = Dual<dual_width>;
    std::array<D, 5> p;
    for (std::size_t k = 0; k < 5; ++k) p[k] = D::variable(b[k], static_cast<int>(k));
    for (std::size_t i = 0; i < std::size(kirby2); ++i) {
      const double x = kirby2[i].x;
      const D residual = (p[0] + p[1] * x + p[2] * (x * x)) / (1.0 + p[3] * x + p[4] * (x * x)) - kirby2[i].y;
      residuals[i] = residual.value;
      for (std::size_t k = 0; jacobian && k < 5; ++k) jacobian[5 * i + k] = residual.derivative[k];
    }
    return true;
  };
  return problem;
}

TEST(LeastSquares, MeetsTheCertifiedResultOfKirby2) {
  double worst_value = 0.0, worst_deviation = 0.0;
  for (const std::vector<double>& start :
       {std::vector{2.0, -0.1, 0.003, -0.001, 0.00001}, std::vector{1.5, -0.15, 0.0025, -0.0015, 0.00002}}) {
    const LeastSquaresSolution solution = solve(kirby2_problem(start), silent);
    EXPECT_TRUE(solution.converged) << solution.termination;
    EXPECT_TRUE(solution.identifiable) << remarks(solution);
    EXPECT_NEAR(solution.sum_of_squares / kirby2_sum_of_squares, 1.0, 1e-9);
    for (std::size_t k = 0; k < 5; ++k) {
      const CertifiedParameter& certified = kirby2_certified[k];
      const double value_error = std::abs(solution.variables[k].value / certified.value - 1.0);
      const double deviation_error =
          std::abs(solution.variables[k].misfit_standard_error / certified.standard_deviation - 1.0);
      EXPECT_LT(value_error, 1e-6) << "b" << k + 1;
      EXPECT_LT(deviation_error, 1e-6) << "b" << k + 1;
      worst_value = std::max(worst_value, value_error);
      worst_deviation = std::max(worst_deviation, deviation_error);
    }
    RecordProperty("iterations_from_" + number_text(start[0]), solution.iterations);
  }
  RecordProperty("worst_relative_error_of_parameters", number_text(worst_value));
  RecordProperty("worst_relative_error_of_deviations", number_text(worst_deviation));
}

TEST(LeastSquares, HoldsItsBounds) {
  // (x - 3)² + (y + 1)² on [0, 2] × [0, 5]: the optimum is the corner (2, 0), with y free of pull from x.
  LeastSquaresProblem problem;
  problem.residual_count = 2;
  problem.names = {"x", "y"};
  problem.start = {1.0, 1.0};
  problem.lower = {0.0, 0.0};
  problem.upper = {2.0, 5.0};
  bool inside = true;
  problem.evaluate = [&](std::span<const double> x, std::span<double> residuals, double* jacobian) {
    inside = inside && x[0] >= 0.0 && x[0] <= 2.0 && x[1] >= 0.0 && x[1] <= 5.0;
    residuals[0] = x[0] - 3.0, residuals[1] = x[1] + 1.0;
    if (jacobian) jacobian[0] = jacobian[3] = 1.0, jacobian[1] = jacobian[2] = 0.0;
    return true;
  };
  const LeastSquaresSolution solution = solve(problem, silent);
  EXPECT_DOUBLE_EQ(solution.variables[0].value, 2.0);
  EXPECT_DOUBLE_EQ(solution.variables[1].value, 0.0);
  EXPECT_TRUE(solution.variables[0].at_bound);
  EXPECT_TRUE(solution.variables[1].at_bound);
  EXPECT_DOUBLE_EQ(solution.sum_of_squares, 2.0);
  EXPECT_TRUE(inside) << "evaluated outside the bounds";
  EXPECT_NE(remarks(solution).find("x is at its bound 2"), std::string::npos) << remarks(solution);
}

TEST(LeastSquares, StopsWhenInterruptedOrThrownAt) {
  class Stop : public Monitor {
    void check() override { throw Interrupted(); }
  } stop;
  const std::vector<double> start{2.0, -0.1, 0.003, -0.001, 0.00001};
  expect_error(ExitCode::interrupted, "interrupted", [&] { solve(kirby2_problem(start), stop); });
  LeastSquaresProblem throwing = kirby2_problem(start);
  int calls = 0;
  throwing.evaluate = [&, inner = throwing.evaluate](std::span<const double> x, std::span<double> r, double* j) {
    if (++calls == 3) throw std::logic_error("mine");
    return inner(x, r, j);
  };
  EXPECT_THROW(solve(throwing, silent), std::logic_error);
}

TEST(Fits, EndWhereTheirMetricIsStationary) {
  // The metric, computed apart, may not fall to either side of the fitted constants. A wrong Jacobian, weight or slope
  // of a quantity ends elsewhere.
  const Table table = render_reference("correlated", {alphas(4)}, small_grid());
  const Model& model = find_model("proxima_unclamped");
  const ParameterValues start = model.defaults();
  for (const Quantity quantity : {Quantity::cosine, Quantity::brdf, Quantity::log, Quantity::cube_root}) {
    for (const char* weight_text : {"uniform", "sin_theta_i,sin_theta_o,cos_theta_i", "quadrature"}) {
      const std::vector<WeightFactor> factors = parse_weights(weight_text);
      const Fit result =
          fit(model, start, table, {.free = {"a", "b"}, .quantity = quantity, .weights = factors}, silent);
      ASSERT_TRUE(result.solution.converged) << result.solution.termination;
      const std::vector<double> weights = entry_weights(table, factors, quantity);
      const auto objective = [&](double a, double b) {
        double sum = 0.0;
        ParameterValues values = start;
        values.set("a", a);
        values.set("b", b);
        const TableModel on_table(model, values, table);
        for (std::size_t entry = 0; entry < table.entries(); ++entry) {
          const double cosine = table.wi(entry).z;
          const double difference = transform(quantity, on_table.evaluate(entry).x, cosine).value -
                                    transform(quantity, table.value(entry), cosine).value;
          sum += weights[entry] * difference * difference;
        }
        return sum;
      };
      const double a = value(result, "a"), b = value(result, "b"), best = objective(a, b), step = 2e-4;
      EXPECT_NEAR(best / result.solution.sum_of_squares, 1.0, 1e-9);
      EXPECT_NEAR(metric(result.metrics, quantity_names[static_cast<std::size_t>(quantity)]), std::sqrt(best),
                  1e-6 * std::sqrt(best));
      for (const auto& [da, db] : {std::pair{step, 0.0}, {0.0, step}}) {
        const double up = objective(a + da, b + db), down = objective(a - da, b - db);
        const double slope = (up - down) / (2.0 * step), curvature = (up - 2.0 * best + down) / (step * step);
        EXPECT_GT(curvature, 0.0);
        // By how much the optimum lies off.
        EXPECT_LT(std::abs(slope / curvature), 2e-6) << weight_text << ", quantity " << static_cast<int>(quantity);
      }
    }
  }
}

// ---- closed forms -----------------------------------------------------------------------------------------------

TEST(Fits, OfLambertAreMeans) {
  // With π f as the quantity the albedo is the weighted mean of the table, and all its errors are textbook.
  UniformNumbers uniform(6);
  Table table = lambertian_table([&](std::size_t) { return uniform.between(0.2, 0.8); });
  for (float& error : table.stderr_values) error = static_cast<float>(uniform.between(0.001, 0.02));
  table.valid[3] = table.valid[40] = 0;
  const Model& model = find_model("lambert");
  for (const bool by_variance : {false, true}) {
    const std::vector<WeightFactor> factors =
        by_variance ? std::vector{WeightFactor::inverse_variance} : std::vector<WeightFactor>{};
    const Fit result = fit(model, model.defaults(), table,
                           {.free = {"albedo"}, .quantity = Quantity::brdf, .weights = factors}, silent);
    double weight_sum = 0.0, mean = 0.0, variance = 0.0, squares = 0.0, count = 0.0;
    for (std::size_t entry = 0; entry < table.entries(); ++entry) {
      if (!table.valid[entry]) continue;
      const double error = pi * table.standard_error(entry), weight = by_variance ? 1.0 / (error * error) : 1.0;
      weight_sum += weight;
      mean += weight * pi * table.value(entry);
      variance += weight * weight * error * error;
      ++count;
    }
    mean /= weight_sum;
    variance /= weight_sum * weight_sum;
    for (std::size_t entry = 0; entry < table.entries(); ++entry) {
      const double error = pi * table.standard_error(entry), weight = by_variance ? 1.0 / (error * error) : 1.0;
      if (table.valid[entry]) squares += weight * std::pow(pi * table.value(entry) - mean, 2);
    }
    const FittedVariable& albedo = parameter(result, "albedo").estimate;
    // The solver stops where its cost no longer falls in double: half the digits of a parameter.
    EXPECT_NEAR(albedo.value, mean, 1e-8);
    EXPECT_NEAR(albedo.standard_error, std::sqrt(variance), 1e-6 * std::sqrt(variance));
    EXPECT_NEAR(albedo.misfit_standard_error, std::sqrt(squares / weight_sum / (count - 1.0)), 1e-9);
    // Errors of known size: the normal's 97.5 % quantile.
    EXPECT_NEAR(albedo.ci_high - albedo.value, 1.959963984540054 * albedo.standard_error, 1e-12);
    EXPECT_NEAR(albedo.value - albedo.ci_low, 1.959963984540054 * albedo.standard_error, 1e-12);
  }
}

TEST(Fits, TakeCorrelatedErrorsFromReplicates) {
  // Replicates that move all entries alike: the mean's error is that of one entry, whatever the entries' number.
  UniformNumbers uniform(7);
  Table table = lambertian_table([](std::size_t) { return 0.5; });
  table.replicates.assign(32 * table.values.size(), 0.0f);
  std::array<double, 32> shifts;
  for (double& shift : shifts) shift = uniform.between(-0.05, 0.05);
  const double mean_shift = std::accumulate(shifts.begin(), shifts.end(), 0.0) / 32.0;
  double squares = 0.0;
  for (double& shift : shifts) {
    shift -= mean_shift;
    squares += shift * shift;
  }
  for (std::size_t slot = 0; slot < table.replicates.size(); ++slot) {
    table.replicates[slot] = static_cast<float>((0.5 + shifts[slot / table.values.size()]) / pi);
  }
  const double error = std::sqrt(squares / (32.0 * 31.0));
  std::fill(table.stderr_values.begin(), table.stderr_values.end(), static_cast<float>(error / pi));
  const FitOptions options{.free = {"albedo"}, .quantity = Quantity::brdf};
  const Model& model = find_model("lambert");
  const FittedVariable with = parameter(fit(model, model.defaults(), table, options, silent), "albedo").estimate;
  EXPECT_NEAR(with.standard_error, error, 1e-6);
  // 32 replicates leave 31 degrees of freedom: Student's 97.5 % quantile.
  EXPECT_NEAR(with.ci_high - with.value, 2.039513446396408 * with.standard_error, 1e-9);
  // Without them entries count as independent, and the error comes out √n too small.
  table.replicates.clear();
  const FittedVariable without = parameter(fit(model, model.defaults(), table, options, silent), "albedo").estimate;
  EXPECT_NEAR(without.standard_error, error / std::sqrt(static_cast<double>(table.entries())), 1e-6);
}

TEST(Fits, StateHowFarTheirConstantsMoveWithTheData) {
  // An error in one entry alone: the standard error is what the constant moves when that entry does, and refitting
  // tells. With models that are not linear and do not meet the table, JᵀJ alone would get this wrong.
  const Table clean = render_reference("correlated", {}, small_grid());
  struct Case {
    const char* model;
    const char* constant;
    Quantity quantity;
    Loss loss;
  };
  for (const Case& c : {Case{"oren_nayar", "sigma", Quantity::cosine, Loss::none},
                        Case{"oren_nayar", "sigma", Quantity::log, Loss::none},
                        Case{"oren_nayar", "sigma", Quantity::cube_root, Loss::none},
                        Case{"hammon", "alpha", Quantity::cosine, Loss::cauchy}}) {
    const Model& model = find_model(c.model);
    const FitOptions options{.free = {c.constant}, .quantity = c.quantity, .loss = c.loss, .loss_scale = 0.05};
    const Fit start = fit(model, model.defaults(), clean, options, silent);
    ASSERT_FALSE(parameter(start, c.constant).estimate.at_bound) << c.model;
    for (const std::size_t entry : {std::size_t{2}, std::size_t{40}, std::size_t{87}, std::size_t{130}}) {
      const auto constant_with = [&](float entry_value) {
        Table moved = clean;
        moved.values[entry] = entry_value;
        return value(fit(model, start.values(), moved, options, silent), c.constant);
      };
      const float error = 1e-3f * clean.value(entry);
      const float up = clean.value(entry) + 5.0f * error, down = clean.value(entry) - 5.0f * error;
      const double slope = (constant_with(up) - constant_with(down)) / (static_cast<double>(up) - down);
      Table table = clean;
      table.stderr_values[entry] = error;
      const double stated =
          parameter(fit(model, start.values(), table, options, silent), c.constant).estimate.standard_error;
      EXPECT_NEAR(stated / (std::abs(slope) * error), 1.0, 0.01) << c.model << ", entry " << entry;
    }
  }
}

TEST(Fits, OfUnclampedProximaAreLinearLeastSquares) {
  // On the slice V = N the fade is 1 and f μi π - μi = a α μi + b α: two columns, solved by Eigen. formulas.md §2 has
  // the result for Smith-correlated masking.
  const Table table = render_reference("correlated", {alphas(20)}, normal_slice());
  const auto n = static_cast<Eigen::Index>(table.entries());
  Eigen::MatrixXd columns(n, 2);
  Eigen::VectorXd target(n);
  for (Eigen::Index row = 0; row < n; ++row) {
    const auto entry = static_cast<std::size_t>(row);
    const double cosine = table.wi(entry).z, alpha = table.parameter_values(table.parameter_row(entry))[0];
    columns.row(row) << alpha * cosine, alpha;
    target[row] = table.value(entry) * cosine * pi - cosine;
  }
  const Eigen::VectorXd truth = columns.colPivHouseholderQr().solve(target);
  const double residual = std::sqrt((columns * truth - target).squaredNorm() / static_cast<double>(n));
  const Eigen::MatrixXd covariance = (columns.transpose() * columns).inverse();

  const Model& model = find_model("proxima_unclamped");
  const Fit result = fit(model, model.defaults(), table, {.free = {"a", "b"}, .quantity = Quantity::cosine}, silent);
  EXPECT_NEAR(value(result, "a"), truth[0], 1e-9);
  EXPECT_NEAR(value(result, "b"), truth[1], 1e-9);
  EXPECT_NEAR(std::sqrt(result.solution.sum_of_squares), residual, 1e-12);
  EXPECT_NEAR(truth[0], -0.2897, 5e-5);
  EXPECT_NEAR(truth[1], -0.0695, 5e-5);
  // The misfit's errors and correlation are those of linear regression.
  const double variance = residual * residual * static_cast<double>(n) / static_cast<double>(n - 2);
  EXPECT_NEAR(parameter(result, "a").estimate.misfit_standard_error, std::sqrt(variance * covariance(0, 0)), 1e-9);
  EXPECT_NEAR(parameter(result, "b").estimate.misfit_standard_error, std::sqrt(variance * covariance(1, 1)), 1e-9);
  EXPECT_NEAR(result.solution.correlation[0][1], covariance(0, 1) / std::sqrt(covariance(0, 0) * covariance(1, 1)),
              1e-9);
  EXPECT_EQ(result.solution.correlation[0][0], 1.0);
  // An exact table has no error of its own.
  EXPECT_EQ(parameter(result, "a").estimate.standard_error, 0.0);
}

// ---- recovery ---------------------------------------------------------------------------------------------------

struct KnownConstants {
  const char* model;
  std::vector<std::pair<std::string, double>> constants;
};

TEST(Fits, GiveKnownConstantsBack) {
  const KnownConstants cases[] = {{"lambert", {{"albedo", 0.37}}},
                                  {"burley", {{"albedo", 0.6}, {"roughness", 0.8}}},
                                  {"oren_nayar", {{"albedo", 0.45}, {"sigma", 0.7}}},
                                  {"eon", {{"albedo", 0.7}, {"roughness", 0.25}}},
                                  {"chan_2018", {{"albedo", 0.5}, {"roughness", 0.75}}},
                                  {"chan_2024", {{"albedo", 0.5}, {"roughness", 0.8}}},
                                  {"hammon", {{"albedo", 0.8}, {"alpha", 0.3}}},
                                  {"proxima", {{"albedo", 0.9}, {"a", -0.3}, {"b", 0.08}, {"exponent", 0.9}}}};
  for (const KnownConstants& known : cases) {
    const Model& model = find_model(known.model);
    ParameterValues values = model.defaults();
    FitOptions options{.starts = 3};
    for (const auto& [name, constant] : known.constants) {
      values.set(name, constant);
      options.free.push_back(name);
    }
    const std::vector<Axis> axes = known.model == std::string("proxima") ? std::vector{alphas(4)} : std::vector<Axis>{};
    const Table table = render_model(known.model, values, small_grid(), axes);
    for (const Quantity quantity : {Quantity::log, Quantity::cosine, Quantity::brdf, Quantity::cube_root}) {
      options.quantity = quantity;
      const Fit result = fit(model, model.defaults(), table, options, silent);
      EXPECT_TRUE(result.solution.converged) << known.model << ": " << result.solution.termination;
      EXPECT_TRUE(result.solution.identifiable) << known.model << ": " << remarks(result.solution);
      for (const auto& [name, constant] : known.constants) {
        // The table's floats are good to 6e-8.
        EXPECT_NEAR(value(result, name), constant, 1e-5)
            << known.model << ", quantity " << static_cast<int>(quantity) << ", " << name;
        EXPECT_TRUE(parameter(result, name).free);
      }
      EXPECT_LT(std::sqrt(result.solution.sum_of_squares), 1e-6);
    }
  }
}

TEST(Fits, FollowTheAxesOfTheTable) {
  // The table's alpha drives the model's roughness: only the albedo is left.
  Table table = render_model("burley", find_model("burley").defaults(), small_grid(),
                             {{"roughness", "", {0.2, 0.6, 1.0}, false}});
  table.parameter_axes[0] = {"alpha", "", {0.04, 0.36, 1.0}, false};
  ParameterValues start = find_model("burley").defaults();
  start.set("albedo", 0.2);
  const Fit result = fit(find_model("burley"), start, table, {.free = {"albedo"}}, silent);
  EXPECT_NEAR(value(result, "albedo"), 1.0, 1e-6);
  EXPECT_THROW(parameter(result, "roughness"), std::runtime_error) << "what an axis sets is no parameter of the fit";
  EXPECT_EQ(free_parameters(start, table, {}, Tier::full), std::vector<std::string>{"albedo"});
}

TEST(Fits, GiveColoursBackChannelByChannel) {
  const Model& model = find_model("burley");
  ParameterValues values = model.defaults();
  values.set("albedo", std::array{0.2, 0.5, 0.8});
  values.set("roughness", 0.7);
  const Table table = render_model("burley", values);
  ASSERT_EQ(table.channels, 3);
  const Fit result = fit(model, model.defaults(), table, {.free = {"albedo", "roughness"}}, silent);
  ASSERT_EQ(result.parameters.size(), 4u);
  EXPECT_NEAR(value(result, "albedo.r"), 0.2, 1e-6);
  EXPECT_NEAR(value(result, "albedo.g"), 0.5, 1e-6);
  EXPECT_NEAR(value(result, "albedo.b"), 0.8, 1e-6);
  EXPECT_NEAR(value(result, "roughness"), 0.7, 1e-5);
  for (const FitMetric& m : result.metrics) EXPECT_LT(m.value, 1e-3) << m.name;
  // A scalar of a grey fit is one number.
  const Fit grey = fit(model, model.defaults(), render_model("burley", model.defaults()), {.free = {"albedo"}}, silent);
  EXPECT_NO_THROW(parameter(grey, "albedo"));
}

TEST(Fits, IgnoreWhatIsMasked) {
  Table table = lambertian_table([](std::size_t) { return 0.4; });
  table.values[7] = std::nanf("");
  table.values[8] = 1e30f;
  table.valid[7] = table.valid[8] = 0;
  const Fit result = fit(find_model("lambert"), find_model("lambert").defaults(), table, {.free = {"albedo"}}, silent);
  EXPECT_NEAR(value(result, "albedo"), 0.4, 1e-6);
  for (const FitMetric& m : result.metrics) EXPECT_LT(m.value, 1e-5) << m.name;
}

// ---- bounds and identifiability ---------------------------------------------------------------------------------

TEST(Fits, NameParametersAtTheirBounds) {
  // Brighter than any albedo.
  const Table table = lambertian_table([](std::size_t) { return 1.5; });
  const Fit result = fit(find_model("lambert"), find_model("lambert").defaults(), table, {.free = {"albedo"}}, silent);
  EXPECT_EQ(value(result, "albedo"), 1.0);
  EXPECT_TRUE(parameter(result, "albedo").estimate.at_bound);
  EXPECT_NE(remarks(result.solution).find("albedo is at its bound 1"), std::string::npos) << remarks(result.solution);
  const Json json = result.json("", "");
  EXPECT_EQ(json["params"][0]["at_bound"], true);
  EXPECT_EQ(json["params"][0]["free"], true);
}

TEST(Fits, NameParametersWithoutEffect) {
  // On V = N the exponent of Proxima's fade acts on 0.
  const Table table = render_reference("view_only", {alphas(5)}, normal_slice());
  const Model& model = find_model("proxima");
  const FitOptions two{.free = {"a", "b"}, .quantity = Quantity::cosine};
  const FitOptions three{.free = {"a", "b", "exponent"}, .quantity = Quantity::cosine};
  const Fit with = fit(model, model.defaults(), table, three, silent);
  EXPECT_FALSE(with.solution.identifiable);
  EXPECT_FALSE(parameter(with, "exponent").estimate.identifiable);
  EXPECT_TRUE(parameter(with, "a").estimate.identifiable);
  EXPECT_TRUE(parameter(with, "b").estimate.identifiable);
  EXPECT_NEAR(value(with, "exponent"), 0.5, 1e-9) << "a parameter without effect stays where it was";
  EXPECT_NE(remarks(with.solution).find("exponent has no effect"), std::string::npos) << remarks(with.solution);
  // And it does not disturb the others, nor their errors.
  const Fit without = fit(model, model.defaults(), table, two, silent);
  EXPECT_TRUE(without.solution.identifiable);
  EXPECT_NEAR(value(with, "a"), value(without, "a"), 1e-9);
  EXPECT_NEAR(value(with, "b"), value(without, "b"), 1e-9);
  EXPECT_NEAR(
      parameter(with, "a").estimate.misfit_standard_error / parameter(without, "a").estimate.misfit_standard_error, 1.0,
      0.01);
  EXPECT_EQ(with.json("", "")["identifiable"], false);
  EXPECT_EQ(with.json("", "")["params"].back()["identifiable"], false);
}

TEST(Fits, NameCombinationsThatTheDataLeaveOpen) {
  // Proxima knows α a and α b only: at one α all three can't be told.
  const Model& model = find_model("proxima");
  ParameterValues values = model.defaults();
  const Table table = render_model("proxima", values);
  values.set("alpha", 0.4);
  const Fit result = fit(model, values, table, {.free = {"alpha", "a", "b"}, .quantity = Quantity::cosine}, silent);
  EXPECT_FALSE(result.solution.identifiable);
  for (const char* name : {"alpha", "a", "b"}) EXPECT_FALSE(parameter(result, name).estimate.identifiable) << name;
  EXPECT_NE(remarks(result.solution).find("don't decide"), std::string::npos) << remarks(result.solution);
  // What is decided is right.
  EXPECT_NEAR(value(result, "alpha") * value(result, "a"), 0.5 * -0.55, 1e-5);
  EXPECT_NEAR(value(result, "alpha") * value(result, "b"), 0.5 * 0.19, 1e-5);
  // The exponent does not take part in it.
  const Fit four =
      fit(model, values, table, {.free = {"alpha", "a", "b", "exponent"}, .quantity = Quantity::cosine}, silent);
  EXPECT_TRUE(parameter(four, "exponent").estimate.identifiable) << remarks(four.solution);
  EXPECT_FALSE(parameter(four, "a").estimate.identifiable);
}

TEST(Fits, NameCombinationsThatEndAtABound) {
  // Above roughness 0.5 Chan 2024 spans two functions with three parameters: any albedo meets the same table. Where the
  // search stops at a bound of one of them, the others are no better known than before.
  const Model& model = find_model("chan_2024");
  ParameterValues values = model.defaults();
  values.set("albedo", 0.5);
  values.set("roughness", 0.8);
  values.set("multiple_scattering", 0.6);
  const Table table = render_model("chan_2024", values);
  const Fit result =
      fit(model, model.defaults(), table,
          {.free = {"albedo", "roughness", "multiple_scattering"}, .quantity = Quantity::cosine}, silent);
  EXPECT_LT(std::sqrt(result.solution.sum_of_squares), 1e-6);
  EXPECT_FALSE(result.solution.identifiable) << "albedo " << value(result, "albedo") << " is not 0.5";
}

TEST(Fits, ReportEveryVariableWithoutEffect) {
  // A black table of a black model: nothing at all can be told.
  const Model& model = find_model("burley");
  ParameterValues values = model.defaults();
  values.set("albedo", 0.0);
  const Fit result = fit(model, values, render_model("burley", values), {.free = {"roughness"}}, silent);
  EXPECT_FALSE(result.solution.identifiable);
  EXPECT_FALSE(parameter(result, "roughness").estimate.identifiable);
}

// ---- options ----------------------------------------------------------------------------------------------------

TEST(Fits, HoldOutWhatTheyDoNotSee) {
  UniformNumbers uniform(8);
  const Table table =
      lambertian_table([&](std::size_t) { return uniform.between(0.2, 0.8); }, Grid::named_or_file("small"));
  const auto entries = static_cast<double>(table.entries());
  const Model& model = find_model("lambert");
  FitOptions options{.free = {"albedo"}, .quantity = Quantity::brdf, .holdout = 0.3};
  const Fit result = fit(model, model.defaults(), table, options, silent);
  ASSERT_EQ(result.holdout.size(), result.metrics.size());
  // Mean squares over the kept and the held-out entries average to that over all, in proportion to their numbers.
  double all = 0.0;
  for (std::size_t entry = 0; entry < table.entries(); ++entry) {
    all += std::pow(pi * table.value(entry) - value(result, "albedo"), 2) / entries;
  }
  const double kept = std::pow(metric(result.metrics, "brdf"), 2), held = std::pow(metric(result.holdout, "brdf"), 2);
  const double count = entries * (all - kept) / (held - kept);
  EXPECT_NEAR(count, std::round(count), 0.05) << "not a number of entries";
  // Binomial, ±5 standard deviations: one seed in two million would fail.
  EXPECT_NEAR(count, 0.3 * entries, 5.0 * std::sqrt(0.3 * 0.7 * entries));
  // The fit is the mean over the kept entries, so it differs from that over all, and with the seed.
  const Fit whole = fit(model, model.defaults(), table, {.free = {"albedo"}, .quantity = Quantity::brdf}, silent);
  EXPECT_TRUE(whole.holdout.empty());
  EXPECT_NE(value(whole, "albedo"), value(result, "albedo"));
  options.seed = 2;
  EXPECT_NE(value(fit(model, model.defaults(), table, options, silent), "albedo"), value(result, "albedo"));
  expect_error(ExitCode::usage, "--holdout",
               [&] { fit(model, model.defaults(), table, {.free = {"albedo"}, .holdout = 1.0}, silent); });
}

TEST(Fits, OfAnExactModelPredictWhatIsHeldOut) {
  ParameterValues values = find_model("eon").defaults();
  values.set("roughness", 0.8);
  const Fit result = fit(find_model("eon"), find_model("eon").defaults(), render_model("eon", values),
                         {.free = {"roughness"}, .holdout = 0.5}, silent);
  for (const FitMetric& m : result.holdout) EXPECT_LT(m.value, 1e-3) << m.name;
  EXPECT_LT(metric(result.holdout, "cosine"), 1e-6);
}

TEST(Fits, AreNeverWorseWithMoreStarts) {
  // From a poor start, on a table the model can't meet.
  const Table table = render_reference("correlated", {}, small_grid());
  for (const char* name : {"burley", "oren_nayar", "chan_2018", "chan_2024", "hammon", "proxima"}) {
    const Model& model = find_model(name);
    ParameterValues start = model.defaults();
    FitOptions options;
    for (const ParameterInfo& info : start.list()) {
      start.set(info.name, info.lower + 0.98 * (info.upper - info.lower));
      if (info.name != "alpha" || name != std::string("proxima")) options.free.emplace_back(info.name);
    }
    double previous = std::numeric_limits<double>::infinity();
    for (const int starts : {1, 2, 4, 8}) {
      options.starts = starts;
      const Fit result = fit(model, start, table, options, silent);
      EXPECT_LE(result.solution.sum_of_squares, previous) << name << ", " << starts << " starts";
      EXPECT_EQ(result.starts_tried, starts);
      previous = result.solution.sum_of_squares;
    }
  }
}

TEST(Fits, FindTheBetterValleyWithMoreStarts) {
  // Two clusters of entries under Cauchy's loss: the start lies nearer the smaller one.
  const Table table = lambertian_table([](std::size_t entry) { return entry % 5 < 3 ? 0.2 : 0.9; });
  const Model& model = find_model("lambert");
  FitOptions options{.free = {"albedo"}, .quantity = Quantity::brdf, .loss = Loss::cauchy, .loss_scale = 0.02};
  EXPECT_NEAR(value(fit(model, model.defaults(), table, options, silent), "albedo"), 0.9, 0.01);
  options.starts = 8;
  EXPECT_NEAR(value(fit(model, model.defaults(), table, options, silent), "albedo"), 0.2, 0.01);
}

/// A table of albedo 0.5 in which every tenth entry says 0.9.
Table table_with_outliers() {
  return lambertian_table([](std::size_t entry) { return entry % 10 == 0 ? 0.9 : 0.5; });
}

TEST(Fits, RobustLossesResistOutliers) {
  const Table table = table_with_outliers();
  double outliers = 0.0;
  for (std::size_t entry = 0; entry < table.entries(); entry += 10) ++outliers;
  const double inliers = static_cast<double>(table.entries()) - outliers;
  const Model& model = find_model("lambert");
  const auto albedo = [&](Loss loss, double scale) {
    return value(fit(model, model.defaults(), table,
                     {.free = {"albedo"}, .quantity = Quantity::brdf, .loss = loss, .loss_scale = scale}, silent),
                 "albedo");
  };
  EXPECT_NEAR(albedo(Loss::none, 0.05), (0.5 * inliers + 0.9 * outliers) / (inliers + outliers), 1e-7);
  // Huber: outliers pull with the constant force `scale`, inliers with their distance.
  EXPECT_NEAR(albedo(Loss::huber, 0.05), 0.5 + 0.05 * outliers / inliers, 1e-7);
  EXPECT_NEAR(albedo(Loss::huber, 0.02), 0.5 + 0.02 * outliers / inliers, 1e-7);
  // Beyond all residuals Huber is the plain square.
  EXPECT_NEAR(albedo(Loss::huber, 10.0), albedo(Loss::none, 1.0), 1e-7);
  // Cauchy: forces r/(1 + r²/scale²) balance; found by bisection.
  const auto force = [](double r) { return r / (1.0 + r * r / (0.05 * 0.05)); };
  double low = 0.5, high = 0.52;
  for (int step = 0; step < 60; ++step) {
    const double middle = 0.5 * (low + high);
    (inliers * force(middle - 0.5) > outliers * force(0.9 - middle) ? high : low) = middle;
  }
  EXPECT_NEAR(albedo(Loss::cauchy, 0.05), low, 1e-7);
}

TEST(Fits, RobustErrorsAreThoseOfTheRobustEstimate) {
  // Under Huber's loss outliers pull with a constant force, so that their own noise moves nothing: the estimate's error
  // is that of the inliers' mean.
  Table table = table_with_outliers();
  std::fill(table.stderr_values.begin(), table.stderr_values.end(), static_cast<float>(0.001 / pi));
  double inliers = 0.0;
  for (std::size_t entry = 0; entry < table.entries(); ++entry) inliers += entry % 10 == 0 ? 0.0 : 1.0;
  const Model& model = find_model("lambert");
  const Fit result =
      fit(model, model.defaults(), table,
          {.free = {"albedo"}, .quantity = Quantity::brdf, .loss = Loss::huber, .loss_scale = 0.2}, silent);
  const double truth = 0.001 / std::sqrt(inliers), error = parameter(result, "albedo").estimate.standard_error;
  EXPECT_NEAR(error / truth, 1.0, 1e-3);
}

TEST(Fits, RefuseWhatCannotBeFree) {
  const Table table = render_reference("correlated", {alphas(2)}, small_grid());
  const Model& model = find_model("proxima");
  const auto with = [&](std::vector<std::string> free, std::vector<AxisMapping> mappings = {}) {
    fit(model, model.defaults(), table, {.free = std::move(free), .mappings = std::move(mappings)}, silent);
  };
  expect_error(ExitCode::usage, "did you mean 'exponent'", [&] { with({"a", "exponnent"}); });
  expect_error(ExitCode::usage, "axis", [&] { with({"alpha"}); });
  expect_error(ExitCode::usage, "twice", [&] { with({"a", "b", "a"}); });
  expect_error(ExitCode::usage, "axis", [&] { with({"a"}, {AxisMapping::parse("a=alpha")}); });
  Table masked = table;
  std::fill(masked.valid.begin(), masked.valid.end(), std::uint8_t{0});
  expect_error(ExitCode::invalid_input, "masked",
               [&] { fit(model, model.defaults(), masked, {.free = {"a"}}, silent); });
}

TEST(Fits, OfNothingScoreTheModelAsItIs) {
  const Table table = render_reference("correlated", {alphas(2)}, small_grid());
  const Model& model = find_model("proxima");
  const Fit result = fit(model, model.defaults(), table, {.quantity = Quantity::cosine}, silent);
  EXPECT_TRUE(result.solution.converged);
  EXPECT_TRUE(result.solution.identifiable);
  EXPECT_EQ(value(result, "a"), -0.55);
  const std::vector<float> values = TableModel(model, model.defaults(), table).render().values;
  EXPECT_NEAR(metric(result.metrics, "cosine"),
              rms_difference(table, values, Quantity::cosine, entry_weights(table, {}, Quantity::cosine)), 1e-12);
}

TEST(Fits, ReportWhenTheyAreInterrupted) {
  class Stop : public Monitor {
    void check() override { throw Interrupted(); }
  } stop;
  const Table table = lambertian_table([](std::size_t) { return 0.4; });
  ::testing::internal::CaptureStderr();
  expect_error(ExitCode::interrupted, "interrupted", [&] {
    fit(find_model("lambert"), find_model("lambert").defaults(), table, {.free = {"albedo"}}, stop);
  });
  // What the user asked for is no error of the solver: its log stays out of the terminal.
  EXPECT_EQ(::testing::internal::GetCapturedStderr(), "");
}

TEST(Fits, AreTheSameBitsForAnyNumberOfThreads) {
  // Several batches per parameter row.
  const Table table =
      render_reference("correlated", {alphas(3)}, Grid::named_or_file("default"), {.sampling = {.samples = 64}});
  const Model& model = find_model("proxima");
  std::vector<std::string> documents;
  for (const std::size_t threads : {1, 2, 2}) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    const FitOptions options{.free = {"a", "b", "exponent"}, .loss = Loss::huber, .starts = 3, .holdout = 0.2};
    documents.push_back(fit(model, model.defaults(), table, options, silent).json("", "").dump());
  }
  EXPECT_EQ(documents[1], documents[0]);
  EXPECT_EQ(documents[2], documents[0]);
}

// ---- files ------------------------------------------------------------------------------------------------------

Fit example_fit() {
  const Model& model = find_model("burley");
  ParameterValues values = model.defaults();
  values.set("albedo", std::array{0.2, 0.5, 0.8});
  Table table = render_model("burley", values);
  std::fill(table.stderr_values.begin(), table.stderr_values.end(), 0.001f);
  return fit(model, model.defaults(), table, {.free = {"albedo"}, .weights = parse_weights("sin_theta_i"), .seed = 5},
             silent);
}

TEST(FitFiles, HaveTheContractsFields) {
  const Json json = example_fit().json("lobefit fit …", "0123");
  EXPECT_EQ(json["model"], "burley");
  ASSERT_EQ(json["params"].size(), 4u);
  for (const Json& p : json["params"]) {
    for (const char* field :
         {"name", "value", "stderr", "ci95", "misfit_stderr", "lower", "upper", "at_bound", "free"}) {
      EXPECT_TRUE(p.contains(field)) << field;
    }
    EXPECT_EQ(p["ci95"].size(), 2u);
    EXPECT_LE(p["ci95"][0], p["value"]);
    EXPECT_GE(p["ci95"][1], p["value"]);
  }
  for (const char* name : {"cosine", "brdf", "log", "cube_root"}) EXPECT_TRUE(json["metrics"].contains(name)) << name;
  EXPECT_TRUE(json["holdout"].is_object());
  EXPECT_EQ(json["correlation"].size(), 3u) << "of the free numbers";
  EXPECT_EQ(json["identifiable"], true);
  EXPECT_EQ(json["solver"]["converged"], true);
  EXPECT_EQ(json["provenance"]["command"], "lobefit fit …");
  EXPECT_EQ(json["provenance"]["table_sha256"], "0123");
  EXPECT_EQ(json["provenance"]["seed"], 5);
  EXPECT_FALSE(json["provenance"]["version"].get<std::string>().empty());
}

TEST(FitFiles, RoundTripTheirModel) {
  const Fit result = example_fit();
  const Fit back = Fit::from_json(parse_json(result.json("", "").dump(), "fit.json"), "fit.json");
  EXPECT_EQ(back.model, result.model);
  ASSERT_EQ(back.parameters.size(), result.parameters.size());
  for (std::size_t i = 0; i < back.parameters.size(); ++i) {
    const FitParameter &a = back.parameters[i], &b = result.parameters[i];
    EXPECT_EQ(a.name, b.name);
    EXPECT_EQ(a.free, b.free);
    EXPECT_EQ(a.lower, b.lower);
    EXPECT_EQ(a.upper, b.upper);
    EXPECT_EQ(a.estimate.value, b.estimate.value);
    EXPECT_EQ(a.estimate.standard_error, b.estimate.standard_error);
    EXPECT_EQ(a.estimate.ci_low, b.estimate.ci_low);
    EXPECT_EQ(a.estimate.ci_high, b.estimate.ci_high);
    EXPECT_EQ(a.estimate.misfit_standard_error, b.estimate.misfit_standard_error) << a.name;
    EXPECT_EQ(a.estimate.at_bound, b.estimate.at_bound);
    EXPECT_EQ(a.estimate.identifiable, b.estimate.identifiable);
  }
  EXPECT_TRUE(std::ranges::equal(back.values().flat(), result.values().flat()));
  // Mappings are part of the model that was fitted.
  const Table table = render_reference("correlated", {alphas(2)}, small_grid());
  const Fit mapped = fit(find_model("eon"), find_model("eon").defaults(), table,
                         {.free = {"albedo"}, .mappings = {AxisMapping::parse("roughness=0.4*alpha^0.5")}}, silent);
  const Fit mapped_back = Fit::from_json(mapped.json("", ""), "fit.json");
  ASSERT_EQ(mapped_back.mappings.size(), 1u);
  EXPECT_EQ(mapped_back.mappings[0].parameter, "roughness");
  EXPECT_EQ(mapped_back.mappings[0].axis, "alpha");
  EXPECT_EQ(mapped_back.mappings[0].scale, 0.4);
  EXPECT_EQ(mapped_back.mappings[0].power, 0.5);
}

TEST(FitFiles, KeepWhatIsNotIdentifiable) {
  const Table table = render_reference("view_only", {alphas(3)}, normal_slice());
  const Model& model = find_model("proxima");
  const Fit result = fit(model, model.defaults(), table, {.free = {"a", "b", "exponent"}}, silent);
  const Fit back = Fit::from_json(result.json("", ""), "fit.json");
  EXPECT_FALSE(parameter(back, "exponent").estimate.identifiable);
}

TEST(FitFiles, ComplaintsNameTheirPlace) {
  const Json good = example_fit().json("", "");
  const Json scalar =
      Json::parse(fit(find_model("proxima"), find_model("proxima").defaults(),
                      render_model("proxima", find_model("proxima").defaults()), {.free = {"a"}}, silent)
                      .json("", "")
                      .dump());
  ASSERT_NO_THROW(Fit::from_json(good, "fit.json"));
  ASSERT_NO_THROW(Fit::from_json(scalar, "fit.json"));
  const auto expect_refused = [](const Json& json, const std::string& fragment, const std::string& what) {
    expect_error(
        ExitCode::invalid_input, fragment, [&] { Fit::from_json(json, "fit.json"); }, what);
    expect_error(
        ExitCode::invalid_input, "fit.json", [&] { Fit::from_json(json, "fit.json"); }, what);
  };
  const auto broken = [](Json json, const char* pointer, const Json& replacement) {
    json[Json::json_pointer(pointer)] = replacement;
    return json;
  };
  expect_refused(Json::array(), "$", "a list");
  expect_refused(Json::object(), "missing 'model'", "empty");
  expect_refused(broken(good, "/model", "burlay"), "did you mean 'burley'", "unknown model");
  expect_refused(broken(good, "/model", 3), "$.model", "model is a number");
  expect_refused(broken(good, "/params", 3), "$.params", "params is a number");
  expect_refused(broken(good, "/params/0/name", "albdeo.r"), "did you mean 'albedo'", "unknown parameter");
  expect_refused(broken(good, "/params/0/value", nullptr), "$.params[0].value", "value is null");
  expect_refused(broken(good, "/params/0/value", "0.5"), "$.params[0].value", "value is a text");
  expect_refused(broken(good, "/params/0/ci95", Json{0.1}), "$.params[0].ci95", "half an interval");
  expect_refused(broken(good, "/params/3/value", 7.0), "out of range", "roughness 7");
  // Channels: of a number there are none, and of a colour three.
  expect_refused(broken(good, "/params/0/value", 7.0), "out of range", "red 7");
  expect_refused(broken(good, "/params/0/name", "albedo.x"), "albedo.x", "channel x");
  expect_refused(broken(scalar, "/params/4/name", "exponent.b"), "exponent.b", "a channel of a number");
}

}  // namespace
}  // namespace lobefit
