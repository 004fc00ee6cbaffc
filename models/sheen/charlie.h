// Charlie: cloth as microfacets whose normals lie in the surface.
#pragma once

#include "models/microfacet/masking.h"
#include "models/microfacet/normal_distribution.h"
#include "models/sheen/sheen.h"
#include "models/specular/term.h"

namespace lobefit {

/// Logarithm of Smith's Λ of d_charlie, which has no closed form, as its authors fit it: L(μ) below μ = ½, 2 L(½) - L(1
/// - μ) above, L(x) = a/(1 + b x^c) + d x + e. Each of a … e lies between its values at alpha 0 and 1 by (1 - alpha)².
struct CharlieLogLambda {
  static constexpr const char* name = "log_lambda_charlie";
  static constexpr std::array arguments{"cos_theta", "alpha"};

  struct Curve {
    static constexpr const char* name = "log_lambda_charlie_curve";
    static constexpr std::array arguments{"x", "smoothness2"};

    template <class X, class T>
    LOBEFIT_TEXT static T evaluate(const X& x, const T& smoothness2) {
      const T a = let("a", 21.5473 + (25.3245 - 21.5473) * smoothness2);
      const T b = let("b", 3.82987 + (3.32435 - 3.82987) * smoothness2);
      const T c = let("c", 0.19823 + (0.16801 - 0.19823) * smoothness2);
      const T d = let("d", -1.97760 + (-1.27393 + 1.97760) * smoothness2);
      const T e = let("e", -4.32054 + (-4.85967 + 4.32054) * smoothness2);
      return a / (1.0 + b * pow(T(x), c)) + d * x + e;
    }
  };

  template <class G, class T>
  LOBEFIT_TEXT static T evaluate(const G& cos_theta, const T& alpha) {
    const T smoothness2 = let("smoothness2", square(1.0 - alpha));
    const T near_half = let("near_half", call<Curve>(min(cos_theta, 1.0 - cos_theta), smoothness2));
    const T half_way = let("half_way", call<Curve>(0.5, smoothness2));
    return select(cos_theta < 0.5, near_half, 2.0 * half_way - near_half);
  }
};

struct SheenCharlie : CosineSampling {
  static constexpr ModelInfo info{
      .name = "sheen_charlie",
      .title = "Charlie sheen",
      .source = "Estevez, Kulla 2017, Production Friendly Microfacet Sheen BRDF; Neubelt, Pettineo 2013",
      .reciprocal = false,
      .energy_conserving = false,
      .doc =
          "d_charlie with one of three visibilities: the authors' fitted Smith function (fitted), the same with its "
          "shadow terminator softened (softened; the only one that is not reciprocal), or cloth's (neubelt)."};

  static constexpr std::array<std::string_view, 3> visibility_choices{"fitted", "softened", "neubelt"};

  template <class T>
  struct Parameters {
    Vec3<T> color;
    T alpha, visibility;
  };

  template <class P, class Visit>
  static constexpr void describe(P& p, Visit&& visit) {
    visit(p.color, sheen_color_parameter);
    visit(p.alpha, ParameterInfo{.name = "alpha",
                                 .symbol = "α",
                                 .lower = 0.01,
                                 .initial = 0.5,
                                 .doc = "The authors' r: D falls as the power 1/alpha of the sine."});
    visit(p.visibility, ParameterInfo{.name = "visibility",
                                      .symbol = "V",
                                      .upper = visibility_choices.size() - 1.0,
                                      .initial = 0.0,
                                      .tier = Tier::advanced,
                                      .doc = "Masking and shadowing over 4 N·L N·V.",
                                      .choices = visibility_choices});
  }

  template <class T, class G>
  LOBEFIT_TEXT static Vec3<T> evaluate(const Parameters<T>& p, const Geometry<G>& g) {
    const T visibility = choose(
        p.visibility, [&] { return visibility_of<0>(p, g); }, [&] { return visibility_of<1>(p, g); },
        [&] { return visibility_of<2>(p, g); });
    return p.color * (let("d", CharlieDistribution::at(g, p.alpha)) * visibility);
  }

  static constexpr int variant_count = static_cast<int>(visibility_choices.size());
  template <int variant>
  struct Variant {
    static constexpr ModelInfo info = SheenCharlie::info;
    template <class T>
    using Parameters = SheenCharlie::Parameters<T>;

    template <class T, class G>
    LOBEFIT_TEXT static Vec3<T> evaluate(const SheenCharlie::Parameters<T>& p, const Geometry<G>& g) {
      return p.color * (CharlieDistribution::at(g, p.alpha) * visibility_of<variant>(p, g));
    }
  };
  template <class Slot>
  static int variant(std::span<const Slot> flat) {
    return choice_number(flat.back(), variant_count);
  }

 private:
  template <int choice, class T, class G>
  LOBEFIT_TEXT static T visibility_of(const Parameters<T>& p, const Geometry<G>& g) {
    if constexpr (choice == 2) {
      return T(ClothVisibility::at(g));
    } else {
      T log_lambda_i = let("log_lambda_i", call<CharlieLogLambda>(g.cos_theta_i, p.alpha));
      const T lambda_o = let("lambda_o", exp(call<CharlieLogLambda>(g.cos_theta_o, p.alpha)));
      // Λ^(1 + 2 (1 - μ)⁸) of the light: more of it is shadowed next to grazing angles, without an edge.
      if constexpr (choice == 1) {
        const G grazing = let("grazing", square(square(square(1.0 - g.cos_theta_i))));
        log_lambda_i = let("softened_i", log_lambda_i * (1.0 + 2.0 * grazing));
      }
      const T lambda_i = let("lambda_i", exp(log_lambda_i));
      const G denominator = let("denominator", 4.0 * max(g.cos_theta_i * g.cos_theta_o, 1e-30));
      return 1.0 / (denominator * (1.0 + lambda_i + lambda_o));
    }
  }
};

}  // namespace lobefit
