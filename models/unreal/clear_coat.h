// Unreal's ClearCoat: a colourless film of index 1.5 over DefaultLit.
#pragma once

#include "models/unreal/default_lit.h"

namespace lobefit {

/// What a ray loses of the half vector h on its way into the film of index 1.5: inside it comes from w/1.5 - blend h.
/// The engine's polynomial; the exact value is cos/1.5 - √(1 - (1 - cos²)/1.5²), which it meets to .0042.
struct UnrealFilmBlend {
  static constexpr const char* name = "unreal_film_blend";
  static constexpr std::array arguments{"cosine"};

  template <class G>
  LOBEFIT_TEXT static auto evaluate(const G& cosine) {
    return (0.63 - 0.22 * cosine) * cosine - 0.745;
  }
};

struct UnrealClearCoat {
  static constexpr ModelInfo info{
      .name = "unreal_clear_coat",
      .title = "Unreal Engine 4 ClearCoat",
      .source = "Unreal Engine 4, ClearCoatBxDF (named in S4), as publicly described",
      .reciprocal = false,
      .energy_conserving = false,
      .doc =
          "A GGX lobe of F0 .04 over DefaultLit, which it dims by (1 - F)^2 and, where metallic, by absorption along "
          "the refracted paths: base_color/pi is what the film leaves of a path straight down and up, taken relative "
          "to that path. The pi is the engine's, and means that a film over white metal absorbs. The lower lobe's "
          "visibility has the view inside the film and the light outside: not reciprocal, and a smooth base loses a "
          "factor N.V outside over N.V inside, .61 at 60 degrees. clear_coat blends the whole from DefaultLit, where "
          "the engine keeps the view inside the film at clear_coat 0 too. The engine's second normal, of the lower "
          "layer, is z here."};

  template <class T>
  struct Parameters : UnrealSurface<T> {
    T clear_coat, clear_coat_roughness;
  };

  template <class P, class Visit>
  static constexpr void describe(P& p, Visit&& visit) {
    describe_unreal_surface(p, visit);
    visit(
        p.clear_coat,
        ParameterInfo{
            .name = "clear_coat", .symbol = "cc", .initial = 1.0, .doc = "Share of the surface that the film covers."});
    visit(p.clear_coat_roughness, ParameterInfo{.name = "clear_coat_roughness",
                                                .symbol = "cc_r",
                                                .initial = 0.1,
                                                .doc = "Perceptual roughness of the film, at least .02."});
  }

  template <class T, class G>
  LOBEFIT_TEXT static Vec3<T> evaluate(const Parameters<T>& p, const Geometry<G>& g) {
    // The film's own reflection.
    const T coat_alpha = let("coat_alpha", square(max(p.clear_coat_roughness, 0.02)));
    const G coat_fresnel = let("coat_fresnel", lerp(0.04, 1.0, call<Pow5>(1.0 - g.cos_theta_d)));
    const T coat =
        let("coat", coat_fresnel * call<UnrealGgx>(g.sin2_theta_h, g.cos_theta_i, g.cos_theta_o, coat_alpha));

    // Light and view inside the film. The engine keeps their cosines off 0.
    const G blend = let("blend", call<UnrealFilmBlend>(g.cos_theta_d));
    const G bent = let("bent", blend * g.cos_theta_h);
    const G film_cos_i = let("film_cos_i", min(max(g.cos_theta_i / 1.5 - bent, 0.001), 1.0));
    const G film_cos_o = let("film_cos_o", min(max(g.cos_theta_o / 1.5 - bent, 0.001), 1.0));
    const G film_cos_d = let("film_cos_d", saturate(g.cos_theta_d / 1.5 - blend));
    Vec3<T> passed = let("passed", square(1.0 - coat_fresnel) * transmittance(p, film_cos_i, film_cos_o));

    // DefaultLit as it is, and as seen through the film.
    const T alpha = let("alpha", unreal_alpha(p.roughness));
    const T d = let("d", call<GgxDistribution>(g.sin2_theta_h, alpha));
    const T bare_lobe = let("bare_lobe", d * call<SmithJointApproximation>(g.cos_theta_i, g.cos_theta_o, alpha));
    const T film_lobe = let("film_lobe", d * call<SmithJointApproximation>(g.cos_theta_i, film_cos_o, alpha));
    Vec3<T> specular_color = unreal_specular_color(p);
    Vec3<T> diffuse = let("diffuse", unreal_diffuse_color(p) / pi);
    Vec3<T> bare = let("bare", diffuse + unreal_fresnel(g.cos_theta_d, specular_color) * bare_lobe);
    Vec3<T> covered = let("covered", (diffuse + unreal_fresnel(film_cos_d, specular_color) * film_lobe) * passed);
    // Not by lerp(): next to a sharp lobe of weight 0 the rest would drown in rounding.
    return bare * (1.0 - p.clear_coat) + (covered + coat) * p.clear_coat;
  }

  static Direction sample(const Parameters<double>& p, const Direction& wo, std::array<double, 2> u) {
    const double share = coat_share(p, wo);
    if (pick_lobe(std::array{share, 1.0 - share}, u) == 1) return base_lobes(p, wo).sample(wo, u);
    return sample_visible_reflection(Distribution::ggx, film_alpha(p), wo, u);
  }
  static double pdf(const Parameters<double>& p, const Direction& wi, const Direction& wo) {
    const double coat = visible_reflection_density(Distribution::ggx, film_alpha(p), wi, wo);
    return lerp(base_lobes(p, wo).pdf(wi, wo), coat, coat_share(p, wo));
  }

 private:
  /// Of the way down and up through the film, over that of the straight way; for metals.
  template <class T, class G>
  LOBEFIT_TEXT static Vec3<T> transmittance(const Parameters<T>& p, const G& cos_i, const G& cos_o) {
    // Half the path beyond the straight one: base_color/π stands for the straight one, of length 2.
    const G excess = let("excess", 0.5 * max(1.0 / cos_i + 1.0 / cos_o - 2.0, 0.0));
    const auto left = [&](const T& color) { return pow(max(color / pi, 1e-4), excess); };
    Vec3<T> absorbed = let("absorbed", Vec3<T>{left(p.base_color.x), left(p.base_color.y), left(p.base_color.z)});
    return lerp(Vec3<T>{T(1.0), T(1.0), T(1.0)}, absorbed, p.metallic);
  }

  static double film_alpha(const Parameters<double>& p) { return square(max(p.clear_coat_roughness, 0.02)); }
  static UnrealLobes base_lobes(const Parameters<double>& p, const Direction& wo) {
    return {p, unreal_alpha(p.roughness), wo};
  }
  static double coat_share(const Parameters<double>& p, const Direction& wo) {
    const double coat = p.clear_coat * lerp(0.04, 1.0, pow5(1.0 - wo.z));
    return coat / (coat + 0.2);
  }
};

}  // namespace lobefit
