// Closures of a Substrate material as one pixel stores them: pack and unpack by models/substrate/storage.h's table.
//
//   const PackedMaterial packed = pack_material(closures, Dithering::at(x, y));
//   packed.words    the stream
//   packed.losses   what it does not hold, in words
//   const UnpackedMaterial read = unpack_material(packed.words);
//
// Numbers lie between two codes. Dithering takes the upper one in as many pixels as makes the mean over thresholds the
// number itself, in the parameter's own terms whatever the code; without it the nearer of the two is taken. Directions
// and numbers of things are never dithered.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "models/substrate/walk.h"

namespace lobefit {

/// Unit vectors in a frame that all closures of a material share. alpha_x lies along the tangent; an isotropic closure
/// has no use for it.
struct TangentBasis {
  Direction normal{0.0, 0.0, 1.0}, tangent{1.0, 0.0, 0.0};
};

/// Where a pixel lies on the texture that carries glints: its middle, and its footprint's axes and direction.
struct GlintFootprint {
  double u = 0.0, v = 0.0, major = 0.0, minor = 0.0, angle = 0.0;
};

/// A slab's share of the reflected light: throughput × slab × ((1 - C) + C T^(1/cos_theta_i)).
struct StoredClosure {
  Slab::Parameters<double> slab{};
  Rgb throughput{1.0, 1.0, 1.0};           // towards the viewer, and the slab's own weight
  Rgb transmittance_above{1.0, 1.0, 1.0};  // T, face-on, of what lies above
  double coverage_above = 0.0;             // C
  TangentBasis basis;
  std::uint32_t specular_profile = 0;  // 0: none
  GlintFootprint glints;
};

/// A walk's closures as a pixel stores them for a view of this cosine: stored_features() of simplify.h by themselves.
std::vector<StoredClosure> stored_closures(const std::vector<Closure>& closures, double cos_theta_o);

/// Closures top to bottom; equal normals and tangents get the same tangent basis.
std::vector<ClosureFeatures> storage_features(std::span<const StoredClosure> closures);

struct Dithering {
  /// In [0, 1); none: to the nearest.
  std::optional<double> threshold;

  /// Interleaved gradient noise (Jimenez 2014, Next Generation Post Processing in Call of Duty: Advanced Warfare).
  static Dithering at(int x, int y);
};

/// What a stream does not say of a closure.
struct StorageLoss {
  std::size_t closure;
  std::string parameter;
  std::string words;
};

struct PackedMaterial {
  std::vector<std::uint32_t> words;  // the material's, then the medium's
  MaterialStorage storage;
  std::vector<StorageLoss> losses;  // beside quantisation
};

/// Throws Error(invalid_input) for a number that is not finite, a basis without directions, or another number of
/// closures than 1 to most_closures.
PackedMaterial pack_material(std::span<const StoredClosure> closures, const Dithering& dithering = {});

struct UnpackedMaterial {
  std::vector<StoredClosure> closures;  // what is not stored has the slab's default
  MaterialStorage storage;
  /// Of the TopLayer alone.
  Direction top_normal;
  double top_roughness;
};

/// Throws Error(invalid_input) for a stream that pack_material() cannot have made.
UnpackedMaterial unpack_material(std::span<const std::uint32_t> words);

/// What no stream holds, a sentence each.
std::vector<std::string> not_stored();

/// A field of the stream in a closure: 1 to 3 numbers, none for headers and directions.
std::vector<double> stored_numbers(const StoredClosure& closure, const StorageField& field);
void set_stored_numbers(StoredClosure& closure, const StorageField& field, std::span<const double> numbers);

}  // namespace lobefit
