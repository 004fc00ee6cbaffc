// The scalars against independent arithmetic: Single against std:: in double, Dual against ceres::Jet and differences.

#include <ceres/jet.h>
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <limits>
#include <random>
#include <tuple>

#include "evaluate/single.h"
#include "fit/dual.h"
#include "tests/directions.h"
#include "tests/model_types.h"

// What texts need beyond ceres' own functions, where argument-dependent lookup finds it.
namespace ceres {

using TestJet = Jet<double, 16>;

inline TestJet min(const TestJet& a, const TestJet& b) { return a < b ? a : b; }
inline TestJet max(const TestJet& a, const TestJet& b) { return a > b ? a : b; }
inline TestJet min(const TestJet& a, double b) { return min(a, TestJet(b)); }
inline TestJet max(const TestJet& a, double b) { return max(a, TestJet(b)); }
/// Flat where the radicand vanishes, as models/scalar.h has it; a Jet's own slope is infinite there.
inline TestJet sqrt(const TestJet& a) { return a.a > 0.0 ? sqrt<double, 16>(a) : TestJet(0.0); }
inline std::int32_t to_index(const TestJet& x) { return static_cast<std::int32_t>(x.a); }
inline TestJet select(bool condition, const TestJet& a, const TestJet& b) { return condition ? a : b; }

}  // namespace ceres

namespace lobefit {
namespace {

using ceres::TestJet;
constexpr int width = 16;
using TestDual = Dual<width>;

// ---- Single -----------------------------------------------------------------------------------------------------

template <class T>
inline constexpr bool is_single = std::is_same_v<T, Single>;

static_assert(is_single<decltype(1.0 - Single())> && is_single<decltype(Single() * 2.0)>);
static_assert(is_single<decltype(2 * Single())> && is_single<decltype(Single() / 3)>);
static_assert(is_single<decltype(max(Single(), 0.0))> && is_single<decltype(pow(Single(), 5.0))>);
static_assert(is_single<decltype(select(true, Single(), 0.0))> && is_single<decltype(lerp(1.0, Single(), Single()))>);
static_assert(is_single<decltype(saturate(Single()))> && is_single<decltype(pow5(Single()))>);
static_assert(std::is_same_v<decltype(Vec3<Single>() / pi), Vec3<Single>>);
static_assert(std::is_same_v<decltype(normalize(Vec3<Single>())), Vec3<Single>>);
static_assert(is_single<decltype(dot(Vec3<Single>(), Vec3<Single>()))>);
static_assert(!std::is_convertible_v<Single, double> && !std::is_convertible_v<Single, float>);
static_assert(sizeof(Single) == sizeof(float));

float from_bits(std::uint32_t bits) { return std::bit_cast<float>(bits); }
std::uint32_t to_bits(float x) { return std::bit_cast<std::uint32_t>(x); }

double relative_error(float value, double truth) { return std::abs(value - truth) / std::abs(truth); }

TEST(Single, RoundsLiteralsBeforeItComputes) {
  // With the literal kept in double until the product, the last bit comes out differently.
  constexpr float x = 0.1f;
  constexpr double literal = 0.1;
  ASSERT_NE(x * static_cast<float>(literal), static_cast<float>(static_cast<double>(x) * literal));
  EXPECT_EQ((Single(x) * literal).value, x * static_cast<float>(literal));
  // Double would keep the small term.
  EXPECT_EQ((1.0 - (1.0 - Single(1e-9f))).value, 0.0f);
}

TEST(Single, SquareRootIsThatOfTheHardware) {
  for (std::uint32_t bits = 0; bits < to_bits(std::numeric_limits<float>::infinity()); bits += 4099) {
    const float x = from_bits(bits);
    ASSERT_EQ(sqrt(Single(x)).value, std::sqrt(x)) << x;
  }
  EXPECT_EQ(sqrt(Single(-0.0f)).value, 0.0f);
  EXPECT_EQ(sqrt(Single(-1e-8f)).value, 0.0f);
}

TEST(Single, Exp2) {
  // 2e-7 as stated: Taylor's remainder, seven roundings on the way, and two exact scalings.
  double worst = 0.0;
  for (double x = -126.0; x <= 127.5; x += 0x1p-12) {
    worst = std::max(worst, relative_error(exp2(Single(x)).value, std::exp2(x)));
  }
  for (float x = 1e-45f; x < 0.1f; x *= 1.7f) {
    for (const float y : {x, -x}) {
      worst = std::max(worst, relative_error(exp2(Single(y)).value, std::exp2(static_cast<double>(y))));
    }
  }
  // The halves, where rounding to the nearest integer is a tie, and their neighbours.
  for (float x = -125.5f; x < 127.0f; x += 1.0f) {
    for (const float y : {std::nextafter(x, -200.0f), x, std::nextafter(x, 200.0f)}) {
      worst = std::max(worst, relative_error(exp2(Single(y)).value, std::exp2(static_cast<double>(y))));
    }
  }
  RecordProperty("worst_relative_error", std::to_string(worst * 1e9) + "e-9");
  EXPECT_LE(worst, 2e-7);
  for (int whole = -126; whole <= 127; ++whole) {
    EXPECT_EQ(exp2(Single(static_cast<double>(whole))).value, std::ldexp(1.0f, whole));
  }
}

TEST(Single, Exp2SaturatesInsteadOfOverflowing) {
  constexpr float infinity = std::numeric_limits<float>::infinity();
  for (const float x : {-126.5f, -1000.0f, -infinity}) EXPECT_EQ(exp2(Single(x)).value, 0x1p-126f);
  for (const float x : {127.6f, 128.0f, 1e30f, infinity}) {
    EXPECT_LE(relative_error(exp2(Single(x)).value, std::exp2(127.5)), 2e-7) << x;
  }
}

TEST(Single, Log2) {
  double worst = 0.0;
  const std::uint32_t first = to_bits(static_cast<float>(smallest_base));
  const std::uint32_t last = to_bits(std::numeric_limits<float>::max());
  const auto visit = [&](float x) {
    const double truth = std::log2(static_cast<double>(x));
    if (truth == 0.0) {
      EXPECT_EQ(log2(Single(x)).value, 0.0f);
    } else {
      worst = std::max(worst, relative_error(log2(Single(x)).value, truth));
    }
  };
  for (std::uint32_t bits = first; bits < last; bits += 1021) visit(from_bits(bits));
  visit(from_bits(last));
  // Next to 1 the logarithm vanishes, and a sum with the exponent would cancel: every float, then ever fewer.
  for (std::uint32_t bits = to_bits(1.0f) - 20000; bits < to_bits(1.0f) + 20000; ++bits) visit(from_bits(bits));
  // Where the reduced argument jumps from √2 to √½.
  for (std::uint32_t bits = 0x3f3504f3 - 2000; bits < 0x3f3504f3 + 2000; ++bits) {
    visit(from_bits(bits));
    visit(2.0f * from_bits(bits));
  }
  RecordProperty("worst_relative_error", std::to_string(worst * 1e9) + "e-9");
  // 2.31e-7 over all floats, at 0.70356.
  EXPECT_LE(worst, 2.4e-7);
}

TEST(Single, Log2IsFlatBelowTheSmallestBase) {
  const float floor = log2(Single(smallest_base)).value;
  EXPECT_NEAR(floor, std::log2(1e-36), 2e-5);
  for (const float x : {0.0f, -0.0f, -1.0f, 1e-37f, 1e-45f}) EXPECT_EQ(log2(Single(x)).value, floor) << x;
}

TEST(Single, Pow) {
  // The product y log2 x carries log2's relative error of 2.4e-7 and half an ulp of its own; exp2 turns an absolute
  // error δ of its argument into a relative one of δ ln 2.
  double worst = 0.0;
  for (double exponent_of_x = -119.0; exponent_of_x <= 127.0; exponent_of_x += 0.37) {
    const float x = static_cast<float>(std::exp2(exponent_of_x));
    for (const float y : {-2.0f, -1.0f, -0.33f, 1e-3f, 0.05f, 0.5f, 0.75f, 1.0f, 2.5f, 5.0f, 64.0f}) {
      const double product = y * std::log2(static_cast<double>(x));
      if (product < -126.0 || product > 127.5) continue;
      const double bound = 2e-7 + 3e-7 * std::numbers::ln2 * std::abs(product);
      const double truth = std::pow(static_cast<double>(x), static_cast<double>(y));
      const double error = relative_error(pow(Single(x), Single(y)).value, truth);
      worst = std::max(worst, error);
      ASSERT_LE(error, bound) << x << " ^ " << y;
    }
  }
  RecordProperty("worst_relative_error", std::to_string(worst * 1e6) + "e-6");
  for (const double y : {0.0, 0.5, 1.0, 64.0}) EXPECT_EQ(pow(Single(1.0), Single(y)).value, 1.0f) << y;
}

TEST(Single, PowOfZeroIsFinite) {
  EXPECT_EQ(pow(Single(0.0), Single(0.0)).value, 1.0f);
  EXPECT_LE(pow(Single(0.0), Single(0.5)).value, 1.1e-18f);
  for (const double y : {0.05, 0.5, 1.0, 5.0, 64.0}) {
    const float power = pow(Single(0.0), Single(y)).value;
    EXPECT_GT(power, 0.0f) << y;
    // smallest_base^y, or exp2's own floor; log2(1e-36) times y is rounded to within 4e-6 of a power.
    EXPECT_NEAR(power, std::max(std::pow(1e-36, y), 0x1p-126), 1e-5 * std::pow(1e-36, y)) << y;
    EXPECT_EQ(pow(Single(-1e-3), Single(y)).value, power) << y;
  }
}

TEST(Single, ExpAndLogAreScaledPowersOfTwo) {
  for (double x = -80.0; x < 80.0; x += 0.013) {
    const float rounded = static_cast<float>(x);
    ASSERT_LE(relative_error(exp(Single(rounded)).value, std::exp(static_cast<double>(rounded))),
              2e-7 + 1.3e-7 * std::abs(x));
    const float power = static_cast<float>(std::exp(x));
    ASSERT_LE(relative_error(log(Single(power)).value, std::log(static_cast<double>(power))), 4e-7);
  }
}

TEST(Single, ArcCosine) {
  double worst = 0.0;
  const auto visit = [&](float x) {
    worst = std::max(worst, std::abs(acos(Single(x)).value - std::acos(static_cast<double>(x))));
  };
  for (std::uint32_t bits = 0; bits <= to_bits(1.0f); bits += 1009) visit(from_bits(bits)), visit(-from_bits(bits));
  for (std::uint32_t back = 0; back < 2000; ++back) {
    visit(from_bits(to_bits(1.0f) - back));
    visit(-from_bits(to_bits(1.0f) - back));
  }
  RecordProperty("worst_absolute_error", std::to_string(worst * 1e9) + "e-9");
  // Two units in the last place of π; 4.73e-7 over all floats.
  EXPECT_LE(worst, 4.8e-7);
  EXPECT_EQ(acos(Single(1.0)).value, 0.0f);
  EXPECT_EQ(acos(Single(1.0000001f)).value, 0.0f);
  EXPECT_EQ(acos(Single(-1.0000001f)).value, static_cast<float>(pi));
}

TEST(ArcCosine, PolynomialErrorIsAsStated) {
  double worst = 0.0;
  for (double x = -1.0; x <= 1.0; x += 1e-5) worst = std::max(worst, std::abs(ArcCosine::evaluate(x) - std::acos(x)));
  EXPECT_LE(worst, 2.2e-8);
}

TEST(Single, SelectsAndComparesLikeDouble) {
  EXPECT_EQ(min(Single(2.0), 3.0).value, 2.0f);
  EXPECT_EQ(max(Single(2.0), 3.0).value, 3.0f);
  EXPECT_EQ(abs(Single(-2.0)).value, 2.0f);
  EXPECT_EQ(abs(Single(2.0)).value, 2.0f);
  EXPECT_EQ(select(Single(1.0) < 2.0, Single(5.0), 6.0).value, 5.0f);
  EXPECT_EQ(select(Single(1.0) >= 2.0, Single(5.0), 6.0).value, 6.0f);
  EXPECT_TRUE(Single(1.0) <= 1.0 && Single(1.0) >= 1.0 && !(Single(1.0) > 1.0));
  EXPECT_EQ(saturate(Single(1.5)).value, 1.0f);
  EXPECT_EQ(saturate(Single(-1.5)).value, 0.0f);
  EXPECT_EQ(lerp(Single(2.0), Single(4.0), Single(0.25)).value, 2.5f);
}

// ---- Dual, operation by operation -------------------------------------------------------------------------------

/// Every operation that texts use, as functions of two variables that take any scalar.
constexpr auto operations = std::tuple{
    [](auto a, auto b) { return a + b; },
    [](auto a, auto b) { return a - b; },
    [](auto a, auto b) { return a * b; },
    [](auto a, auto b) { return a / b; },
    [](auto a, auto) { return a + 0.7; },
    [](auto a, auto) { return 0.7 + a; },
    [](auto a, auto) { return a - 0.7; },
    [](auto a, auto) { return 0.7 - a; },
    [](auto a, auto) { return a * 0.7; },
    [](auto a, auto) { return 0.7 * a; },
    [](auto a, auto) { return a / 0.7; },
    [](auto a, auto) { return 0.7 / a; },
    [](auto a, auto) { return -a; },
    [](auto a, auto b) { return min(a, b); },
    [](auto a, auto b) { return max(a, b); },
    [](auto a, auto) { return abs(a - 0.5); },
    [](auto a, auto b) { return select(a < b, a * b, a / b); },
    [](auto a, auto b) { return select(a >= b, a * b, a / b); },
    [](auto a, auto) { return sqrt(a); },
    [](auto a, auto) { return exp(a); },
    [](auto a, auto) { return exp2(a); },
    [](auto a, auto) { return log(a); },
    [](auto a, auto) { return log2(a); },
    [](auto a, auto b) { return pow(a, b); },
    [](auto a, auto) { return acos(a - 0.5); },
    [](auto a, auto) { return square(a); },
    [](auto a, auto) { return pow5(a); },
    [](auto a, auto) { return saturate(a); },
    [](auto a, auto b) { return lerp(a, b, a * b); },
    [](auto a, auto b) {
      return dot(Vec3<decltype(a)>{a, b, a}, Vec3<decltype(a)>{b, b, a});
    },
    [](auto a, auto b) {
      return normalize(Vec3<decltype(a)>{a, b, a * b}).y;
    },
};

template <class Visit>
void for_each_operation(Visit&& visit) {
  std::apply(
      [&](const auto&... operation) {
        int number = 0;
        (visit(operation, number++), ...);
      },
      operations);
}

/// The same value and dense derivatives in both scalars.
std::pair<TestDual, TestJet> variable(double value, UniformNumbers& uniform) {
  TestDual dual(value);
  TestJet jet(value);
  for (int k = 0; k < width; ++k) {
    const double derivative = uniform.between(-1.0, 1.0);
    dual.derivative[static_cast<std::size_t>(k)] = derivative;
    jet.v[k] = derivative;
  }
  return {dual, jet};
}

void expect_equal(const TestDual& dual, const TestJet& jet, double tolerance, const std::string& place) {
  EXPECT_NEAR(dual.value, jet.a, tolerance * (1.0 + std::abs(jet.a))) << place;
  const double scale = 1.0 + jet.v.cwiseAbs().maxCoeff();
  for (int k = 0; k < width; ++k) {
    EXPECT_NEAR(dual.derivative[static_cast<std::size_t>(k)], jet.v[k], tolerance * scale) << place << ", slot " << k;
  }
}

// Inside (0, 1.4) all operations are smooth but for min, max and abs, whose kinks random points miss.
constexpr double lowest = 0.02, highest = 1.4;

TEST(Dual, OperationsEqualJets) {
  UniformNumbers uniform(21);
  for (int sample = 0; sample < 200; ++sample) {
    const auto [dual_a, jet_a] = variable(uniform.between(lowest, highest), uniform);
    const auto [dual_b, jet_b] = variable(uniform.between(lowest, highest), uniform);
    for_each_operation([&](const auto& operation, int number) {
      const std::string place = "operation " + std::to_string(number) + " at " + std::to_string(dual_a.value) + ", " +
                                std::to_string(dual_b.value);
      expect_equal(operation(dual_a, dual_b), operation(jet_a, jet_b), 1e-13, place);
    });
  }
}

TEST(Dual, OperationsEqualCentralDifferences) {
  UniformNumbers uniform(22);
  constexpr double step = 1e-5;
  for (int sample = 0; sample < 200; ++sample) {
    const double a = uniform.between(lowest, highest), b = uniform.between(lowest, highest);
    for_each_operation([&](const auto& operation, int number) {
      const TestDual dual = operation(TestDual::variable(a, 3), TestDual::variable(b, 11));
      EXPECT_NEAR(dual.value, operation(a, b), 1e-15 * (1.0 + std::abs(dual.value)));
      const double by_a = (operation(a + step, b) - operation(a - step, b)) / (2.0 * step);
      const double by_b = (operation(a, b + step) - operation(a, b - step)) / (2.0 * step);
      // Truncation: a third derivative of 1/x² size at 0.02 or so, times step²/6.
      const double tolerance = 1e-5 * (1.0 + std::abs(by_a) + std::abs(by_b));
      EXPECT_NEAR(dual.derivative[3], by_a, tolerance) << "operation " << number << " at " << a << ", " << b;
      EXPECT_NEAR(dual.derivative[11], by_b, tolerance) << "operation " << number << " at " << a << ", " << b;
      EXPECT_EQ(dual.derivative[7], 0.0);
    });
  }
}

TEST(Dual, IsFlatAtKinks) {
  const auto at = [](double x) { return TestDual::variable(x, 0); };
  for (const double x : {0.0, -0.0, -1e-3}) {
    EXPECT_EQ(sqrt(at(x)).value, 0.0);
    EXPECT_EQ(sqrt(at(x)).derivative[0], 0.0) << x;
    EXPECT_EQ(log(at(x)).value, std::log(smallest_base));
    EXPECT_EQ(log(at(x)).derivative[0], 0.0) << x;
    EXPECT_EQ(log2(at(x)).derivative[0], 0.0) << x;
    for (const double y : {0.0, 0.05, 0.5, 1.0, 5.0}) {
      EXPECT_DOUBLE_EQ(pow(at(x), TestDual(y)).value, std::pow(smallest_base, y));
      EXPECT_EQ(pow(at(x), TestDual(y)).derivative[0], 0.0) << x << " ^ " << y;
    }
  }
  for (const double x : {-2.0, -1.0, 1.0, 2.0}) {
    EXPECT_EQ(acos(at(x)).value, x < 0.0 ? std::acos(-1.0) : 0.0);
    EXPECT_EQ(acos(at(x)).derivative[0], 0.0) << x;
  }
}

TEST(Dual, ExponentOfAVanishingBaseHasAFiniteDerivative) {
  // d/dy x^y = x^y ln x, with the guarded x.
  for (const double y : {0.05, 0.5, 1.0}) {
    const TestDual power = pow(TestDual(0.0), TestDual::variable(y, 2));
    EXPECT_DOUBLE_EQ(power.derivative[2], std::pow(1e-36, y) * std::log(1e-36));
  }
}

TEST(Dual, StaysFiniteNextToKinks) {
  for (const double x : {1e-300, 1e-40, 1.0000001e-36, 1e-20, 1e-8}) {
    const TestDual a = TestDual::variable(x, 0);
    for (const TestDual& result : {sqrt(a), log(a), log2(a), pow(a, TestDual(0.05)), acos(1.0 - a), acos(a - 1.0)}) {
      EXPECT_TRUE(std::isfinite(result.value)) << x;
      EXPECT_TRUE(std::isfinite(result.derivative[0])) << x;
    }
  }
}

TEST(Dual, TakesTheDerivativeOfTheBranchTaken) {
  const TestDual a = TestDual::variable(1.0, 0), b = TestDual::variable(2.0, 1);
  EXPECT_EQ(min(a, b).derivative, a.derivative);
  EXPECT_EQ(max(a, b).derivative, b.derivative);
  EXPECT_EQ(max(a, 1.5).derivative[0], 0.0);
  EXPECT_EQ(saturate(b).derivative[1], 0.0);
  EXPECT_EQ(abs(-a).derivative[0], 1.0);
  // The branch not taken may be infinite without harm.
  EXPECT_EQ(select(false, a / (a - 1.0), b).derivative, b.derivative);
}

// ---- Dual, model by model ---------------------------------------------------------------------------------------

template <class M>
class ModelGradient : public ::testing::Test {
 protected:
  static constexpr int samples = 50;

  static std::vector<std::vector<double>> parameters() {
    std::vector<ParameterInfo> list = describe_parameters<M>();
    for (ParameterInfo& info : list) {
      // Jets' own pow returns 0 at base 0, the guarded one smallest_base^y: the same to 1e-18 from ½ on.
      if (info.name == "exponent") info.lower = std::max(info.lower, 0.5);
    }
    return interior_parameters(list, samples, 0.05, 31);
  }

  /// The model on scalar T, with T::a or T::value's derivatives by slots first … first + 15.
  template <class T, class MakeVariable>
  static Vec3<T> evaluate(const std::vector<double>& flat, std::size_t first, const DirectionPair& pair,
                          const MakeVariable& make_variable) {
    std::vector<T> slots;
    for (std::size_t k = 0; k < flat.size(); ++k) {
      const bool is_free = k >= first && k < first + width;
      slots.push_back(is_free ? make_variable(flat[k], static_cast<int>(k - first)) : T(flat[k]));
    }
    return evaluate_brdf<M>(unflatten<M, T>(std::span<const T>(slots)), pair.wi, pair.wo);
  }
  static Vec3<TestDual> dual(const std::vector<double>& flat, std::size_t first, const DirectionPair& pair) {
    return evaluate<TestDual>(flat, first, pair, [](double x, int k) { return TestDual::variable(x, k); });
  }
  static Rgb value(const std::vector<double>& flat, const DirectionPair& pair) {
    return evaluate_brdf<M>(unflatten<M, double>(std::span<const double>(flat)), pair.wi, pair.wo);
  }
};
TYPED_TEST_SUITE(ModelGradient, AllModels, ModelTypeName);

TYPED_TEST(ModelGradient, EqualsThatOfJets) {
  const auto sets = this->parameters();
  const std::vector<DirectionPair> pairs = random_pairs(sets.size(), 32);
  for (std::size_t i = 0; i < sets.size(); ++i) {
    for (std::size_t first = 0; first < sets[i].size(); first += width) {
      const Vec3<TestDual> by_dual = this->dual(sets[i], first, pairs[i]);
      const Vec3<TestJet> by_jet =
          this->template evaluate<TestJet>(sets[i], first, pairs[i], [](double x, int k) { return TestJet(x, k); });
      const std::string place = "sample " + std::to_string(i);
      expect_equal(by_dual.x, by_jet.x, 1e-12, place);
      expect_equal(by_dual.y, by_jet.y, 1e-12, place);
      expect_equal(by_dual.z, by_jet.z, 1e-12, place);
    }
  }
}

TYPED_TEST(ModelGradient, EqualsCentralDifferences) {
  const std::vector<ParameterInfo> list = describe_parameters<TypeParam>();
  const auto sets = this->parameters();
  const std::vector<DirectionPair> pairs = random_pairs(sets.size(), 33);
  for (std::size_t i = 0; i < sets.size(); ++i) {
    for (const ParameterInfo& info : list) {
      for (int component = 0; component < info.components; ++component) {
        const auto slot = static_cast<std::size_t>(info.offset + component);
        const double step = 1e-6 * (info.upper - info.lower);
        std::vector<double> moved = sets[i];
        moved[slot] = sets[i][slot] + step;
        const Rgb above = this->value(moved, pairs[i]);
        moved[slot] = sets[i][slot] - step;
        const Rgb below = this->value(moved, pairs[i]);
        const Rgb difference = (above - below) / (2.0 * step);
        const std::size_t first = slot / width * width;
        const Vec3<TestDual> gradient = this->dual(sets[i], first, pairs[i]);
        // Rounding leaves 1e-16/1e-6 of the value per range of the parameter.
        const double tolerance =
            1e-6 * std::abs(difference.x) + 1e-8 * (1.0 + std::abs(above.x)) / std::min(1.0, info.upper - info.lower);
        const std::size_t k = slot - first;
        const std::string place = std::string(info.name) + ", sample " + std::to_string(i);
        EXPECT_NEAR(gradient.x.derivative[k], difference.x, tolerance) << place;
        EXPECT_NEAR(gradient.y.derivative[k], difference.y, tolerance + 1e-6 * std::abs(difference.y)) << place;
        EXPECT_NEAR(gradient.z.derivative[k], difference.z, tolerance + 1e-6 * std::abs(difference.z)) << place;
      }
    }
  }
}

}  // namespace
}  // namespace lobefit
