// Substrate's slab: an interface over a medium. The closure of every Substrate material is one of these, weighted by
// what lies above it (walk.h).
//
//   f = fuzz + (1 - E_fuzz) (specular + (1 - E_specular) body)
//
// with directional albedos E at the view: energy conservation by Turquin's scale, energy preservation by what is left
// for the body. The slides leave open, and we chose:
//   - f90 sets a colour alone, as they say: we divide it by its largest channel.
//   - f0 below .02 means no interface: grazing reflection fades out as in Unreal's Schlick term, so that f0 = 0 is
//   bare.
//   - anisotropic lobes take E of their mean alpha.
//   - The diffuse model is Chan's (2018) and takes roughness; it keeps .80 to .97 of the light. EON keeps all of it.
#pragma once

#include "models/diffuse/chan.h"
#include "models/diffuse/eon.h"
#include "models/diffuse/lambert.h"
#include "models/energy/compensation.h"
#include "models/energy/ggx_albedo.h"
#include "models/sampling.h"
#include "models/sheen/zeltner.h"
#include "models/specular/ggx.h"
#include "models/substrate/albedo_inversion.h"
#include "models/substrate/thin_scattering.h"

namespace lobefit {

/// How an opaque body scatters.
inline constexpr std::array<std::string_view, 3> slab_diffuse_choices{"chan", "eon", "lambert"};

/// The interface's albedo at cos_theta: of one lobe for F = 1, E, and E times Schlick's mean weight.
template <class T>
struct LobeAlbedo {
  T all, grazing;

  template <class G>
  LOBEFIT_TEXT static LobeAlbedo of(const G& cos_theta, const T& alpha) {
    const T albedo = let("lobe_albedo", 1.0 - call<GgxAlbedoLoss>(cos_theta, alpha));
    return {albedo, let("lobe_grazing", albedo * call<GgxSchlickWeight>(cos_theta, alpha))};
  }
  LOBEFIT_TEXT static LobeAlbedo mix(const LobeAlbedo& a, const LobeAlbedo& b, const T& weight) {
    return {lerp(a.all, b.all, weight), lerp(a.grazing, b.grazing, weight)};
  }
  /// With Fresnel and the light of further bounces (Turquin 2019).
  LOBEFIT_TEXT Vec3<T> specular(const Vec3<T>& f0, const Vec3<T>& f90) const {
    return (f0 * all + (f90 - f0) * grazing) * turquin_scale(f0, T(1.0 - all));
  }
};

/// f90 as the interface uses it: see the top of this file.
struct SlabGrazingReflectance {
  static constexpr const char* name = "slab_grazing_reflectance";
  static constexpr std::array arguments{"f0", "f90"};

  template <class T>
  LOBEFIT_TEXT static Vec3<T> evaluate(const Vec3<T>& f0, const Vec3<T>& f90) {
    const T present = let("present", saturate(50.0 * max(max(f0.x, f0.y), f0.z)));
    return f90 * (present / max(max(max(f90.x, f90.y), f90.z), 1e-6));
  }
};

struct Slab {
  static constexpr ModelInfo info{
      .name = "slab",
      .title = "Substrate slab",
      .source = "de Rousiers, Hillaire 2023, Unreal Engine Substrate: Authoring Materials that Matter (S2)",
      .reciprocal = false,
      .energy_conserving = false,
      .isotropic = false,
      // Chan's bump.
      .non_negative = false,
      .doc =
          "Interface of GGX facets (two lobes, F90 colour, fuzz on top) over a medium: opaque where the mean free path "
          "is 0 (Chan's diffuse), else scattering of all orders in a layer of the given thickness over black. "
          "Roughness is perceptual and shared with the diffuse part. Chan's diffuse gains or loses up to a fifth of "
          "the "
          "energy. Emissive light and glints are no part of a BRDF: seen from far, glints are the lobe itself."};

  template <class T>
  struct Parameters {
    Vec3<T> diffuse_albedo, f0, f90;
    T roughness, anisotropy, second_roughness, second_roughness_weight;
    T fuzz_amount;
    Vec3<T> fuzz_color;
    T fuzz_roughness;
    Vec3<T> mean_free_path;
    T phase_anisotropy, thickness;
    Vec3<T> specular_tint, emissive;
    T glint_density, diffuse_model;
  };

  template <class P, class Visit>
  static constexpr void describe(P& p, Visit&& visit) {
    visit(p.diffuse_albedo, ParameterInfo{.name = "diffuse_albedo",
                                          .symbol = "ρ",
                                          .initial = 0.5,
                                          .doc = "Reflectance of the medium, infinitely thick, after multiple "
                                                 "scattering, linear Rec.709 RGB."});
    visit(p.f0, specular_f0_parameter);
    visit(p.f90, ParameterInfo{.name = "f90",
                               .symbol = "F_90",
                               .initial = 1.0,
                               .tier = Tier::advanced,
                               .doc = "Colour of grazing reflections: divided by its largest channel."});
    visit(p.roughness, roughness_parameter);
    visit(p.anisotropy, ParameterInfo{.name = "anisotropy",
                                      .symbol = "a",
                                      .lower = -0.9,
                                      .upper = 0.9,
                                      .tier = Tier::advanced,
                                      .doc = "alpha_x = alpha (1 + a), alpha_y = alpha (1 - a), of both lobes."});
    visit(p.second_roughness, ParameterInfo{.name = "second_roughness",
                                            .symbol = "r_2",
                                            .initial = 0.8,
                                            .tier = Tier::advanced,
                                            .doc = "Perceptual roughness of the second lobe.",
                                            .perceptual_roughness = true});
    visit(p.second_roughness_weight, ParameterInfo{.name = "second_roughness_weight",
                                                   .symbol = "w_2",
                                                   .tier = Tier::advanced,
                                                   .doc = "Share of the second lobe in the specular reflection."});
    visit(p.fuzz_amount, ParameterInfo{.name = "fuzz_amount",
                                       .symbol = "z",
                                       .tier = Tier::advanced,
                                       .doc = "Share of the surface that fibres cover, on top of everything."});
    visit(p.fuzz_color,
          ParameterInfo{
              .name = "fuzz_color", .symbol = "c_z", .initial = 1.0, .tier = Tier::advanced, .doc = "Of the fibres."});
    visit(p.fuzz_roughness, ParameterInfo{.name = "fuzz_roughness",
                                          .symbol = "r_z",
                                          .lower = 0.01,
                                          .initial = 0.5,
                                          .tier = Tier::advanced,
                                          .doc = "Of the fibres: Zeltner's."});
    visit(p.mean_free_path, ParameterInfo{.name = "mean_free_path",
                                          .symbol = "MFP",
                                          .unit = "cm",
                                          .upper = 1000.0,
                                          .tier = Tier::full,
                                          .doc = "Of light in the medium; 0 is opaque."});
    visit(p.phase_anisotropy, ParameterInfo{.name = "phase_anisotropy",
                                            .symbol = "g",
                                            .lower = -0.9,
                                            .upper = 0.9,
                                            .tier = Tier::full,
                                            .doc = "Mean cosine of the scattering angle in the medium."});
    visit(p.thickness, ParameterInfo{.name = "thickness",
                                     .symbol = "t",
                                     .unit = "cm",
                                     .upper = 1000.0,
                                     .initial = 0.1,
                                     .tier = Tier::full,
                                     .doc = "Of the medium; a tree's vertical operators set it."});
    visit(p.specular_tint, ParameterInfo{.name = "specular_tint",
                                         .symbol = "c_s",
                                         .initial = 1.0,
                                         .tier = Tier::full,
                                         .doc = "Of the specular reflection: what a specular profile holds for this "
                                                "view and light. What it takes away is absorbed."});
    visit(p.emissive, ParameterInfo{.name = "emissive",
                                    .symbol = "L_e",
                                    .unit = "W/(m2 sr)",
                                    .upper = 1e6,
                                    .tier = Tier::full,
                                    .doc = "Light of the surface's own: no part of the BRDF."});
    visit(p.glint_density, ParameterInfo{.name = "glint_density",
                                         .symbol = "N_g",
                                         .unit = "1/uv2",
                                         .upper = 1e9,
                                         .tier = Tier::full,
                                         .doc = "Facets per unit of texture area; 0 is infinitely many. Seen from far "
                                                "the lobe is the same; the discrete lobe is not modelled yet."});
    visit(p.diffuse_model, ParameterInfo{.name = "diffuse_model",
                                         .symbol = "d",
                                         .tier = Tier::advanced,
                                         .doc = "Of an opaque body: chan (Substrate's), eon (keeps the energy; its "
                                                "roughness is .4 of the interface's) or lambert.",
                                         .choices = slab_diffuse_choices});
  }

  template <class T, class G>
  LOBEFIT_TEXT static Vec3<T> evaluate(const Parameters<T>& p, const Geometry<G>& g) {
    Vec3<T> opaque = choose(
        p.diffuse_model, [&] { return diffuse<0>(p, g); }, [&] { return diffuse<1>(p, g); },
        [&] { return diffuse<2>(p, g); });
    if constexpr (is_traced<T>) {
      return evaluate_over(p, g, with_medium(p, g, opaque));
    } else {
      // The medium is most of the work, and few slabs have one.
      return evaluate_over(p, g, has_medium(p) ? with_medium(p, g, opaque) : opaque);
    }
  }

  /// The diffuse models, each without a medium and with one.
  static constexpr int variant_count = 2 * static_cast<int>(slab_diffuse_choices.size());
  template <int variant>
  struct Variant {
    static constexpr ModelInfo info = Slab::info;
    template <class T>
    using Parameters = Slab::Parameters<T>;

    template <class T, class G>
    LOBEFIT_TEXT static Vec3<T> evaluate(const Slab::Parameters<T>& p, const Geometry<G>& g) {
      Vec3<T> body = diffuse<variant / 2>(p, g);
      if constexpr (variant % 2 == 1) body = with_medium(p, g, body);
      return evaluate_over(p, g, body);
    }
  };
  template <class Slot>
  static int variant(std::span<const Slot> flat) {
    const Parameters<double> p = unflatten<Slab, double, Slot>(flat);
    return 2 * choice_number(flat.back(), static_cast<int>(slab_diffuse_choices.size())) + (has_medium(p) ? 1 : 0);
  }

  /// E and E times Schlick's mean weight of both lobes in their shares.
  template <class T, class G>
  LOBEFIT_TEXT static LobeAlbedo<T> lobes_albedo(const Parameters<T>& p, const G& cos_theta) {
    return LobeAlbedo<T>::mix(LobeAlbedo<T>::of(cos_theta, T(square(p.roughness))),
                              LobeAlbedo<T>::of(cos_theta, T(square(p.second_roughness))), p.second_roughness_weight);
  }

  /// Directional albedo of the interface with both lobes, fuzz left out.
  template <class T, class G>
  LOBEFIT_TEXT static Vec3<T> specular_albedo(const Parameters<T>& p, const G& cos_theta) {
    return lobes_albedo(p, cos_theta).specular(p.f0, call<SlabGrazingReflectance>(p.f0, p.f90));
  }

  /// Directional albedo of one lobe each, for sampling and for choosing among closures: the body's as if Lambertian.
  static std::array<Rgb, 3> lobe_albedos(const Parameters<double>& p, double cos_theta) {
    const double fuzz = p.fuzz_amount * ZeltnerFit::Albedo::evaluate(cos_theta, p.fuzz_roughness);
    const Rgb specular = specular_albedo(p, cos_theta);
    return {p.fuzz_color * fuzz, p.specular_tint * specular * (1.0 - fuzz),
            p.diffuse_albedo * (1.0 - specular) * (1.0 - fuzz)};
  }

  static Direction sample(const Parameters<double>& p, const Direction& wo, std::array<double, 2> u) {
    switch (pick_lobe(shares(p, wo), u)) {
      case 0: return SheenZeltner::sample({p.fuzz_color, p.fuzz_roughness}, wo, u);
      case 1: return sample_visible_reflection(Distribution::ggx, alphas(p.roughness, p.anisotropy), wo, u);
      case 2: return sample_visible_reflection(Distribution::ggx, alphas(p.second_roughness, p.anisotropy), wo, u);
      default: return GrazingSampling::sample(p, wo, u);
    }
  }
  static double pdf(const Parameters<double>& p, const Direction& wi, const Direction& wo) {
    const std::array<double, 4> share = shares(p, wo);
    return share[0] * SheenZeltner::pdf({p.fuzz_color, p.fuzz_roughness}, wi, wo) +
           share[1] * visible_reflection_density(Distribution::ggx, alphas(p.roughness, p.anisotropy), wi, wo) +
           share[2] * visible_reflection_density(Distribution::ggx, alphas(p.second_roughness, p.anisotropy), wi, wo) +
           share[3] * GrazingSampling::pdf(p, wi, wo);
  }

 private:
  /// An opaque body's BRDF of unit albedo.
  template <int choice, class T, class G>
  LOBEFIT_TEXT static Vec3<T> diffuse(const Parameters<T>& p, const Geometry<G>& g) {
    if constexpr (choice == 0) {
      return Chan2018::evaluate(Chan2018::Parameters<T>{p.diffuse_albedo, p.roughness}, g);
    } else if constexpr (choice == 1) {
      return Eon::evaluate(Eon::Parameters<T>{p.diffuse_albedo, T(0.4 * p.roughness), T(1.0)}, g);
    } else {
      return Lambert::evaluate(Lambert::Parameters<T>{p.diffuse_albedo}, g);
    }
  }

  template <class T>
  static bool has_medium(const Parameters<T>& p) {
    return p.mean_free_path.x > 0.0 || p.mean_free_path.y > 0.0 || p.mean_free_path.z > 0.0;
  }

  /// Per channel the medium's scattering where the mean free path is not 0.
  template <class T, class G>
  LOBEFIT_TEXT static Vec3<T> with_medium(const Parameters<T>& p, const Geometry<G>& g, const Vec3<T>& opaque) {
    Vec3<T> depth = let("depth", p.thickness / max(p.mean_free_path, 1e-9));
    Vec3<T> scattering = let("scattering", single_scattering_albedo(p.diffuse_albedo, p.phase_anisotropy));
    Vec3<T> thin = let("thin", thin_scattering(scattering, depth, p.phase_anisotropy, g));
    return let("body", Vec3<T>{select(p.mean_free_path.x > 0.0, thin.x, opaque.x),
                               select(p.mean_free_path.y > 0.0, thin.y, opaque.y),
                               select(p.mean_free_path.z > 0.0, thin.z, opaque.z)});
  }

  template <class T, class G>
  LOBEFIT_TEXT static Vec3<T> evaluate_over(const Parameters<T>& p, const Geometry<G>& g, const Vec3<T>& body) {
    // The interface.
    Vec3<T> f90 = let("f90", call<SlabGrazingReflectance>(p.f0, p.f90));
    const T lobe = let("lobe", ggx_lobe(KullaContyAnisotropy::evaluate(T(square(p.roughness)), p.anisotropy), g));
    const T second =
        let("second", ggx_lobe(KullaContyAnisotropy::evaluate(T(square(p.second_roughness)), p.anisotropy), g));
    const LobeAlbedo<T> albedo = lobes_albedo(p, g.cos_theta_o);
    Vec3<T> fresnel = let("fresnel", call<SchlickFresnel>(g.cos_theta_d, p.f0, f90));
    Vec3<T> specular = let("specular", p.specular_tint * fresnel * lerp(lobe, second, p.second_roughness_weight) *
                                           turquin_scale(p.f0, T(1.0 - albedo.all)));
    Vec3<T> specular_albedo = let("specular_albedo", albedo.specular(p.f0, f90));

    const T fuzz_albedo = let("fuzz_albedo", p.fuzz_amount * call<ZeltnerFit::Albedo>(g.cos_theta_o, p.fuzz_roughness));
    Vec3<T> fuzz = let("fuzz", SheenZeltner::evaluate(SheenZeltner::Parameters<T>{p.fuzz_color, p.fuzz_roughness}, g));
    return fuzz * p.fuzz_amount + (specular + body * (1.0 - specular_albedo)) * (1.0 - fuzz_albedo);
  }

  static Alpha alphas(double roughness, double anisotropy) {
    const AlphaPair<double> alpha = KullaContyAnisotropy::evaluate(square(roughness), anisotropy);
    return {max(alpha.x, smallest_alpha), max(alpha.y, smallest_alpha)};
  }
  /// Fuzz, first and second lobe, body.
  static std::array<double, 4> shares(const Parameters<double>& p, const Direction& wo) {
    const auto strength = [](const Rgb& c) { return (c.x + c.y + c.z) / 3.0 + 1e-3; };
    const std::array<Rgb, 3> albedos = lobe_albedos(p, wo.z);
    const double fuzz = p.fuzz_amount > 0.0 ? strength(albedos[0]) : 0.0;
    const double specular = strength(albedos[1]), body = strength(albedos[2]), sum = fuzz + specular + body;
    return {fuzz / sum, specular * (1.0 - p.second_roughness_weight) / sum, specular * p.second_roughness_weight / sum,
            body / sum};
  }
};

}  // namespace lobefit
