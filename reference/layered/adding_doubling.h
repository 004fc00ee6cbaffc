// A second, deterministic solver for layers, to hold the Monte Carlo one to: adding-doubling (van de Hulst 1980,
// Multiple Light Scattering; de Haan, Bosma, Hovenier 1987, The adding method for multiple scattering calculations of
// polarized light; Prahl 1995 for Fresnel interfaces). It shares Fresnel's equations with the other solver, and nothing
// else.
//
// A stream is its invariant of refraction q = n² sin²θ, the same in all media, so that a smooth interface joins equal
// streams and is diagonal. Radiances are divided by n² and integrated over n² μ dμ = -dq/2, in which all media share
// one quadrature: Gauss-Legendre between every two neighbouring n², where total reflection begins, in the cosine
// √(1 - q/n²) of the upper end, in which everything is smooth. Azimuths are Fourier series. The directions asked for
// are streams of (nearly) no weight.
//
// Mirror images lie on the diagonal, which no pair of directions asked for touches: f has no delta components.
#pragma once

#include <span>
#include <vector>

#include "reference/layered/layer_stack.h"

namespace lobefit {

struct AddingDoublingOptions {
  int streams = 16;  // between two neighbouring indices of refraction
  int modes = 24;    // of the azimuthal series, mode 0 included; media of g = 0 and smooth interfaces need one
};

/// Reflection of a stack for all pairs of some polar angles.
class AddingDoubling {
 public:
  /// Throws Error(usage) for interfaces with all bounces and rough diffuse bottoms: neither has a closed kernel.
  AddingDoubling(const LayerStack& stack, std::span<const double> cosines_i, std::span<const double> cosines_o,
                 const AddingDoublingOptions& options = {});

  /// f in 1/sr at an azimuth difference of phi (0: retro side).
  Rgb value(std::size_t i, std::size_t o, double phi) const;
  /// Mean of f over the azimuth.
  Rgb azimuthal_mean(std::size_t i, std::size_t o) const { return entry(0, i, o); }
  /// ∫ f cos θ_i dω_i: the directional albedo without mirror images.
  Rgb albedo(std::size_t o) const { return albedo_[o]; }

 private:
  void add_event(const LayerEvent& event, int channel, std::span<const double> cosines_i,
                 std::span<const double> cosines_o, const AddingDoublingOptions& options);
  Rgb entry(std::size_t mode, std::size_t i, std::size_t o) const { return modes_[mode][i * albedo_.size() + o]; }

  std::vector<std::vector<Rgb>> modes_;  // [mode][i, o]
  std::vector<Rgb> albedo_;              // [o]
};

}  // namespace lobefit
