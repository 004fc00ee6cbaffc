// Each model against values and closed forms that were worked out apart from its text: by angles and trigonometric
// functions in 30 digits, where the texts use dot products of the vectors.
//
// The pairs of directions, with k the angle between wi and wo, theta_d = k/2, and
// cos theta_h = (cos theta_i + cos theta_o)/(2 cos theta_d):
//   retro   60°, 60°, φ =   0°: k =   0°,              theta_d =  0°,              theta_h = 60°
//   mirror  60°, 60°, φ = 180°: k = 120°,              theta_d = 60°,              theta_h =  0°
//   side    30°, 60°, φ =  90°: k = 64.341093726745°,  theta_d = 32.170546863372°, theta_h = 36.206023113003°
//           (cos k = √3/4 = .433012701892, cos theta_d = .846466981604, cos theta_h = .806898221355)

#include <gtest/gtest.h>

#include <string_view>

#include "models/registry.h"
#include "tests/directions.h"
#include "tests/gauss_legendre.h"

namespace lobefit {
namespace {

using Parameters = std::initializer_list<std::pair<std::string_view, double>>;

struct Angles {
  double theta_i, theta_o, phi;  // degrees
};
constexpr Angles retro{60.0, 60.0, 0.0}, mirror{60.0, 60.0, 180.0}, side{30.0, 60.0, 90.0};

/// A registered model with some parameters set, the others at their defaults.
class Material {
 public:
  Material(std::string_view name, Parameters parameters) : model_(find_model(name)), values_(model_.defaults()) {
    for (const auto& [parameter, value] : parameters) values_.set(parameter, value);
  }

  Rgb operator()(const Direction& wi, const Direction& wo) const { return model_.evaluate(values_.flat(), wi, wo); }

  /// π f, in the first channel.
  double pi_f(const Angles& angles) const {
    // Off the coordinate planes, so that no product of components vanishes.
    const double phi_i = radians(25.0);
    const Direction wi = direction(radians(angles.theta_i), phi_i);
    const Direction wo = direction(radians(angles.theta_o), phi_i + radians(angles.phi));
    return pi * (*this)(wi, wo).x;
  }

  /// ∫ f cos θ_i dω_i. Cut where models have kinks: at θ_i = θ_o, and where the azimuths are perpendicular.
  double directional_albedo(double theta_o) const {
    constexpr int points = 24;
    const Direction wo = direction(theta_o, 0.0);
    double sum = 0.0;
    for (const auto& [theta_lower, theta_upper] : {std::pair{0.0, theta_o}, std::pair{theta_o, pi / 2.0}}) {
      for (const QuadraturePoint& theta : gauss_legendre(points, theta_lower, theta_upper)) {
        for (const auto& [phi_lower, phi_upper] : {std::pair{0.0, pi / 2.0}, std::pair{pi / 2.0, pi}}) {
          for (const QuadraturePoint& phi : gauss_legendre(points, phi_lower, phi_upper)) {
            // Twice: φ and -φ.
            const double weight = 2.0 * theta.weight * phi.weight * std::cos(theta.x) * std::sin(theta.x);
            sum += weight * (*this)(direction(theta.x, phi.x), wo).x;
          }
        }
      }
    }
    return sum;
  }

 private:
  const Model& model_;
  ParameterValues values_;
};

constexpr double exact = 1e-14;

TEST(GaussLegendre, IsExactForItsDegree) {
  // ∫ x⁹ over [1, 2] = (2¹⁰ - 1)/10 needs 5 points and cannot be had with 4.
  for (const int n : {4, 5}) {
    double sum = 0.0;
    for (const auto& [x, weight] : gauss_legendre(n, 1.0, 2.0)) sum += weight * std::pow(x, 9.0);
    EXPECT_EQ(std::abs(sum - 102.3) < 1e-12, n == 5) << sum;
  }
}

TEST(Lambert, IsAlbedoOverPi) {
  const Rgb value =
      find_model("lambert").evaluate(std::vector{0.2, 0.5, 0.8}, direction(0.3, 0.0), direction(1.2, 2.0));
  EXPECT_NEAR(value.x, 0.0636619772367581343, exact);  // .2/π
  EXPECT_NEAR(value.y, 0.159154943091895336, exact);   // .5/π
  EXPECT_NEAR(value.z, 0.254647908947032537, exact);   // .8/π
  EXPECT_NEAR(Material("lambert", {{"albedo", 0.3}}).directional_albedo(1.0), 0.3, 1e-12);
}

TEST(Burley, Values) {
  // f90 = ½ + 2r cos²θ_d = ½ + r(1 + cos k), and (1 - cos 60°)⁵ = 1/32, (1 - cos 30°)⁵ = .0000431632.
  const Material burley("burley", {{"albedo", 1.0}, {"roughness", 0.5}});
  // f90 = 1.5: (1 + .5/32)² = (65/64)²
  EXPECT_NEAR(burley.pi_f(retro), 1.031494140625, exact);
  // f90 = .75: (1 - .25/32)² = (127/128)²
  EXPECT_NEAR(burley.pi_f(mirror), 0.98443603515625, exact);
  // f90 = 1.21650635094611: 1.00000934507787 × 1.00676582346707
  EXPECT_NEAR(burley.pi_f(side), 1.0067752317720786, exact);
  // Channels: linear in the albedo.
  EXPECT_NEAR(Material("burley", {{"albedo", 0.25}, {"roughness", 0.5}}).pi_f(retro), 0.25 * 1.031494140625, exact);
}

TEST(Burley, NormalIncidenceIsLambert) {
  for (const double roughness : {0.0, 0.3, 1.0}) {
    EXPECT_NEAR(Material("burley", {{"albedo", 0.5}, {"roughness", roughness}}).pi_f({0.0, 0.0, 0.0}), 0.5, exact);
  }
}

TEST(Burley, GrazingRetroReflectionIsTheSquareOfItsFresnelFactor) {
  // θ_d = 0 and both cosines next to 0: (½ + 2r)².
  const Direction grazing{1.0, 0.0, 1e-14};
  EXPECT_NEAR(pi * Material("burley", {{"albedo", 1.0}, {"roughness", 1.0}})(grazing, grazing).x, 6.25, 1e-12);
  EXPECT_NEAR(pi * Material("burley", {{"albedo", 1.0}, {"roughness", 0.0}})(grazing, grazing).x, 0.25, 1e-12);
}

TEST(OrenNayar, Values) {
  // σ² = .09: σ²/(σ² + .33) = 3/14, σ²/(σ² + .09) = ½, σ²/(σ² + .13) = 9/22; C1 = 25/28 = .892857142857143.
  const Material oren_nayar("oren_nayar", {{"albedo", 0.5}, {"sigma", 0.3}, {"multiple_scattering", 1.0}});
  // A = B = 60°, c = 1: C2 tan B = .225 sin 60° tan 60° = .3375; no C3; twice .17(9/22)(1 - 4/9) = .0386363636363636:
  // ½(.892857142857143 + .3375 + ½ .0386363636363636)
  EXPECT_NEAR(oren_nayar.pi_f(retro), 0.624837662337662338, exact);
  // c = -1: C2 = .225(.866025403784439 - (2/3)³) = .128189049184832, times -tan 60°;
  // twice .17(9/22)(1 + 4/9) = .100454545454545: ½(.892857142857143 - .222029946208718 + ½ .100454545454545)
  EXPECT_NEAR(oren_nayar.pi_f(mirror), 0.360527234711170369, exact);
  // A = 60°, B = 30°, c = 0: C3 = .0625 (4/18)² = .00308641975308642 times tan 45°; twice .17(9/22):
  // ½(.892857142857143 + .00308641975308642 + ½ .0695454545454545)
  EXPECT_NEAR(oren_nayar.pi_f(side), 0.465358144941478275, exact);
  // Without the second bounce: ½(.892857142857143 + .3375)
  const Material single("oren_nayar", {{"albedo", 0.5}, {"sigma", 0.3}, {"multiple_scattering", 0.0}});
  EXPECT_NEAR(single.pi_f(retro), 0.615178571428571429, exact);
}

TEST(OrenNayar, SmoothIsLambert) {
  const Material smooth("oren_nayar", {{"albedo", 0.7}, {"sigma", 0.0}});
  for (const auto& [wi, wo] : random_pairs(100, 41)) EXPECT_NEAR(pi * smooth(wi, wo).x, 0.7, exact);
}

TEST(Eon, Values) {
  // r = ½: AF = 1/(1 + ½(½ - 2/(3π))) = .874204808855498, Eavg = AF(1 + ½(⅔ - 28/(15π))) = .905889580813089.
  // G(60°) = .359249951306735, E(60°) = .924188697545616; G(30°) = .0487473605469881, E(30°) = .880987224927246.
  // ρ = .8: ρ_ms = ρ² Eavg/(1 - ρ(1 - Eavg)) = .626973092136263.
  const Material eon("eon", {{"albedo", 0.8}, {"roughness", 0.5}, {"multiple_scattering", 1.0}});
  // s = 1 - ¼ = ¾, t = ½: .8 AF(1 + ½ 3/2) = 1.22388673239770, and .0382894484657408 from multiple scattering
  EXPECT_NEAR(eon.pi_f(retro), 1.26217618086343741, exact);
  // s = -½ - ¼ = -¾, t = 1: .8 AF(1 - ½ ¾) = .437102404427749, and again .0382894484657408
  EXPECT_NEAR(eon.pi_f(mirror), 0.475391852893489587, exact);
  // s = 0: .8 AF = .699363847084398, and .0601088936660193
  EXPECT_NEAR(eon.pi_f(side), 0.759472740750417358, exact);
}

TEST(Eon, KeepsAllEnergy) {
  for (const double roughness : {0.0, 1e-3, 0.1, 0.5, 1.0}) {
    const Material eon("eon", {{"albedo", 1.0}, {"roughness", roughness}, {"multiple_scattering", 1.0}});
    for (const double theta_o : {0.0, 10.0, 45.0, 70.0, 85.0, 89.9}) {
      EXPECT_NEAR(eon.directional_albedo(radians(theta_o)), 1.0, 1e-6) << roughness << " at " << theta_o;
    }
  }
}

TEST(Eon, SingleScatteringAlbedoIsThatOfItsClosedForm) {
  // The integral of the lobe alone against E(θ) above: E compensates what this lobe loses, and nothing else.
  const Material single("eon", {{"albedo", 1.0}, {"roughness", 0.5}, {"multiple_scattering", 0.0}});
  EXPECT_NEAR(single.directional_albedo(radians(30.0)), 0.880987224927246224, 1e-9);
  EXPECT_NEAR(single.directional_albedo(radians(60.0)), 0.924188697545615814, 1e-9);
  // Its mean over all views, weighted by 2 sin θ cos θ, is Eavg.
  double average = 0.0;
  for (const auto& [theta, weight] : gauss_legendre(16, 0.0, pi / 2.0)) {
    average += weight * std::sin(2.0 * theta) * single.directional_albedo(theta);
  }
  EXPECT_NEAR(average, 0.905889580813088584, 1e-6);
}

TEST(Chan2018, Values) {
  // r = ½, α² = 1/16: gloss = log2(31)/18 = .275233128354826, weight of F1 sat(2.2 g - .5) = .105512882380618;
  // bump factor (34.5 g - 59)g + 24.5 = 10.8747334126327, exponent max(73.2 g - 21.2 = -1.05, 8.9) = 8.9.
  const Material chan("chan_2018", {{"albedo", 1.0}, {"roughness", 0.5}});
  // F0 = 1, F1 = (1 - .75/32)² = .95367431640625: base .995112043595771; bump × 1 × 2^(-8.9 √½) = .138663287657333
  EXPECT_NEAR(chan.pi_f(retro), 1.13377533125310397, exact);
  // F0 = ½ + 1/32, F1 as before: base .575821207211686; bump × ½ × 2^-8.9 = .0113820807459145
  EXPECT_NEAR(chan.pi_f(mirror), 0.587203287957600176, exact);
  // F0 = .846552293371780, F1 = .976530886426438: base .860266709372755; bump .0360910546114686
  EXPECT_NEAR(chan.pi_f(side), 0.896357763984223367, exact);
}

TEST(Chan2018, RoughestHasNoSmoothPart) {
  // gloss = log2(2 - 1)/18 = 0: F0 + 24.5 × ½ × 2^-8.9 = .53125 + .0256430174141984
  EXPECT_NEAR(Material("chan_2018", {{"albedo", 1.0}, {"roughness", 1.0}}).pi_f(mirror), 0.55689301741419842, exact);
}

TEST(Chan2018, SmoothestHasNoBump) {
  // gloss saturates at 1, where 34.5 - 59 + 24.5 = 0: F1 = (1 - .75/32)²
  for (const double roughness : {0.0, 0.01}) {
    const Material smooth("chan_2018", {{"albedo", 1.0}, {"roughness", roughness}});
    EXPECT_NEAR(smooth.pi_f(mirror), 0.95367431640625, exact);
    EXPECT_NEAR(smooth.pi_f(retro), 0.95367431640625, exact);
  }
}

TEST(Chan2024, Values) {
  // r = ¼, α = 1/16: S = max(.5, .85) = .85, sat(4α) = ¼, and .38 α = .02375.
  const Material smoother("chan_2024", {{"albedo", 1.0}, {"roughness", 0.25}, {"multiple_scattering", 1.0}});
  // rough = .85 (.75/.525) 1 = 1.21428571428571: 1 + ¼ .21428571428571 + .02375
  EXPECT_NEAR(smoother.pi_f(retro), 1.07732142857142857, exact);
  // rough = .85 (1.25/1.025) ¼ = .259146341463415: 1 - ¼ .740853658536585 + .02375
  EXPECT_NEAR(smoother.pi_f(mirror), 0.838536585365853659, exact);
  // rough = .85 (1.056898221355/.831898221355) .716506350946 = .773752279059309
  EXPECT_NEAR(smoother.pi_f(side), 0.967188069764827294, exact);
  // r = .8, α = .64: S = max(.39, -.03) = .39, sat(4α) = 1, and .38 α = .2432.
  const Material rougher("chan_2024", {{"albedo", 1.0}, {"roughness", 0.8}, {"multiple_scattering", 1.0}});
  // rough = .39 (1.5/.525) = 1.11428571428571: 1 + .8 × .11428571428571 + .2432
  EXPECT_NEAR(rougher.pi_f(retro), 1.33462857142857143, exact);
  // rough = .39 (1.806898221355/.831898221355) .716506350946 = .606943333899743
  EXPECT_NEAR(rougher.pi_f(side), 0.928754667119794191, exact);
  // Without further bounces: the same less .2432
  const Material single("chan_2024", {{"albedo", 1.0}, {"roughness", 0.8}, {"multiple_scattering", 0.0}});
  EXPECT_NEAR(single.pi_f(retro), 1.09142857142857143, exact);
}

TEST(Chan2024, SmoothIsLambert) {
  const Material smooth("chan_2024", {{"albedo", 0.7}, {"roughness", 0.0}});
  for (const auto& [wi, wo] : random_pairs(100, 42)) EXPECT_NEAR(pi * smooth(wi, wo).x, 0.7, exact);
}

TEST(Hammon, Values) {
  // k = ½ + ½ cos k = cos²θ_d; α = ρ = ½: multiple scattering π × ½ × .1159 × ½ = .0910276471377643, times ρ.
  const Material hammon("hammon", {{"albedo", 0.5}, {"alpha", 0.5}, {"multiple_scattering", 1.0}});
  // rough = 1 (.9 - .4)(1/½) = 1, smooth = 1.05 (31/32)² = .985400390625: ½(.9927001953125 + .0910276471377643)
  EXPECT_NEAR(hammon.pi_f(retro), 0.54186392122513213, exact);
  // rough = ¼ (.9 - .1)(1.5/1) = .3, smooth as before: ½(.6427001953125 + .0910276471377643)
  EXPECT_NEAR(hammon.pi_f(mirror), 0.36686392122513213, exact);
  // k = .716506350946: rough .711844323241958, smooth 1.05 × .999956836934230 × 31/32 = 1.01714359506904
  EXPECT_NEAR(hammon.pi_f(side), 0.477760803146630921, exact);
  // Without further bounces: ½ .9927001953125
  const Material single("hammon", {{"albedo", 0.5}, {"alpha", 0.5}, {"multiple_scattering", 0.0}});
  EXPECT_NEAR(single.pi_f(retro), 0.49635009765625, exact);
}

TEST(Hammon, SmoothAlbedoIsTheViewsOwnFactor) {
  // ∫ 2μ(1 - (1 - μ)⁵) dμ = 20/21 cancels 1.05: the smooth surface reflects 1 - (1 - cos θ_o)⁵.
  const Material smooth("hammon", {{"albedo", 1.0}, {"alpha", 0.0}});
  EXPECT_NEAR(smooth.directional_albedo(0.0), 1.0, 1e-12);
  EXPECT_NEAR(smooth.directional_albedo(radians(60.0)), 0.96875, 1e-12);
}

TEST(Proxima, Values) {
  const Material proxima("proxima", {{"albedo", 1.0}, {"alpha", 0.5}});
  // View and light on one side: no fade. -.55 + .19/cos 60° = -.17: 1 - ½ .17
  EXPECT_NEAR(proxima.pi_f(retro), 0.915, exact);
  // cos θ_k = ½: fade 1 - √½ = .292893218813452: 1 - ½ .17 × .292893218813452
  EXPECT_NEAR(proxima.pi_f(mirror), 0.97510407640085654, exact);
  // No fade; -.55 + .19/cos 30° = -.330606897707942: 1 - ½ .330606897707942
  EXPECT_NEAR(proxima.pi_f(side), 0.834696551146028895, exact);
  // Light at 80°, view at 70° on the other side: k = 150°, fade 1 - √cos 30° = .0693951408979004,
  // -.55 + .19/cos 80° = .544166391797290: 1 + ½ .544166391797290 × .0693951408979004
  EXPECT_NEAR(proxima.pi_f({80.0, 70.0, 180.0}), 1.01888125171533752, exact);
  // Light and view exchanged: -.55 + .19/cos 70° = .00552283603098658, the same fade
  EXPECT_NEAR(proxima.pi_f({70.0, 80.0, 180.0}), 1.00019162899226316, exact);
}

TEST(Proxima, FreeConstants) {
  // 60°, 60°, 180°, a = ½, b = ¼, e = 2: fade 1 - ¼, slope ½ + ¼/½ = 1: 1 + .8 × ¾
  const Parameters parameters{{"albedo", 1.0}, {"alpha", 0.8}, {"a", 0.5}, {"b", 0.25}, {"exponent", 2.0}};
  EXPECT_NEAR(Material("proxima", parameters).pi_f(mirror), 1.6, exact);
  EXPECT_NEAR(Material("proxima_unclamped", parameters).pi_f(mirror), 1.6, exact);
}

TEST(Proxima, IsClampedUnlessTheSlidesFormIsAskedFor) {
  // Slope -2 without fade: 1 - 2
  const Parameters parameters{{"albedo", 1.0}, {"alpha", 1.0}, {"a", -2.0}, {"b", 0.0}};
  EXPECT_EQ(Material("proxima", parameters).pi_f(retro), 0.0);
  EXPECT_NEAR(Material("proxima_unclamped", parameters).pi_f(retro), -1.0, exact);
}

TEST(Proxima, FurnaceFromTheNormal) {
  // ∫ 2μ[1 + α(a + b/μ)] dμ = 1 + α(a + 2b) = 1 - .17 α: seen from the normal no light fades.
  for (const double alpha : {0.0, 0.25, 1.0}) {
    const Material proxima("proxima", {{"albedo", 1.0}, {"alpha", alpha}});
    EXPECT_NEAR(proxima.directional_albedo(0.0), 1.0 - 0.17 * alpha, 1e-12);
  }
}

}  // namespace
}  // namespace lobefit
