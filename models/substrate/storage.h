// Where the bytes of a stored Substrate material go: which field has how many bits, and what that adds up to.
//
//   std::array closures{features_of(coat), features_of(base)};     // top to bottom
//   closures[1].throughput = closures[1].below = true;             // the coat dims the base
//   material_bytes(closures)                                       // 28
//   material_storage(closures).fields                              // every field, in the order of the stream
//
// A material is a stream of bits, least significant first:
//
//   material header | closures, top to bottom, of header and data | to a whole word | tangent bases | TopLayer |
//   medium data
//
// Its bytes are the sum of the widths in storage_fields, rounded up to words once; nothing is looked up. The feature
// sets of S2's memory table come to 12 / 16 / 20 / 24 / 28 / 40 / 44 / 60. What S2 states of widths is kept: headers of
// 2 bytes, F0 and diffuse albedo of 7/7/6 bits, fuzz amount of 6, a tangent basis of two octahedral vectors in 32,
// TopLayer of 4 bytes, 8 bytes of extra subsurface data beside the table. The other widths are ours.
// docs/substrate_storage.md holds S2's other accounts against this one.
//
// Source: de Rousiers, Hillaire 2023, Unreal Engine Substrate: Authoring Materials that Matter (S2), Storage.
#pragma once

#include <array>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "models/error.h"
#include "models/substrate/slab.h"

namespace lobefit {

inline constexpr int most_closures = 8;

/// What one closure of a material makes use of. A field that no feature asks for is not stored, and reads back as the
/// neutral value.
struct ClosureFeatures {
  bool diffuse = false;           // albedo above 0
  bool f90 = false;               // a colour: grey is 1
  bool second_lobe = false;       // of another roughness and a weight above 0
  bool fuzz = false;              // amount above 0
  bool anisotropy = false;        // not 0: takes a whole tangent basis
  bool medium = false;            // a mean free path above 0: thickness and phase matter
  bool specular_profile = false;  // the number of a table over view and light
  bool glints = false;            // a finite density
  bool throughput = false;        // a weight towards the viewer that is not 1
  bool below = false;             // something lies above that dims the light
  /// Any number; closures that are given the same one share a tangent basis.
  int tangent_basis = 0;

  bool operator==(const ClosureFeatures&) const = default;
};

/// The flags, from the lowest bit of a closure header's `features`.
inline constexpr std::array closure_feature_flags{&ClosureFeatures::diffuse,          &ClosureFeatures::f90,
                                                  &ClosureFeatures::second_lobe,      &ClosureFeatures::fuzz,
                                                  &ClosureFeatures::medium,           &ClosureFeatures::anisotropy,
                                                  &ClosureFeatures::throughput,       &ClosureFeatures::below,
                                                  &ClosureFeatures::specular_profile, &ClosureFeatures::glints};

/// simple: one closure of diffuse albedo, F0 and roughness, without a header of its own. single: one isotropic closure.
/// complex: anisotropy, or several closures. special: glints or a specular profile.
enum class StorageLayout { simple, single, complex, special };
inline constexpr std::array<std::string_view, 4> storage_layout_names{"simple", "single", "complex", "special"};

enum class StoragePart {
  material_header,
  closure_header,
  closure_data,
  tangent_basis,  // of an anisotropic closure
  normal,         // of isotropic closures whose normal is not the TopLayer's
  top_layer,      // what reflections, occlusion and the like read without reading the material
  medium          // S2's two slices of subsurface data, which its memory table leaves out
};
inline constexpr std::array<std::string_view, 7> storage_part_names{
    "material_header", "closure_header", "closure_data", "tangent_basis", "normal", "top_layer", "medium"};

/// What a code of b bits stands for.
enum class StorageEncoding {
  index,    // itself
  linear,   // even steps from lower to upper
  centred,  // even steps over 2^b - 1 codes, so that the middle is one; the last code is none
  square,   // upper (code/(2^b - 1))²: fine where it is dark
  srgb,     // IEC 61966-2-1, of [0, 1]
  ratio     // code 0 is 0, the others go from lower to upper by equal ratios
};

inline constexpr std::array<std::string_view, 6> storage_encoding_names{"index",  "linear", "centred",
                                                                        "square", "srgb",   "ratio"};

/// A field of the stream: one code per component.
struct StorageField {
  std::string_view name;  // of the slab's parameter where it has one
  StoragePart part;
  std::array<int, 3> bits;  // of each component; 0: no such component
  StorageEncoding encoding;
  double lower, upper;
  bool ClosureFeatures::*feature;  // stored where it is in use; null: always
  std::string_view purpose;

  constexpr int components() const { return bits[1] == 0 ? 1 : bits[2] == 0 ? 2 : 3; }
  constexpr int bit_count() const { return bits[0] + bits[1] + bits[2]; }
};

namespace storage_detail {
using enum StoragePart;
using enum StorageEncoding;
using Features = ClosureFeatures;
inline constexpr std::array<int, 3> rgb{7, 7, 6};
consteval std::array<int, 3> one(int bits) { return {bits, 0, 0}; }
consteval std::array<int, 3> two(int bits) { return {bits, bits, 0}; }

/// The one statement of all widths, in the order of the stream. Lengths are in cm, angles in radians.
inline constexpr std::array<StorageField, 34> fields{{
    {"layout", material_header, one(2), index, 0, 3, nullptr, "sorts tiles: simple, single, complex, special"},
    {"closures", material_header, one(3), index, 0, 7, nullptr, "how many, less 1"},
    {"bases", material_header, one(4), index, 0, 8, nullptr, "how many are stored"},
    {"diffuse_model", material_header, one(2), index, 0, 2, nullptr, "of a simple closure; else 0"},
    {"reserved", material_header, one(5), index, 0, 0, nullptr, "0"},

    {"features", closure_header, one(10), index, 0, 1023, nullptr, "which of the fields below follow"},
    {"diffuse_model", closure_header, one(2), index, 0, 2, nullptr, "chan, eon or lambert"},
    {"tangent_basis", closure_header, one(4), index, 0, 8, nullptr, "0: TopLayer's normal; k: the kth stored basis"},

    {"diffuse_albedo", closure_data, rgb, srgb, 0, 1, &Features::diffuse, "of the body"},
    {"f0", closure_data, rgb, square, 0, 1, nullptr, "reflectance face-on"},
    {"roughness", closure_data, one(8), linear, 0, 1, nullptr, "of the first lobe and the body"},
    {"f90", closure_data, rgb, srgb, 0, 1, &Features::f90, "colour of grazing reflections"},
    {"second_roughness", closure_data, one(6), linear, 0, 1, &Features::second_lobe, "of haze"},
    {"second_roughness_weight", closure_data, one(6), linear, 0, 1, &Features::second_lobe, "its share"},
    {"fuzz_amount", closure_data, one(6), linear, 0, 1, &Features::fuzz, "share that fibres cover"},
    {"fuzz_color", closure_data, rgb, srgb, 0, 1, &Features::fuzz, "of the fibres"},
    {"fuzz_roughness", closure_data, one(6), linear, 0.01, 1, &Features::fuzz, "of the fibres"},
    {"phase_anisotropy", closure_data, one(8), centred, -0.9, 0.9, &Features::medium, "which way a medium scatters"},
    {"anisotropy", closure_data, one(8), centred, -0.9, 0.9, &Features::anisotropy, "of both lobes"},
    {"throughput", closure_data, rgb, square, 0, 1, &Features::throughput, "what reaches the viewer"},
    {"transmittance_above", closure_data, rgb, square, 0, 1, &Features::below, "face-on, of what lies above"},
    {"coverage_above", closure_data, one(8), linear, 0, 1, &Features::below, "how much of it lies there"},
    {"specular_profile", closure_data, one(32), index, 0, 4294967295.0, &Features::specular_profile,
     "number of a table over view and light"},
    {"glint_density", closure_data, one(32), ratio, 1e-3, 1e9, &Features::glints, "facets per unit of texture area"},
    {"glint_position", closure_data, two(24), linear, 0, 1, &Features::glints, "texture coordinates, repeating"},
    {"glint_footprint", closure_data, two(16), ratio, 1e-9, 1e3, &Features::glints, "axes of the pixel on the texture"},
    {"glint_angle", closure_data, one(16), linear, 0, pi, &Features::glints, "of the longer of them"},

    {"normal", tangent_basis, two(9), centred, -1, 1, nullptr, "octahedral"},
    {"tangent", tangent_basis, two(7), centred, -1, 1, nullptr, "octahedral, of the direction of alpha_x"},
    {"normal", normal, two(16), centred, -1, 1, nullptr, "octahedral"},
    {"normal", top_layer, two(12), centred, -1, 1, nullptr, "octahedral, of the first closure"},
    {"roughness", top_layer, one(8), linear, 0, 1, nullptr, "of the first closure, again"},

    {"mean_free_path", medium, {16, 16, 16}, ratio, 1e-5, 1e3, &Features::medium, "per channel; 0 is opaque"},
    {"thickness", medium, one(16), ratio, 1e-5, 1e3, &Features::medium, "of the medium"},
}};
}  // namespace storage_detail

inline constexpr std::span<const StorageField> storage_fields = storage_detail::fields;

/// One field as it is stored; of the material where closure is -1.
struct StoredField {
  const StorageField* field;
  int closure;
};

struct MaterialStorage {
  StorageLayout layout = StorageLayout::simple;
  /// For each closure 0, the TopLayer's normal, or k, the kth stored basis.
  std::vector<int> basis_of_closure;
  /// For each stored basis whether it has a tangent.
  std::vector<bool> has_tangent;
  std::vector<StoredField> fields;  // in the order of the stream
  int padding_bits = 0;             // between the closures and what follows
  int words = 0;                    // of 32 bits, TopLayer included, medium data left out: S2's memory table
  int medium_words = 0;             // beside it

  int bytes() const { return 4 * words; }
  int medium_bytes() const { return 4 * medium_words; }
};

namespace storage_detail {

inline StorageLayout layout_of(std::span<const ClosureFeatures> closures) {
  StorageLayout layout = StorageLayout::single;
  for (const ClosureFeatures& closure : closures) {
    if (closure.specular_profile || closure.glints) return StorageLayout::special;
    if (closure.anisotropy || closures.size() > 1) layout = StorageLayout::complex;
  }
  ClosureFeatures plain = closures[0];
  plain.diffuse = false;
  plain.tangent_basis = 0;
  return layout == StorageLayout::single && plain == ClosureFeatures{} ? StorageLayout::simple : layout;
}

/// Fills basis_of_closure and has_tangent.
inline void share_bases(std::span<const ClosureFeatures> closures, MaterialStorage& storage) {
  const auto anisotropic = [&](int basis) {
    for (const ClosureFeatures& closure : closures) {
      if (closure.anisotropy && closure.tangent_basis == basis) return true;
    }
    return false;
  };
  std::vector<int> stored;
  for (const ClosureFeatures& closure : closures) {
    int number = 0;
    // An isotropic closure needs no tangent, and the first one's normal lies in the TopLayer.
    if (closure.anisotropy || closure.tangent_basis != closures[0].tangent_basis) {
      while (number < static_cast<int>(stored.size()) &&
             stored[static_cast<std::size_t>(number)] != closure.tangent_basis)
        ++number;
      if (number == static_cast<int>(stored.size())) {
        stored.push_back(closure.tangent_basis);
        storage.has_tangent.push_back(anisotropic(closure.tangent_basis));
      }
      ++number;
    }
    storage.basis_of_closure.push_back(number);
  }
}

}  // namespace storage_detail

/// Whether a closure of a material stores a field. A simple closure has no header to say that it has no albedo.
constexpr bool is_stored(const StorageField& field, const ClosureFeatures& closure, StorageLayout layout) {
  switch (field.part) {
    case StoragePart::closure_header: return layout != StorageLayout::simple;
    case StoragePart::closure_data:
    case StoragePart::medium:
      return !field.feature || closure.*field.feature ||
             (layout == StorageLayout::simple && field.feature == &ClosureFeatures::diffuse);
    default: return true;
  }
}

/// From 1 to most_closures closures, top to bottom: the TopLayer is the first one's. Throws Error(invalid_input).
inline MaterialStorage material_storage(std::span<const ClosureFeatures> closures) {
  if (closures.empty() || closures.size() > most_closures) {
    throw Error(ExitCode::invalid_input, std::to_string(closures.size()) + " closures in a material", "storage",
                "store 1 to " + std::to_string(most_closures) + ", or simplify the tree first");
  }
  MaterialStorage storage{.layout = storage_detail::layout_of(closures)};
  storage_detail::share_bases(closures, storage);
  int bits = 0;
  const auto store = [&](StoragePart part, int closure) {
    for (const StorageField& field : storage_fields) {
      if (field.part != part) continue;
      if (closure >= 0 && !is_stored(field, closures[static_cast<std::size_t>(closure)], storage.layout)) continue;
      storage.fields.push_back({&field, closure});
      bits += field.bit_count();
    }
  };
  store(StoragePart::material_header, -1);
  const int count = static_cast<int>(closures.size());
  for (int closure = 0; closure < count; ++closure) {
    store(StoragePart::closure_header, closure);
    store(StoragePart::closure_data, closure);
  }
  storage.padding_bits = (32 - bits % 32) % 32;
  bits += storage.padding_bits;
  for (const bool tangent : storage.has_tangent) store(tangent ? StoragePart::tangent_basis : StoragePart::normal, -1);
  store(StoragePart::top_layer, -1);
  storage.words = bits / 32;
  for (int closure = 0; closure < count; ++closure) store(StoragePart::medium, closure);
  storage.medium_words = bits / 32 - storage.words;
  return storage;
}

/// Bytes per pixel as S2's memory table counts them: TopLayer included, medium data left out. Throws
/// Error(invalid_input) for another number of closures than 1 to most_closures.
inline int material_bytes(std::span<const ClosureFeatures> closures) { return material_storage(closures).bytes(); }

/// What a slab makes use of by itself: its weight, what lies above and its tangent basis are the material's affair.
inline ClosureFeatures features_of(const Slab::Parameters<double>& slab) {
  const auto any = [](const Rgb& c) { return c.x > 0.0 || c.y > 0.0 || c.z > 0.0; };
  const Rgb& f90 = slab.f90;
  return {.diffuse = any(slab.diffuse_albedo),
          .f90 = any(slab.f0) && (f90.x != f90.y || f90.x != f90.z || f90.x == 0.0),
          .second_lobe = slab.second_roughness_weight > 0.0 && slab.second_roughness != slab.roughness,
          .fuzz = slab.fuzz_amount > 0.0,
          .anisotropy = slab.anisotropy != 0.0,
          .medium = any(slab.mean_free_path),
          .glints = slab.glint_density > 0.0};
}

}  // namespace lobefit
