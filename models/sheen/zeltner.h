// Fuzz: the sheen of a volume of fibres as a linearly transformed cosine.
#pragma once

#include "models/sheen/sheen.h"

namespace lobefit {

/// MaterialX's analytic fits to the table of Zeltner et al.: N·V and roughness in [0.01, 1].
///
/// In the view's frame, its x axis below the view, a cosine lobe D_o = cos/π is stretched by the inverse of
/// M⁻¹ = [[a, 0, b], [0, a, 0], [0, 0, 1]] and scaled by its albedo R:
///
///   f μi = R D_o(M⁻¹ω/|M⁻¹ω|) |M⁻¹|/|M⁻¹ω|³ = R a² μi/(π |M⁻¹ω|⁴).
///
/// The cosines cancel. M⁻¹ maps the hemisphere onto itself, so that R is the directional albedo exactly.
struct ZeltnerFit {
  /// R. As printed it falls to -2e-5 around roughness 0.09, where its offset is negative: hence the maximum.
  struct Albedo {
    static constexpr const char* name = "sheen_albedo";
    static constexpr std::array arguments{"cos_theta", "roughness"};

    template <class G, class T>
    LOBEFIT_TEXT static T evaluate(const G& cos_theta, const T& roughness) {
      const T y = roughness;
      const T width = let("width", y * (0.0206607 + 1.58491 * y) / (0.0379424 + y * (1.32227 + y)));
      const T mean = let("mean", y * (-0.193854 + y * (-1.14885 + y * (1.7932 - 0.95943 * y * y))) / (0.046391 + y));
      const T offset =
          let("offset", y * (0.000654023 + (-0.0207818 + 0.119681 * y) * y) / (1.26264 + y * (-1.92021 + y)));
      const T deviation = let("deviation", (cos_theta - mean) / width);
      constexpr double root_two_pi = 2.5066282746310002;
      return max(exp(-0.5 * deviation * deviation) / (width * root_two_pi) + offset, 0.0);
    }
  };

  /// a.
  struct Scale {
    static constexpr const char* name = "sheen_scale";
    static constexpr std::array arguments{"cos_theta", "roughness"};

    template <class G, class T>
    LOBEFIT_TEXT static T evaluate(const G& cos_theta, const T& roughness) {
      return (2.58126 * cos_theta + 0.813703 * roughness) * roughness /
             (1.0 + 0.310327 * cos_theta * cos_theta + 2.60994 * cos_theta * roughness);
    }
  };

  /// b over the sine of the view: b = √(1 - μ) (y - 1) y³/…, and √(1 - μ) = sin θ/√(1 + μ) without cancellation.
  struct Lean {
    static constexpr const char* name = "sheen_lean";
    static constexpr std::array arguments{"cos_theta", "roughness"};

    template <class G, class T>
    LOBEFIT_TEXT static T evaluate(const G& cos_theta, const T& roughness) {
      const T y = roughness;
      const T smoothness = let("smoothness", 1.0 - y);
      // 1.71228 - 1.71506 y.
      const T linear = let("linear", 1.71506 * smoothness - 0.00278);
      const T rational = let("rational", 0.0000254053 + cos_theta * (linear + 1.34174 * cos_theta));
      return -smoothness * y * y * y / (rational * sqrt(1.0 + cos_theta));
    }
  };
};

struct SheenZeltner {
  static constexpr ModelInfo info{
      .name = "sheen_zeltner",
      .title = "Multiple-scattering sheen as a linearly transformed cosine",
      .source =
          "Zeltner, Burley, Chiang 2022, Practical Multiple-Scattering Sheen Using Linearly Transformed Cosines; "
          "MaterialX's analytic fits",
      .reciprocal = false,
      .energy_conserving = true,
      .doc = "Substrate's fuzz without what lies below it. The lobe is fitted view by view."};

  template <class T>
  struct Parameters {
    Vec3<T> color;
    T roughness;
  };

  template <class P, class Visit>
  static constexpr void describe(P& p, Visit&& visit) {
    visit(p.color, sheen_color_parameter);
    visit(p.roughness, ParameterInfo{.name = "roughness",
                                     .symbol = "y",
                                     .lower = 0.01,
                                     .initial = 0.5,
                                     .doc = "Of the fibres, the table's own; the fits begin at 0.01."});
  }

  template <class T, class G>
  LOBEFIT_TEXT static Vec3<T> evaluate(const Parameters<T>& p, const Geometry<G>& g) {
    const T albedo = let("albedo", call<ZeltnerFit::Albedo>(g.cos_theta_o, p.roughness));
    const T a = let("a", call<ZeltnerFit::Scale>(g.cos_theta_o, p.roughness));
    const T lean = let("lean", call<ZeltnerFit::Lean>(g.cos_theta_o, p.roughness));
    // The view's azimuth; at the normal, where b vanishes, any.
    const auto oblique = g.sin_theta_o > 1e-9;
    const G c = let("c", select(oblique, g.wo.x / max(g.sin_theta_o, 1e-9), G(1.0)));
    const G s = let("s", select(oblique, g.wo.y / max(g.sin_theta_o, 1e-9), G(0.0)));
    // M⁻¹ω by its components: expanded, |M⁻¹ω|² would cancel where the light grazes.
    const T x = let("x", a * (c * g.wi.x + s * g.wi.y) + lean * (g.sin_theta_o * g.cos_theta_i));
    const T y = let("y", a * (c * g.wi.y - s * g.wi.x));
    const T length2 = let("length2", x * x + y * y + square(g.cos_theta_i));
    return p.color * (albedo * square(a / length2) / pi);
  }

  /// Exactly the lobe: a cosine's direction through M.
  static Direction sample(const Parameters<double>& p, const Direction& wo, const std::array<double, 2>& u) {
    const Direction cosine = sample_cosine(u);
    const Frame frame(wo);
    const double a = ZeltnerFit::Scale::evaluate(wo.z, p.roughness);
    const double b = ZeltnerFit::Lean::evaluate(wo.z, p.roughness) * frame.sine;
    const double x = (cosine.x - b * cosine.z) / a, y = cosine.y / a;
    return normalize(Direction{frame.c * x - frame.s * y, frame.s * x + frame.c * y, cosine.z});
  }
  static double pdf(const Parameters<double>& p, const Direction& wi, const Direction& wo) {
    if (wi.z <= 0.0) return 0.0;
    const Frame frame(wo);
    const double a = ZeltnerFit::Scale::evaluate(wo.z, p.roughness);
    const double b = ZeltnerFit::Lean::evaluate(wo.z, p.roughness) * frame.sine;
    const double x = frame.c * wi.x + frame.s * wi.y, y = frame.c * wi.y - frame.s * wi.x;
    const double length2 = (a * x + b * wi.z) * (a * x + b * wi.z) + a * a * y * y + wi.z * wi.z;
    return wi.z * a * a / (pi * length2 * length2);
  }

 private:
  /// The view's azimuth.
  struct Frame {
    explicit Frame(const Direction& wo)
        : sine(std::hypot(wo.x, wo.y)), c(sine > 0.0 ? wo.x / sine : 1.0), s(sine > 0.0 ? wo.y / sine : 0.0) {}
    double sine, c, s;
  };
};

}  // namespace lobefit
