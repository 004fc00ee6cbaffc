// Light that one hair scatters: the far-field fibre model of Marschner and d'Eon, by quadrature over the cross-section.
//
//   S(wi, wo) = Σ_p M_p(θi, θo) N_p(φ) over R, TT and TRT
//
// Ground truth for Unreal's hair (S3), whose source carries the same integrals as HairShadingRef. z is the fibre axis,
// directions are anywhere on the sphere, and f = S in 1/sr is meant without any cosine: the radiance that leaves is
// ∫ S L dω, and ∫ S dω is the albedo (scattering.h).
#pragma once

#include <span>

#include "models/parameter.h"
#include "reference/hair/scattering.h"
#include "reference/integrator.h"

namespace lobefit {

/// Two models share M, Φ, the detector and absorption, and differ in three places:
///
///                    unreal_reference (S3's code)                     d_eon (separable)
///   R, longitudinal  the view is mirrored at a normal tilted by α_R;  M(θi, θo - α_R), β_R
///                    β_R √2 cos(φ/2): d'Eon, Marschner, Hanika 2014
///   R, Fresnel       at the half vector, the same for every h         at the point each ray meets, so that at equal
///                    (S3's text gives A(0, h) so too)                 absorption 0 Σ_p A(p, h) = 1 for every h
///   cosθt            of the light: sinθi/η                            of the difference angle: sinθd/η, as in η'
///
/// - unreal_reference moves R by 2α_R cos(φ/2) where d_eon and S3's text (sinθi + sinθo - α_R) move it by α_R; with the
///   same α_R = -2 shift that is twice as far at φ = 0. S3 does not remark on it. Its M is unbounded on the line φ = π,
///   sinθi = -sinθo, where √2 cos(φ/2) vanishes; it stays integrable.
/// - unreal_reference is not reciprocal at absorption > 0 even without tilt, because of θt; d_eon is.
/// - Neither conserves energy exactly, for M and N share θd: the energy of a lobe is taken at other θd's than its rays
///   had, and differently for lobes of different width. White hair (R + TT + TRT, residual .7 % at θ = 0) has an albedo
///   of up to 1.023 in unreal_reference (r = 1, θ = 0) and .996 in d_eon, and loses up to a quarter near θ = 80°. d_eon
///   with equal widths and no tilt conserves it to the residual of TRRT and beyond.
/// - In neither is S/cosθi, the curve's reciprocal quantity, symmetric off the specular cone; S itself may be.
/// S3's code differs further in what is only numerics: 16 stratified h (their mean is the integral), nine turns of the
/// detector, float fits of ln I0 (see longitudinal_scattering). None is kept.
enum class HairForm { unreal_reference, d_eon };

enum class HairLobes { all, r, tt, trt };

struct Hair {
  static constexpr std::string_view name = "hair";
  static constexpr std::string_view doc =
      "One hair fibre: R, TT and TRT by quadrature over the cross-section. z is the fibre axis; the value is S without "
      "cosine: radiance out = ∫ S L dω.";
  static constexpr std::string_view source =
      "d'Eon et al. 2011, An Energy-Conserving Hair Reflectance Model; Marschner et al. 2003; HairShadingRef (S3)";
  static constexpr std::array<std::string_view, 4> lobe_choices{"all", "r", "tt", "trt"};
  static constexpr std::array<std::string_view, 2> forms{"unreal_reference", "d_eon"};
  static constexpr std::array<std::string_view, 2> fresnels{"schlick", "dielectric"};
  static constexpr std::array<std::string_view, 2> absorptions{"path_length", "printed"};
  static constexpr std::array<std::string_view, 2> detectors{"gaussian", "logistic"};

  template <class T>
  struct Parameters {
    Vec3<T> base_color;
    T roughness;
    T ior;
    T shift;
    T width_r, width_tt, width_trt;
    T tilt_r, tilt_tt, tilt_trt;
    T azimuthal_width;
    T lobes;
    T form;
    T fresnel;
    T absorption;
    T azimuthal;
  };

  template <class P, class Visit>
  static constexpr void describe(P& p, Visit&& visit) {
    visit(
        p.base_color,
        ParameterInfo{.name = "base_color",
                      .symbol = "C",
                      .initial = 1.0,
                      .doc = "What a TRT path along the diameter leaves of white: absorption is -¼ ln C per radius."});
    visit(p.roughness,
          ParameterInfo{.name = "roughness",
                        .symbol = "r",
                        .lower = 1.0 / 255.0,
                        .upper = 1.0,
                        .initial = 0.3,
                        .doc = "Perceptual roughness: the widths of the lobes are multiples of its square.",
                        .perceptual_roughness = true});
    visit(p.ior, ParameterInfo{.name = "ior",
                               .symbol = "η",
                               .lower = 1.0,
                               .upper = 3.0,
                               .initial = 1.55,
                               .doc = "Refractive index of the fibre."});
    visit(p.shift, ParameterInfo{.name = "shift",
                                 .symbol = "α",
                                 .unit = "rad",
                                 .lower = -0.2,
                                 .upper = 0.2,
                                 .initial = 0.035,
                                 .doc = "Tilt of the cuticle scales; 0 leaves the lobes on the specular cone."});
    const auto width = [&](auto& member, std::string_view parameter, std::string_view symbol, double initial,
                           std::string_view text) {
      visit(member, ParameterInfo{.name = parameter,
                                  .symbol = symbol,
                                  .lower = 0.01,
                                  .upper = 8.0,
                                  .initial = initial,
                                  .tier = Tier::advanced,
                                  .doc = text});
    };
    width(p.width_r, "width_r", "β_R/r²", 1.0, "Width of R over roughness².");
    width(p.width_tt, "width_tt", "β_TT/r²", 0.5, "Width of TT over roughness².");
    width(p.width_trt, "width_trt", "β_TRT/r²", 2.0, "Width of TRT over roughness².");
    const auto tilt = [&](auto& member, std::string_view parameter, std::string_view symbol, double initial,
                          std::string_view text) {
      visit(member, ParameterInfo{.name = parameter,
                                  .symbol = symbol,
                                  .lower = -8.0,
                                  .upper = 8.0,
                                  .initial = initial,
                                  .tier = Tier::advanced,
                                  .doc = text});
    };
    tilt(p.tilt_r, "tilt_r", "α_R/α", -2.0, "Tilt of R over shift.");
    tilt(p.tilt_tt, "tilt_tt", "α_TT/α", 1.0, "Tilt of TT over shift.");
    tilt(p.tilt_trt, "tilt_trt", "α_TRT/α", 4.0, "Tilt of TRT over shift.");
    width(p.azimuthal_width, "azimuthal_width", "β_N/β_M", 1.0, "Azimuthal width of every lobe over its longitudinal.");
    const auto choice = [&](auto& member, std::string_view parameter, std::span<const std::string_view> choices,
                            std::string_view text) {
      visit(member, ParameterInfo{.name = parameter,
                                  .upper = static_cast<double>(choices.size() - 1),
                                  .tier = parameter == "lobes" ? Tier::base : Tier::advanced,
                                  .doc = text,
                                  .choices = choices});
    };
    choice(p.lobes, "lobes", lobe_choices, "The paths of light to sum.");
    choice(p.form, "form", forms,
           "unreal_reference: S3's code, R's tilt and width depend on azimuth; d_eon: separable lobes, reciprocal "
           "without tilt.");
    choice(p.fresnel, "fresnel", fresnels, "Schlick's approximation, as S3, or Fresnel's law.");
    choice(p.absorption, "absorption", absorptions,
           "path_length: exp(-2μ cosγt/cosθt) per traversal; printed: S3's text, exp(-2μ(1 + cos2γt)/cosθt).");
    choice(p.azimuthal, "azimuthal", detectors, "Shape of the azimuthal detector; both have the same deviation.");
  }
};

/// Inclinations, azimuth and what the lobes need of them.
struct FibrePair {
  Inclination light, view;
  double phi;                 // in [0, π]
  double cos_theta_d;         // of (θo - θi)/2
  double half_vector_cosine;  // wi·h
};
FibrePair fibre_pair(const Direction& wi, const Direction& wo);

/// One fibre with its parameters. `fast` has no meaning here: all is in double.
class HairFibre : public Integrator {
 public:
  explicit HairFibre(const ParameterValues& values);

  int channels() const override;
  bool has_exact() const override { return true; }
  void exact_row(const Direction& wo, std::span<const Direction> wi, const Line& line) const override;
  void sample_row(const Direction& wo, std::span<const Direction> wi, const SamplePoints& points, std::uint32_t samples,
                  bool fast, const Line& line) const override;

  /// M_p with the tilt and the width of the lobe.
  double longitudinal(int lobe, const FibrePair& pair) const;
  /// What N_p is made of.
  AzimuthalLobe azimuthal(int lobe, const FibrePair& pair) const;

 private:
  bool has(int lobe) const { return lobes_ == HairLobes::all || static_cast<int>(lobes_) == lobe + 1; }

  Rgb base_color_;
  double ior_, azimuthal_width_;
  std::array<double, 3> width_, tilt_;  // β in radians, α in radians
  HairLobes lobes_;
  HairForm form_;
  HairFresnel fresnel_;
  HairAbsorption absorption_;
  HairDetector detector_;
};

}  // namespace lobefit
