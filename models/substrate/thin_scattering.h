// Light that a plane-parallel homogeneous medium scatters back: Substrate's "optically thin" scattering, without the
// four-dimensional table that Unreal reads for it.
//
// In an isotropic medium of single scattering albedo ω and optical depth τ (Chandrasekhar 1960, Radiative Transfer,
// chapter VIII; X + Y and X - Y for his X and Y)
//
//   f(μi, μo) = ω (S(μi) D(μo) + D(μi) S(μo)) / (8π (μi + μo))
//
// exactly: S and D are the source at the faces, of beams that enter both of them alike, or with opposite signs, and
// have three arguments, not four. With S = (1 + e^(-τ/μ)) (1 + σ) and D = (1 - e^(-τ/μ)) (1 + δ), σ = δ = 0 is single
// scattering, and nothing cancels in thin slabs. Two streams give S and D to 11 %, and polynomials
// in √(1 - ω), τ and μ correct σ and δ: 2 x 54 numbers in thin_scattering_entries.h, fitted to adding-doubling by
// scripts/scattering_table.
//
// Other media: single scattering exact; the other orders are those of the isotropic medium of similar diffusion,
// τ' = τ (1 - ω g) and ω' = ω (1 - g)/(1 - ω g) (van de Hulst 1980, Multiple Light Scattering). That counts light that
// has been deflected little, and then once more, as scattered once: by so much its single scattering exceeds that of τ
// and ω (1 - g), and this is given back, weighted to return no more than comes in. Where g < 0, two scatterings go
// forwards: half of the orders have the phase function of g².
//
// Errors against adding-doubling, of f relative, and of the directional albedo, at worst and rms
// (tests/thin_scattering_test.cpp prints them: isotropic, ω of 0 to 1, τ of 3e-4 to 100, all cosines from .002; others,
// ω of .3 to 1, τ of .02 to 20, cosines from .05, all azimuths):
//
//               f             albedo
//   g = 0       .006, .0015   .004, .0005
//   g = .2      .065, .023    .017, .006
//   g = .5      .29,  .094    .075, .025
//   g = .8      .80,  .24     .20,  .07
//   g = -.2     .030, .014    .013, .004
//   g = -.5     .30,  .058    .090, .021
//   g = -.8     .81,  .24     .16,  .050
//
// The albedo stays below 1. Where f is all but level, it may fall as the slab grows deeper: by .7 % in media of |g| up
// to a half, by 2.6 % at -.9.
#pragma once

#include "models/geometry.h"
#include "models/substrate/thin_scattering_entries.h"

namespace lobefit {

/// x coth(x/2) - 2, for x ≥ 0.
struct CothExcess {
  static constexpr const char* name = "coth_excess";
  static constexpr std::array arguments{"x"};

  template <class T>
  LOBEFIT_TEXT static T evaluate(const T& x) {
    const T x2 = let("x2", x * x);
    const T series =
        let("series",
            x2 * (1.0 / 6.0 - x2 * (1.0 / 360.0 - x2 * (1.0 / 15120.0 - x2 * (1.0 / 604800.0 - x2 / 23950080.0)))));
    const T bounded = let("bounded", max(x, 0.5));
    const T e = let("e", exp(-bounded));
    return select(x < 0.5, series, bounded * (1.0 + e) / (1.0 - e) - 2.0);
  }
};

/// Henyey-Greenstein's phase function by 4π: 1 where g = 0. With L·V, minus the cosine of the deflection.
struct HenyeyGreenstein {
  static constexpr const char* name = "henyey_greenstein";
  static constexpr std::array arguments{"g", "cos_light_view"};

  template <class T>
  LOBEFIT_TEXT static T evaluate(const T& g, const T& cos_light_view) {
    const T d = let("d", 1.0 + g * g + 2.0 * g * cos_light_view);
    return (1.0 - g * g) / (d * sqrt(d));
  }
};

/// An isotropic slab, as its two-stream solution and the corrections read it.
template <class T>
struct IsotropicSlab {
  T albedo, depth;
  T gamma, k, decay;              // √(1 - ω); the streams fall off as exp(-k τ); x coth(x/2) - 2 of k τ
  T depth_coordinate, softening;  // of the corrections

  /// `absorption` is 1 - ω.
  LOBEFIT_TEXT static IsotropicSlab make(const T& albedo, const T& absorption, const T& depth) {
    const T gamma = let("gamma", sqrt(absorption));
    // √3 γ is diffusion's. Below 1 everywhere: beams decay faster, and the two exponentials never meet.
    const T k = let("k", 1.7320508 * gamma * (1.0 - 0.46 * absorption));
    return {.albedo = albedo,
            .depth = depth,
            .gamma = gamma,
            .k = k,
            .decay = let("decay", call<CothExcess>(T(k * depth))),
            .depth_coordinate = let("depth_coordinate", sqrt(sqrt(depth / (depth + 2.0)))),
            .softening = let("softening", 0.3 * depth / (depth + 1.0))};
  }
  /// √μ in thick slabs; in thin ones the same from 0 to 1, but fastest at μ ~ τ.
  LOBEFIT_TEXT T direction_coordinate(const T& mu) const { return sqrt(mu * (1.0 + softening) / (mu + softening)); }
  /// σ and δ of two streams along ±60°, with k of above; `excess` is x coth(x/2) - 2 of τ/μ.
  LOBEFIT_TEXT T symmetric(const T& mu, const T& excess) const {
    const T q = let("q", k * k * mu * mu);
    return 2.0 * albedo * depth * (1.0 / (2.0 + excess) - q / (2.0 + decay)) /
           ((1.0 - q) * (1.0 + 0.5 * k * k * depth / (2.0 + decay)));
  }
  LOBEFIT_TEXT T antisymmetric(const T& mu, const T& excess) const {
    const T q = let("q", k * k * mu * mu);
    return 2.0 * albedo * mu * mu * (excess - decay) / ((1.0 - q) * (depth + 1.0 + 0.5 * decay));
  }
};

/// A polynomial of degree `terms` - 1 in x; its coefficients, highest first, are entries[first], …, and themselves
/// polynomials in the other variables. Recursions, because loops over models don't vectorise around loops in texts.
template <const auto& entries, std::size_t first, std::size_t terms, class T>
LOBEFIT_TEXT T entry_polynomial(const T& x) {
  constexpr double last = entries[first + terms - 1];
  if constexpr (terms == 1) {
    return T(last);
  } else {
    return entry_polynomial<entries, first, terms - 1>(x) * x + last;
  }
}
template <const auto& entries, std::size_t first, std::size_t terms, class T, class... U>
LOBEFIT_TEXT T entry_polynomial(const T& x, const U&... others) {
  constexpr std::size_t last = first + (terms - 1) * scattering_depth_terms;
  const T low = entry_polynomial<entries, last, scattering_depth_terms>(others...);
  if constexpr (terms == 1) {
    return low;
  } else {
    return entry_polynomial<entries, first, terms - 1>(x, others...) * x + low;
  }
}

/// The correction at one slab: a polynomial of the direction's coordinate.
template <const auto& entries, class T>
struct SlabCorrection {
  static_assert(scattering_mu_terms == 3);
  T a, b, c;

  LOBEFIT_TEXT static SlabCorrection make(const IsotropicSlab<T>& slab) {
    constexpr std::size_t terms = scattering_gamma_terms, stride = terms * scattering_depth_terms;
    // Centred: powers of such variables have small coefficients, which float can hold.
    const T x = let("x", 2.0 * slab.gamma - 1.0), y = let("y", 2.0 * slab.depth_coordinate - 1.0);
    return {.a = let("a", entry_polynomial<entries, 0, terms>(x, y)),
            .b = let("b", entry_polynomial<entries, stride, terms>(x, y)),
            .c = let("c", entry_polynomial<entries, 2 * stride, terms>(x, y))};
  }
  LOBEFIT_TEXT T operator()(const T& direction_coordinate) const {
    const T z = let("z", 2.0 * direction_coordinate - 1.0);
    return (a * z + b) * z + c;
  }
};

/// What a slab does to a beam at one of its cosines.
template <class T>
struct SlabBeam {
  T sum, ratio;                // 1 + e, and (1 - e)/(1 + e) = tanh(x/2), e = exp(-τ/μ)
  T symmetric, antisymmetric;  // σ and δ

  template <class Symmetric, class Antisymmetric>
  LOBEFIT_TEXT static SlabBeam make(const IsotropicSlab<T>& slab, const Symmetric& symmetric_correction,
                                    const Antisymmetric& antisymmetric_correction, const T& mu) {
    const T x = let("x", slab.depth / mu);
    const T excess = let("excess", call<CothExcess>(x));
    const T coordinate = let("coordinate", slab.direction_coordinate(mu));
    return {
        .sum = let("sum", 1.0 + exp(-x)),
        .ratio = let("ratio", x / (2.0 + excess)),
        .symmetric = let("symmetric", symmetric_correction(coordinate) * slab.symmetric(mu, excess)),
        .antisymmetric = let("antisymmetric", antisymmetric_correction(coordinate) * slab.antisymmetric(mu, excess))};
  }
};

/// f of one channel.
struct ThinScattering {
  static constexpr const char* name = "thin_scattering";
  static constexpr std::array arguments{
      "single_scattering_albedo", "optical_depth", "g", "cos_theta_i", "cos_theta_o", "cos_light_view"};
  /// Deeper is as good as infinitely deep, and flatter as good as grazing: f has limits there.
  static constexpr double most_depth = 1e6, smallest_cosine = 1e-4;

  template <class T>
  LOBEFIT_TEXT static T evaluate(const T& single_scattering_albedo, const T& optical_depth, const T& g,
                                 const T& cos_theta_i, const T& cos_theta_o, const T& cos_light_view) {
    const T mu_i = let("mu_i", max(cos_theta_i, smallest_cosine));
    const T mu_o = let("mu_o", max(cos_theta_o, smallest_cosine));
    const T cosines = let("cosines", mu_i + mu_o);
    const T depth = let("depth", min(max(optical_depth, 0.0), most_depth));
    const T albedo = let("albedo", saturate(single_scattering_albedo));

    // 1 - e^(-y) = y (1 + e^(-y))/(y coth(y/2)), as exact in thin slabs.
    const T y = let("y", depth * cosines / (mu_i * mu_o));
    const T scattered = let("scattered", albedo * y * (1.0 + exp(-y)) / (2.0 + call<CothExcess>(y)));
    const T once = let("once", scattered * call<HenyeyGreenstein>(g, cos_light_view));

    const T kept = let("kept", 1.0 - albedo * g);
    // Not const: see make_geometry().
    IsotropicSlab<T> similar = IsotropicSlab<T>::make(let("similar_albedo", albedo * (1.0 - g) / kept),
                                                      let("absorption", (1.0 - albedo) / kept), T(depth * kept));
    auto symmetric = SlabCorrection<scattering_symmetric_entries, T>::make(similar);
    auto antisymmetric = SlabCorrection<scattering_antisymmetric_entries, T>::make(similar);
    SlabBeam<T> i = SlabBeam<T>::make(similar, symmetric, antisymmetric, mu_i);
    SlabBeam<T> o = SlabBeam<T>::make(similar, symmetric, antisymmetric, mu_o);
    const T faces = let("faces", 0.5 * similar.albedo * (i.sum * o.sum));
    const T similar_once = let("similar_once", faces * (i.ratio + o.ratio));
    const T more = let("more", faces * (o.ratio * (i.symmetric + o.antisymmetric + i.symmetric * o.antisymmetric) +
                                        i.ratio * (o.symmetric + i.antisymmetric + o.symmetric * i.antisymmetric)));

    // 3 μi μo keeps the energy of a white half space to first order in g, and is too much for directions near the
    // normal.
    const T weight = let("weight", 6.0 * (mu_i * mu_o) / (1.0 + cosines) * (1.0 - 0.6 * g * g));
    const T deflected = let("deflected", weight * (similar_once - (1.0 - g) * scattered));
    const T backwards = let("backwards", min(g, 0.0));
    const T shape = let("shape", 0.5 + 0.5 * call<HenyeyGreenstein>(T(backwards * backwards), cos_light_view));
    return max(once + deflected + more * shape, 0.0) / (4.0 * pi * cosines);
  }
};

/// The BRDF, 1/sr without cosine, of all orders of scattering in a slab of optical depth τ over nothing: no interfaces,
/// nothing comes back from below. For albedos in [0, 1], τ from 0 to infinity, g, the mean cosine of deflection, in
/// [-0.9, 0.9]. Reciprocal.
template <class T, class G>
LOBEFIT_TEXT Vec3<T> thin_scattering(const Vec3<T>& single_scattering_albedo, const Vec3<T>& optical_depth, const T& g,
                                     const Geometry<G>& geometry) {
  const T cos_theta_i = T(geometry.cos_theta_i), cos_theta_o = T(geometry.cos_theta_o);
  const T cos_light_view = T(geometry.cos_light_view);
  return {
      call<ThinScattering>(single_scattering_albedo.x, optical_depth.x, g, cos_theta_i, cos_theta_o, cos_light_view),
      call<ThinScattering>(single_scattering_albedo.y, optical_depth.y, g, cos_theta_i, cos_theta_o, cos_light_view),
      call<ThinScattering>(single_scattering_albedo.z, optical_depth.z, g, cos_theta_i, cos_theta_o, cos_light_view)};
}

}  // namespace lobefit
