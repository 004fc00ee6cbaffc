// Karis's table: any D × any G × any F.
#pragma once

#include "models/microfacet/anisotropy.h"
#include "models/microfacet/fresnel.h"
#include "models/microfacet/masking.h"
#include "models/microfacet/normal_distribution.h"
#include "models/microfacet/sampling.h"
#include "models/sampling.h"
#include "models/specular/ggx.h"

namespace lobefit {

struct SpecularKaris {
  static constexpr ModelInfo info{
      .name = "specular_karis",
      .title = "D G F / (4 N·L N·V), each by name",
      .source = "Karis 2013, Specular BRDF Reference",
      .reciprocal = true,
      .energy_conserving = false,
      .isotropic = false,
      .doc =
          "Microfacet specular from a table of distributions, geometry terms and Fresnel terms. G knows alpha alone, "
          "also where D is anisotropic."};

  static constexpr std::array<std::string_view, 4> distribution_choices{"blinn_phong", "beckmann", "ggx",
                                                                        "ggx_anisotropic"};
  static constexpr std::array<std::string_view, 8> masking_choices{
      "implicit",       "neumann",   "cook_torrance",    "kelemen",
      "smith_beckmann", "smith_ggx", "schlick_beckmann", "schlick_ggx"};
  static constexpr std::array<std::string_view, 3> fresnel_choices{"none", "schlick", "cook_torrance"};

  template <class T>
  struct Parameters {
    Vec3<T> f0;
    T alpha, anisotropy, distribution, masking, fresnel;
  };

  template <class P, class Visit>
  static constexpr void describe(P& p, Visit&& visit) {
    visit(p.f0, specular_f0_parameter);
    visit(p.alpha, specular_alpha_parameter);
    visit(p.anisotropy, ParameterInfo{.name = "anisotropy",
                                      .symbol = "a",
                                      .initial = 0.5,
                                      .tier = Tier::advanced,
                                      .doc = "Of ggx_anisotropic alone, as Burley maps it: alpha_x, alpha_y = alpha / "
                                             "sqrt(1 - .9 a), alpha sqrt(1 - .9 a)."});
    const auto choice = [&](auto& member, ParameterInfo info, std::span<const std::string_view> choices) {
      info.upper = static_cast<double>(choices.size() - 1);
      info.choices = choices;
      visit(member, info);
    };
    choice(p.distribution, {.name = "distribution", .symbol = "D", .initial = 2.0, .doc = "Of facet normals."},
           distribution_choices);
    choice(p.masking, {.name = "masking", .symbol = "G", .initial = 5.0, .doc = "Geometric shadowing."},
           masking_choices);
    choice(p.fresnel, {.name = "fresnel", .symbol = "F", .initial = 1.0, .doc = "Reflectance of a facet."},
           fresnel_choices);
  }

  template <class T, class G>
  LOBEFIT_TEXT static Vec3<T> evaluate(const Parameters<T>& p, const Geometry<G>& g) {
    const T d = choose(
        p.distribution, [&] { return d_of<0>(p, g); }, [&] { return d_of<1>(p, g); }, [&] { return d_of<2>(p, g); },
        [&] { return d_of<3>(p, g); });
    const T masking = choose(
        p.masking, [&] { return g_of<0>(p, g); }, [&] { return g_of<1>(p, g); }, [&] { return g_of<2>(p, g); },
        [&] { return g_of<3>(p, g); }, [&] { return g_of<4>(p, g); }, [&] { return g_of<5>(p, g); },
        [&] { return g_of<6>(p, g); }, [&] { return g_of<7>(p, g); });
    const Vec3<T> fresnel = choose(
        p.fresnel, [&] { return f_of<0>(p, g); }, [&] { return f_of<1>(p, g); }, [&] { return f_of<2>(p, g); });
    return product(d, masking, fresnel, g);
  }

  static constexpr int variant_count =
      static_cast<int>(distribution_choices.size() * masking_choices.size() * fresnel_choices.size());

  /// One combination.
  template <int variant>
  struct Variant {
    static constexpr ModelInfo info = SpecularKaris::info;
    template <class T>
    using Parameters = SpecularKaris::Parameters<T>;

    template <class T, class G>
    LOBEFIT_TEXT static Vec3<T> evaluate(const SpecularKaris::Parameters<T>& p, const Geometry<G>& g) {
      return product(d_of<variant / 24>(p, g), g_of<variant / 3 % 8>(p, g), f_of<variant % 3>(p, g), g);
    }
  };

  template <class Slot>
  static int variant(std::span<const Slot> flat) {
    // The choices are the last three numbers.
    const auto last = flat.last(3);
    return (choice_number(last[0], 4) * 8 + choice_number(last[1], 8)) * 3 + choice_number(last[2], 3);
  }

  /// By the facets that wo sees, and in some share by all of them.
  static Direction sample(const Parameters<double>& p, const Direction& wo, std::array<double, 2> u) {
    const double visible = visible_share(p);
    return pick_lobe<2>({visible, 1.0 - visible}, u) == 0
               ? sample_visible_reflection(sampled_distribution(p), sampled_alphas(p), wo, u)
               : sample_reflection(sampled_distribution(p), sampled_alphas(p), wo, u);
  }
  static double pdf(const Parameters<double>& p, const Direction& wi, const Direction& wo) {
    return lerp(reflection_density(sampled_distribution(p), sampled_alphas(p), wi, wo),
                visible_reflection_density(sampled_distribution(p), sampled_alphas(p), wi, wo), visible_share(p));
  }

 private:
  /// GGX's facets for Blinn-Phong's too, which have no Smith function: at the same alpha D is at most 4/e of GGX's,
  /// whose tail is the longer.
  static Distribution sampled_distribution(const Parameters<double>& p) {
    return choice_number(p.distribution, 4) == 1 ? Distribution::beckmann : Distribution::ggx;
  }
  static Alpha sampled_alphas(const Parameters<double>& p) {
    if (choice_number(p.distribution, 4) < 3) return p.alpha;
    const AlphaPair<double> alpha = BurleyAnisotropy::evaluate(p.alpha, p.anisotropy);
    return {alpha.x, alpha.y};
  }
  /// Cook-Torrance's and Kelemen's grooves hide less than Smith's facets: next to the horizon they show many that
  /// Smith's hardly ever do.
  static double visible_share(const Parameters<double>& p) {
    const int masking = choice_number(p.masking, 8);
    return masking == 2 || masking == 3 ? 0.5 : 1.0;
  }

  template <class T, class G>
  LOBEFIT_TEXT static Vec3<T> product(const T& d, const T& masking, const Vec3<T>& fresnel, const Geometry<G>& g) {
    // Next to the horizon the denominator would underflow in float; D over it must not overflow.
    const G denominator = let("denominator", 4.0 * max(g.cos_theta_i * g.cos_theta_o, 1e-30));
    return fresnel * (let("d", d) * (let("masking", masking) / denominator));
  }

  template <int choice, class T, class G>
  LOBEFIT_TEXT static T d_of(const Parameters<T>& p, const Geometry<G>& g) {
    if constexpr (choice == 0) return BlinnPhongDistribution::at(g, p.alpha);
    if constexpr (choice == 1) return BeckmannDistribution::at(g, p.alpha);
    if constexpr (choice == 2) return GgxDistribution::at(g, p.alpha);
    if constexpr (choice == 3) {
      const AlphaPair<T> alpha = BurleyAnisotropy::evaluate(p.alpha, p.anisotropy);
      return GgxAnisotropicDistribution::at(g, alpha.x, alpha.y);
    }
  }
  template <int choice, class T, class G>
  LOBEFIT_TEXT static T g_of([[maybe_unused]] const Parameters<T>& p, const Geometry<G>& g) {
    if constexpr (choice == 0) return T(ImplicitMasking::at(g));
    if constexpr (choice == 1) return T(NeumannMasking::at(g));
    if constexpr (choice == 2) return T(CookTorranceMasking::at(g));
    if constexpr (choice == 3) return T(KelemenMasking::at(g));
    if constexpr (choice == 4) return SmithBeckmannMasking::at(g, p.alpha);
    if constexpr (choice == 5) return SmithGgxMasking::at(g, p.alpha);
    if constexpr (choice == 6) return SchlickBeckmannMasking::at(g, p.alpha);
    if constexpr (choice == 7) return SchlickGgxMasking::at(g, p.alpha);
  }
  template <int choice, class T, class G>
  LOBEFIT_TEXT static Vec3<T> f_of(const Parameters<T>& p, [[maybe_unused]] const Geometry<G>& g) {
    if constexpr (choice == 0) return p.f0;
    if constexpr (choice == 1) return call<SchlickFresnel>(g.cos_theta_d, p.f0, Vec3<T>{T(1.0), T(1.0), T(1.0)});
    if constexpr (choice == 2) {
      return {call<CookTorranceFresnel>(g.cos_theta_d, p.f0.x), call<CookTorranceFresnel>(g.cos_theta_d, p.f0.y),
              call<CookTorranceFresnel>(g.cos_theta_d, p.f0.z)};
    }
  }
};

}  // namespace lobefit
