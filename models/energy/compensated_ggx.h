// The GGX lobe with the light of further bounces, by three methods.
#pragma once

#include "models/energy/compensation.h"
#include "models/energy/ggx_albedo.h"
#include "models/sampling.h"
#include "models/specular/ggx.h"

namespace lobefit {

/// What the three share: f0 and alpha, and the lobe of one bounce.
struct CompensatedGgx {
  template <class T>
  struct Parameters {
    Vec3<T> f0;
    T alpha;
  };

  template <class P, class Visit>
  static constexpr void describe(P& p, Visit&& visit) {
    visit(p.f0, specular_f0_parameter);
    visit(p.alpha, specular_alpha_parameter);
  }

  /// Schlick's Fresnel to f90 = 1.
  template <class T, class G>
  LOBEFIT_TEXT static Vec3<T> single(const Vec3<T>& f0, const T& alpha, const Geometry<G>& g) {
    const Vec3<T> fresnel = let("fresnel", call<SchlickFresnel>(g.cos_theta_d, f0, Vec3<T>{T(1.0), T(1.0), T(1.0)}));
    return fresnel * ggx_lobe(alpha, g);
  }

  /// The lobe of one bounce, by the facets that the view sees.
  static Direction sample(double alpha, const Direction& wo, const std::array<double, 2>& u) {
    return sample_visible_reflection(Distribution::ggx, alpha, wo, u);
  }
  static double pdf(double alpha, const Direction& wi, const Direction& wo) {
    return visible_reflection_density(Distribution::ggx, alpha, wi, wo);
  }
};

struct SpecularGgxTurquin {
  static constexpr ModelInfo info{
      .name = "specular_ggx_turquin",
      .title = "GGX specular, compensated by Turquin",
      .source = "Turquin 2019, Practical Multiple Scattering Compensation for Microfacet Models",
      .reciprocal = false,
      .energy_conserving = true,
      .doc = "specular_ggx scaled by 1 + f0 (1 - E)/E at the view; E, its albedo for F = 1, by our own table."};

  template <class T>
  using Parameters = CompensatedGgx::Parameters<T>;
  template <class P, class Visit>
  static constexpr void describe(P& p, Visit&& visit) {
    CompensatedGgx::describe(p, visit);
  }

  template <class T, class G>
  LOBEFIT_TEXT static Vec3<T> evaluate(const Parameters<T>& p, const Geometry<G>& g) {
    const T loss_o = let("loss_o", call<GgxAlbedoLoss>(g.cos_theta_o, p.alpha));
    return CompensatedGgx::single(p.f0, p.alpha, g) * turquin_scale(p.f0, loss_o);
  }

  static Direction sample(const Parameters<double>& p, const Direction& wo, const std::array<double, 2>& u) {
    return CompensatedGgx::sample(p.alpha, wo, u);
  }
  static double pdf(const Parameters<double>& p, const Direction& wi, const Direction& wo) {
    return CompensatedGgx::pdf(p.alpha, wi, wo);
  }
};

struct SpecularGgxKullaConty {
  static constexpr ModelInfo info{
      .name = "specular_ggx_kulla_conty",
      .title = "GGX specular, compensated by Kulla and Conty",
      .source = "Kulla, Conty 2017, Revisiting Physically Based Shading at Imageworks; Kelemen, Szirmay-Kalos 2001",
      .reciprocal = true,
      .energy_conserving = true,
      .doc = "specular_ggx plus a lobe (1 - E_i)(1 - E_o)/(pi (1 - E_avg)) of what it loses, coloured by F_avg."};

  static constexpr std::array<std::string_view, 2> average_fresnel_choices{"squared", "once"};

  template <class T>
  struct Parameters {
    Vec3<T> f0;
    T alpha, average_fresnel;
  };

  template <class P, class Visit>
  static constexpr void describe(P& p, Visit&& visit) {
    CompensatedGgx::describe(p, visit);
    visit(p.average_fresnel,
          ParameterInfo{.name = "average_fresnel",
                        .symbol = "F_avg",
                        .initial = 0.0,
                        .tier = Tier::advanced,
                        .doc = "How it colours the lobe: squared, as two bounces do, or once, as the "
                               "slides first had it and copies still do.",
                        .choices = average_fresnel_choices});
  }

  template <class T, class G>
  LOBEFIT_TEXT static Vec3<T> evaluate(const Parameters<T>& p, const Geometry<G>& g) {
    const Vec3<T> average_fresnel = let("average_fresnel", average_schlick(p.f0));
    return evaluate(
        p, g, average_fresnel,
        choose(
            p.average_fresnel, [&] { return average_fresnel * average_fresnel; }, [&] { return average_fresnel; }));
  }

  static constexpr int variant_count = static_cast<int>(average_fresnel_choices.size());
  template <int variant>
  struct Variant {
    static constexpr ModelInfo info = SpecularGgxKullaConty::info;
    template <class T>
    using Parameters = SpecularGgxKullaConty::Parameters<T>;

    template <class T, class G>
    LOBEFIT_TEXT static Vec3<T> evaluate(const SpecularGgxKullaConty::Parameters<T>& p, const Geometry<G>& g) {
      Vec3<T> average_fresnel = average_schlick(p.f0);
      Vec3<T> colour = average_fresnel;
      if constexpr (variant == 0) colour = average_fresnel * average_fresnel;
      return SpecularGgxKullaConty::evaluate(p, g, average_fresnel, colour);
    }
  };
  template <class Slot>
  static int variant(std::span<const Slot> flat) {
    return choice_number(flat.back(), variant_count);
  }

  /// The share that the lobe loses by 1/(μ + 3 α), nearly as the light is lost; the cosine would leave a smooth
  /// surface's grazing angles to chance.
  static Direction sample(const Parameters<double>& p, const Direction& wo, const std::array<double, 2>& u) {
    const double loss_o = GgxAlbedoLoss::evaluate(wo.z, p.alpha);
    std::array<double, 2> rest = u;
    if (pick_lobe<2>({loss_o, 1.0 - loss_o}, rest) == 1) return CompensatedGgx::sample(p.alpha, wo, rest);
    const double c = 3.0 * p.alpha, mu = c * std::expm1(rest[0] * std::log1p(1.0 / c));
    const double sine = sqrt((1.0 - mu) * (1.0 + mu)), azimuth = 2.0 * pi * rest[1];
    return {sine * std::cos(azimuth), sine * std::sin(azimuth), mu};
  }
  static double pdf(const Parameters<double>& p, const Direction& wi, const Direction& wo) {
    const double c = 3.0 * p.alpha;
    const double lost = wi.z > 0.0 ? 1.0 / (2.0 * pi * (wi.z + c) * std::log1p(1.0 / c)) : 0.0;
    return lerp(CompensatedGgx::pdf(p.alpha, wi, wo), lost, GgxAlbedoLoss::evaluate(wo.z, p.alpha));
  }

 private:
  template <class T, class G>
  LOBEFIT_TEXT static Vec3<T> evaluate(const Parameters<T>& p, const Geometry<G>& g, const Vec3<T>& average_fresnel,
                                       const Vec3<T>& colour) {
    const T loss_i = let("loss_i", call<GgxAlbedoLoss>(g.cos_theta_i, p.alpha));
    const T loss_o = let("loss_o", call<GgxAlbedoLoss>(g.cos_theta_o, p.alpha));
    const T average_loss = let("average_loss", call<GgxAverageLoss>(p.alpha));
    return CompensatedGgx::single(p.f0, p.alpha, g) +
           kulla_conty_lobe(colour, average_fresnel, loss_i, loss_o, average_loss);
  }
};

struct SpecularGgxFdezAguera {
  static constexpr ModelInfo info{
      .name = "specular_ggx_fdez_aguera",
      .title = "GGX specular, compensated by Fdez-Agüera",
      .source = "Fdez-Agüera 2019, A Multiple-Scattering Microfacet Model for Real-Time Image-based Lighting",
      .reciprocal = false,
      .energy_conserving = true,
      .doc = "specular_ggx plus a lobe that is constant over the light's directions: the method is for environments."};

  template <class T>
  using Parameters = CompensatedGgx::Parameters<T>;
  template <class P, class Visit>
  static constexpr void describe(P& p, Visit&& visit) {
    CompensatedGgx::describe(p, visit);
  }

  template <class T, class G>
  LOBEFIT_TEXT static Vec3<T> evaluate(const Parameters<T>& p, const Geometry<G>& g) {
    const T loss_o = let("loss_o", call<GgxAlbedoLoss>(g.cos_theta_o, p.alpha));
    const T weight_o = let("weight_o", call<GgxSchlickWeight>(g.cos_theta_o, p.alpha));
    const Vec3<T> albedo_o = let("albedo_o", (p.f0 + (1.0 - p.f0) * weight_o) * (1.0 - loss_o));
    const Vec3<T> average_fresnel = let("average_fresnel", average_schlick(p.f0));
    return CompensatedGgx::single(p.f0, p.alpha, g) + fdez_aguera_lobe(average_fresnel, albedo_o, loss_o);
  }

  static Direction sample(const Parameters<double>& p, const Direction& wo, const std::array<double, 2>& u) {
    const double loss_o = GgxAlbedoLoss::evaluate(wo.z, p.alpha);
    std::array<double, 2> rest = u;
    if (pick_lobe<2>({loss_o, 1.0 - loss_o}, rest) == 0) return sample_cosine(rest);
    return CompensatedGgx::sample(p.alpha, wo, rest);
  }
  static double pdf(const Parameters<double>& p, const Direction& wi, const Direction& wo) {
    return lerp(CompensatedGgx::pdf(p.alpha, wi, wo), cosine_density(wi), GgxAlbedoLoss::evaluate(wo.z, p.alpha));
  }
};

}  // namespace lobefit
