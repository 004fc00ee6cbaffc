// The pieces of fibre scattering, each an exact function of doubles: what the hair reference is made of, and what
// Unreal's constants are fits to.
//
// Conventions (Marschner et al. 2003; d'Eon et al. 2011). The fibre is a dielectric cylinder of radius 1.
// Inclinations theta are measured from its normal plane: sin theta = component along the axis, for directions that both
// point away from the fibre, so that the specular cone is theta_r = -theta_i. phi is the azimuth difference, 0 on the
// retro side. h in [-1, 1] is the offset of a ray from the axis, sin gamma_i = h, sin gamma_t = h/η'. A lobe p = 0, 1,
// 2, … is a path of p inner segments: R, TT, TRT, ….
//
//   S(wi, wr) = Σ_p M_p(θi, θr) N_p(φ),   N_p(φ) = ½ ∫ A(p, h) D_p(φ - Φ(p, h)) dh                (d'Eon 2011, S3)
//
// S carries no cosine and wants none: ∫ M_p cosθ dθ = 1 and ∫ N_p dφ = ½ ∫ A dh, so a fibre under radiance L has
// the radiance, averaged over its width, L_r = ∫ S L dω, and ∫ S dω is its albedo. That is how Unreal (S3) and pbrt use
// it. The S of L_r = ∫ S' L cosθi dω (Marschner's, per unit width) is S' = S/cosθi.
#pragma once

#include <optional>
#include <vector>

#include "models/scalar.h"

namespace lobefit {

// ---- longitudinal -----------------------------------------------------------------------------------------------

/// An angle from the normal plane of the fibre; cosine ≥ 0. Both are kept, for neither gives the other near its ends.
struct Inclination {
  double sine, cosine;
};

/// exp(-|x|) I0(x), to a few units in the last place.
double bessel_i0_scaled(double x);
/// ln I0(x), without overflow.
double log_bessel_i0(double x);

/// M of d'Eon 2011, also S3's: exp(-sinθi sinθr/v) I0(cosθi cosθr/v) / (2v sinh(1/v)), which is a von
/// Mises-Fisher distribution around the mirrored direction, integrated over azimuth; hence ∫ M cosθi dθi = 1 for every
/// θr and v. Symmetric. `variance` v = β²; below 1e-24 it is taken as 1e-24: there M is 0 or a needle to double.
/// Evaluated as bessel_i0_scaled(cosθi cosθr/v) exp(-(1 - cos(θi + θr))/v) / (v (1 - exp(-2/v))): nothing overflows.
///
/// S3's own logarithmic form (v < 0.1) is not this one: its ln I0(x) for x > 12 ends in ½·1/(8x), where the expansion
/// has 1/(8x), which makes it 1/(16x) too small (0.5 % at x = 12; pbrt has the same slip), and 0.6931 stands for ln 2.
double longitudinal_scattering(double variance, const Inclination& i, const Inclination& r);
double longitudinal_scattering(double variance, double sin_theta_i, double sin_theta_r);

// ---- the cross-section ------------------------------------------------------------------------------------------

/// η' = √(η² - sin²θd)/cosθd: the index with which the projection of a skew ray on the cross-section obeys Snell's law
/// (Bravais; Marschner 2003). Infinite at cosθd = 0.
double bravais_index(double ior, double cos_theta_d);

/// Φ(p, h) = 2pγt - 2γi + pπ: where the ray at h leaves, without wrapping.
double exit_azimuth(int lobe, double bravais, double h);
/// |dΦ/dh|⁻¹: infinite on a caustic.
double exit_density(int lobe, double bravais, double h);
/// h > 0 of the caustic dΦ/dh = 0 of lobe p ≥ 2: √((p² - η'²)/(p² - 1)); none where η' ≥ p.
std::optional<double> caustic_offset(int lobe, double bravais);
/// All h with Φ(p, h) = phi modulo 2π, ascending. Tangent roots, on the caustic itself, may be missed.
std::vector<double> exit_offsets(int lobe, double bravais, double phi);

/// h_TT(φ) = sign(φ) cos(φ/2)/√(1 + a² - 2a sign(φ) sin(φ/2)), a = 1/η', φ in [-π, π]: the exact form that S3 prints.
/// It is the offset of the TT ray only where |φ| ≥ tt_azimuth_limit(η'); S3 does not say so, and nearer to φ = 0 it
/// returns values that belong to no ray.
double tt_offset(double bravais, double phi);
/// 2 asin(1/η'): no TT ray of a smooth cylinder leaves nearer to φ = 0.
double tt_azimuth_limit(double bravais);

/// What of Fresnel's law is meant.
enum class HairFresnel {
  schlick,     // F0 + (1 - F0)(1 - c)⁵, F0 = ((1 - η)/(1 + η))²: S3
  dielectric,  // exact, the mean of both polarisations
};
/// Share reflected at incidence cosine c from outside. At the point of a cylinder that a skew ray meets at offset h,
/// c = cosθd √(1 - h²). Marschner's pair of indices (η' for s, η²/η' for p, at γi) gives the same number.
/// The mean of polarisations is taken at each interface anew: partial polarisation on the way is not followed, here or
/// in any of the sources. At θ = 0, η = 1.55, following it changes the energy of TT by +.4 % and of TRT by -8.7 %.
double hair_fresnel(HairFresnel fresnel, double ior, double cosine);
/// 1 - F, to full relative precision at grazing incidence too.
double hair_transmittance(HairFresnel fresnel, double ior, double cosine);

/// How far a ray goes inside per traversal.
enum class HairAbsorption {
  path_length,  // exp(-2μ cosγt/cosθt): the chord 2cosγt of the circle, lengthened by the inclination; S3's code
  printed,  // exp(-2μ (1 + cos2γt)/cosθt) = exp(-4μ cos²γt/cosθt): S3's text, after Marschner 2003; not a length
};
/// μ = -¼ ln C (S3's code): then one traversal through the axis leaves √C and a TRT path C.
double hair_absorption(double color);

// ---- detectors --------------------------------------------------------------------------------------------------

/// Normal density: S3's Hair_g.
double gaussian_density(double deviation, double x);
/// D(φ, s, μ) = e^((φ-μ)/s)/(s (1 + e^((φ-μ)/s))²) of S3, for φ - μ = x; without overflow. Its variance is s²π²/3.
double logistic_density(double scale, double x);

enum class HairDetector { gaussian, logistic };
/// The density summed over all turns, so that it integrates to 1 around the fibre. (S3 sums nine.) `deviation` is the
/// standard deviation β of the unwrapped density, for the logistic too: s = β√3/π.
double wrapped_detector(HairDetector detector, double deviation, double x);

// ---- azimuthal --------------------------------------------------------------------------------------------------

/// One lobe in the cross-section, for one pair of inclinations.
struct AzimuthalLobe {
  int lobe = 0;
  double ior = 1.55;
  double cos_theta_d = 1.0;  // of the difference angle (θr - θi)/2
  double cos_theta_t = 1.0;  // inside the fibre
  double deviation = 0.1;    // β of the detector
  HairFresnel fresnel = HairFresnel::dielectric;
  HairAbsorption absorption = HairAbsorption::path_length;
  HairDetector detector = HairDetector::gaussian;
  /// R only: reflect by Fresnel's law at this cosine whatever the h (S3: that of the half vector), instead of at the
  /// point that the ray meets.
  std::optional<double> half_vector_cosine = {};
};

/// A(p, h) per channel: F for R, else (1 - F)² F^(p-1) T^p.
Rgb hair_attenuation(const AzimuthalLobe& lobe, const Rgb& color, double h);
/// N_p(φ) by adaptive Gauss-Kronrod quadrature over γi = asin h, in which the integrand is analytic, between caustics,
/// the rays that leave at φ and the flanks of the detector around them. Relative error below 1e-11, or 1e-13/β if that
/// is more: the rounding of φ itself moves a narrow lobe. Grey colours cost one channel.
Rgb azimuthal_scattering(const AzimuthalLobe& lobe, const Rgb& color, double phi);
/// One sample of N_p(φ): A D at one h. Its mean over h uniform in [-1, 1] is N_p.
Rgb azimuthal_sample(const AzimuthalLobe& lobe, const Rgb& color, double phi, double h);
/// ∫ N_p dφ = ½ ∫ A dh.
Rgb azimuthal_albedo(const AzimuthalLobe& lobe, const Rgb& color);

}  // namespace lobefit
