// Intervals that keep their promise: over many seeds the 95 % interval of a fitted constant covers the truth in 95 % of
// cases, where the model meets the data and where it does not, for independent entries and for rows that share facets.
//
// 200 seeds each. Of intervals that cover with probability 0.95, 200 cover between 180 and 196 times (90 to 98 %) for
// 99.0 % of all choices of seeds (binomial); the seeds are fixed. The sharper test is on the standardised errors: their
// squares, mapped to normals, sum to chi-squared, and one choice of seeds in a million fails it, with errors that are
// too small or too large by more than a quarter.
#include <gtest/gtest.h>

#include <boost/math/distributions/chi_squared.hpp>
#include <boost/math/distributions/normal.hpp>
#include <boost/math/distributions/students_t.hpp>
#include <cmath>

#include "fit/fit.h"
#include "reference/render.h"
#include "tests/directions.h"

namespace lobefit {
namespace {

constexpr int seeds = 200;
constexpr double false_alarm = 1e-6;

Monitor silent;

Axis axis(const std::string& name, std::vector<double> values) { return {name, "degree", std::move(values), false}; }

Grid grid() {
  return {axis("theta_i", {0.0, 20.0, 40.0, 60.0, 75.0, 85.0}), axis("theta_o", {0.0, 35.0, 70.0}),
          axis("phi", {0.0, 60.0, 120.0, 180.0})};
}

/// How often intervals covered their truth, and how the standardised errors spread.
class Coverage {
 public:
  /// `degrees_of_freedom` behind the standard error; 0 means it is known.
  Coverage(double truth, int degrees_of_freedom) : truth_(truth), degrees_of_freedom_(degrees_of_freedom) {}

  void add(const FittedVariable& estimate) {
    ++count_;
    if (estimate.ci_low <= truth_ && truth_ <= estimate.ci_high) ++covered_;
    double z = (estimate.value - truth_) / estimate.standard_error;
    if (degrees_of_freedom_ > 0) {
      // From Student's t to the normal; through the smaller tail, which keeps its digits.
      const double tail = boost::math::cdf(boost::math::students_t(degrees_of_freedom_), -std::abs(z));
      z = std::copysign(boost::math::quantile(boost::math::normal(), std::max(tail, 1e-300)), z);
    }
    squares_ += z * z;
  }

  double rate() const { return static_cast<double>(covered_) / count_; }

  void expect_honest(const std::string& what) const {
    ::testing::Test::RecordProperty("coverage of " + what, number_text(rate()));
    ::testing::Test::RecordProperty("mean square of standardised errors of " + what, number_text(squares_ / count_));
    EXPECT_GE(rate(), 0.90) << what;
    EXPECT_LE(rate(), 0.98) << what;
    const boost::math::chi_squared chi_squared(count_);
    EXPECT_LT(squares_, boost::math::quantile(boost::math::complement(chi_squared, false_alarm)))
        << what << ": errors are too small";
    EXPECT_GT(squares_, boost::math::quantile(chi_squared, false_alarm)) << what << ": errors are too large";
  }

 private:
  double truth_;
  int degrees_of_freedom_;
  int count_ = 0, covered_ = 0;
  double squares_ = 0.0;
};

const FittedVariable& estimate(const Fit& fit, std::string_view name) {
  for (const FitParameter& p : fit.parameters) {
    if (p.name == name) return p.estimate;
  }
  throw std::runtime_error("no parameter " + std::string(name));
}

/// Proxima's constants on shadowed facets, which it can't meet: the misfit exceeds the noise.
class ProximaOnShadowedFacets : public ::testing::Test {
 protected:
  Table render(const RenderOptions& options) const {
    return lobefit::render(reference_, reference_.defaults(), {Axis{"alpha", "", {0.3, 0.6, 1.0}, false}}, grid(),
                           options, silent);
  }
  Fit fit(const Table& table, Quantity quantity = Quantity::cosine) const {
    return lobefit::fit(model_, model_.defaults(), table, {.free = {"a", "b"}, .quantity = quantity}, silent);
  }

  const Reference& reference_ = find_reference("microfacet_diffuse");
  const Model& model_ = find_model("proxima");
  const Fit truth_ = fit(render({.exact = true}));
};

TEST_F(ProximaOnShadowedFacets, IndependentEntries) {
  // Each entry has its own facets; its error's own uncertainty averages out over hundreds of entries.
  Coverage a(estimate(truth_, "a").value, 0), b(estimate(truth_, "b").value, 0);
  for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
    const Table table = render({.sampling = {.samples = 256, .seed = seed}, .shared_facets = false});
    ASSERT_TRUE(table.replicates.empty());
    const Fit result = fit(table);
    // Or else the truth would be met by a model without misfit, and nothing new would be shown.
    ASSERT_GT(std::sqrt(result.solution.sum_of_squares), 0.02);
    a.add(estimate(result, "a"));
    b.add(estimate(result, "b"));
  }
  a.expect_honest("a");
  b.expect_honest("b");
}

TEST_F(ProximaOnShadowedFacets, RowsThatShareFacets) {
  Coverage a(estimate(truth_, "a").value, replicate_count - 1), b(estimate(truth_, "b").value, replicate_count - 1);
  Coverage naive_a = a, naive_b = b;
  for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
    Table table = render({.sampling = {.samples = 256, .seed = seed}});
    const Fit result = fit(table);
    a.add(estimate(result, "a"));
    b.add(estimate(result, "b"));
    // The same table with its errors taken for independent: why replicates are kept.
    table.replicates.clear();
    const Fit naive = fit(table);
    EXPECT_EQ(estimate(naive, "a").value, estimate(result, "a").value);
    naive_a.add(estimate(naive, "a"));
    naive_b.add(estimate(naive, "b"));
  }
  a.expect_honest("a");
  b.expect_honest("b");
  RecordProperty("coverage of a without replicates", number_text(naive_a.rate()));
  RecordProperty("coverage of b without replicates", number_text(naive_b.rate()));
  EXPECT_LT(naive_a.rate(), 0.85);
  EXPECT_LT(naive_b.rate(), 0.85);
}

TEST(KnownConstants, WithGaussianNoiseOfKnownSize) {
  // Values of the model itself, each with its own noise: what is stated is what there is.
  const Model& model = find_model("proxima");
  ParameterValues constants = model.defaults();
  constants.set("a", -0.4);
  constants.set("b", 0.15);
  constants.set("exponent", 0.8);
  const Table clean = render(model, constants, {Axis{"alpha", "", {0.3, 0.6, 1.0}, false}}, grid(), silent);
  for (const Quantity quantity : {Quantity::cosine, Quantity::log, Quantity::cube_root}) {
    Coverage a(-0.4, 0), b(0.15, 0), exponent(0.8, 0);
    for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
      UniformNumbers uniform(1000 * seed + static_cast<std::uint64_t>(quantity));
      Table table = clean;
      for (std::size_t entry = 0; entry < table.entries(); ++entry) {
        const double error = table.value(entry) * uniform.between(0.0005, 0.005);
        // Box and Muller.
        const double noise = std::sqrt(-2.0 * std::log(1.0 - uniform())) * std::cos(2.0 * pi * uniform());
        table.values[entry] += static_cast<float>(error * noise);
        table.stderr_values[entry] = static_cast<float>(error);
      }
      const Fit result =
          fit(model, model.defaults(), table, {.free = {"a", "b", "exponent"}, .quantity = quantity}, silent);
      ASSERT_TRUE(result.solution.identifiable);
      a.add(estimate(result, "a"));
      b.add(estimate(result, "b"));
      exponent.add(estimate(result, "exponent"));
    }
    const std::string name(quantity_names[static_cast<std::size_t>(quantity)]);
    a.expect_honest("a by " + name);
    b.expect_honest("b by " + name);
    exponent.expect_honest("exponent by " + name);
  }
}

}  // namespace
}  // namespace lobefit
