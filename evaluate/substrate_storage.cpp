#include "evaluate/substrate_storage.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "evaluate/bit_stream.h"
#include "evaluate/storage_code.h"
#include "models/model.h"
#include "models/parameter.h"

namespace lobefit {

namespace {

constexpr double inverse_golden_ratio = 0.61803398874989484820;

double fraction(double x) { return x - std::floor(x); }

/// Visits the member that holds a field, if any: a double, two or three doubles as pointers, or an integer.
template <class Closure, class Visit>
void visit_member(Closure& closure, std::string_view name, Visit&& visit) {
  Slab::describe(closure.slab, [&](auto& member, const ParameterInfo& info) {
    if (info.name != name) return;
    if constexpr (is_vector<std::remove_cvref_t<decltype(member)>>) {
      visit(member.x, member.y, member.z);
    } else {
      visit(member);
    }
  });
  if (name == "throughput") visit(closure.throughput.x, closure.throughput.y, closure.throughput.z);
  if (name == "transmittance_above")
    visit(closure.transmittance_above.x, closure.transmittance_above.y, closure.transmittance_above.z);
  if (name == "coverage_above") visit(closure.coverage_above);
  if (name == "specular_profile") visit(closure.specular_profile);
  if (name == "glint_position") visit(closure.glints.u, closure.glints.v);
  if (name == "glint_footprint") visit(closure.glints.major, closure.glints.minor);
  if (name == "glint_angle") visit(closure.glints.angle);
}

bool holds_numbers(const StorageField& field) {
  return field.part == StoragePart::closure_data || field.part == StoragePart::medium;
}

/// Default parameters, with what counts as 0 where the features leave it out.
Slab::Parameters<double> neutral_slab() {
  std::vector<double> flat;
  for (const ParameterInfo& info : describe_parameters<Slab>())
    flat.insert(flat.end(), static_cast<std::size_t>(info.components), info.initial);
  Slab::Parameters<double> slab = unflatten<Slab, double, double>(flat);
  slab.diffuse_albedo = {};
  return slab;
}

// ---- directions -----------------------------------------------------------------------------------------------------

/// The part of `tangent` across the normal; (0, 0, 0) if there is none.
Direction across(const Direction& normal, const Direction& tangent) {
  const Direction part = tangent - normal * dot(normal, tangent);
  return dot(part, part) > 1e-12 ? normalize(part) : Direction{};
}

bool is_zero(const Direction& d) { return d.x == 0.0 && d.y == 0.0 && d.z == 0.0; }

/// Of a normal alone: along x where that is possible.
TangentBasis basis_of(const Direction& normal) {
  const Direction along_x = across(normal, {1.0, 0.0, 0.0});
  return {normal, is_zero(along_x) ? Direction{0.0, 1.0, 0.0} : along_x};
}

bool same(const Direction& a, const Direction& b) { return a.x == b.x && a.y == b.y && a.z == b.z; }

// ---- packing ----------------------------------------------------------------------------------------------------

std::uint32_t feature_bits(const ClosureFeatures& features) {
  std::uint32_t bits = 0;
  for (std::size_t k = 0; k < closure_feature_flags.size(); ++k)
    bits |= static_cast<std::uint32_t>(features.*closure_feature_flags[k]) << k;
  return bits;
}

ClosureFeatures features_from_bits(std::uint32_t bits) {
  ClosureFeatures features;
  for (std::size_t k = 0; k < closure_feature_flags.size(); ++k)
    features.*closure_feature_flags[k] = ((bits >> k) & 1u) != 0;
  return features;
}

void require_numbers(std::span<const StoredClosure> closures) {
  for (std::size_t k = 0; k < closures.size(); ++k) {
    const auto require = [&](std::string_view name, const auto&... numbers) {
      if ((std::isfinite(numbers) && ...)) return;
      throw Error(ExitCode::invalid_input, "not a finite number", fmt::format("closure {}, {}", k, name),
                  "give numbers within the slab's ranges");
    };
    const Slab::Parameters<double>& slab = closures[k].slab;
    require("emissive", slab.emissive.x, slab.emissive.y, slab.emissive.z);
    require("diffuse_model", slab.diffuse_model);
    for (const StorageField& field : storage_fields) {
      for (const double number : stored_numbers(closures[k], field)) require(field.name, number);
    }
    const auto& [normal, tangent] = closures[k].basis;
    require("tangent basis", normal.x, normal.y, normal.z, tangent.x, tangent.y, tangent.z);
    if (dot(normal, normal) < 1e-12 || (closures[k].slab.anisotropy != 0.0 && is_zero(across(normal, tangent)))) {
      throw Error(ExitCode::invalid_input, "normal and tangent span no surface", fmt::format("closure {}", k),
                  "give unit vectors at right angles");
    }
  }
}

class Packer {
 public:
  Packer(std::span<const StoredClosure> closures, const Dithering& dithering)
      : closures_(closures), features_(storage_features(closures)), dithering_(dithering) {}

  PackedMaterial run() {
    PackedMaterial packed{.storage = material_storage(features_)};
    storage_ = &packed.storage;
    losses_ = &packed.losses;
    int stored_basis = 0;
    int previous_closure = -1;
    for (const auto& [field, closure] : packed.storage.fields) {
      // Closures end at a word, and so does all that follows.
      if (closure < 0 && previous_closure >= 0) bits_.pad_to_word();
      previous_closure = closure;
      if (field->part == StoragePart::top_layer || field->part == StoragePart::normal ||
          field->part == StoragePart::tangent_basis) {
        write_surface(*field, stored_basis);
        // A basis is a normal and, if it has one, a tangent.
        const bool last = field->part == StoragePart::normal || field->name == "tangent";
        if (last) ++stored_basis;
      } else if (holds_numbers(*field)) {
        write_numbers(*field, static_cast<std::size_t>(closure));
      } else {
        bits_.write(header(*field, closure), field->bits[0]);
      }
    }
    for (std::size_t k = 0; k < closures_.size(); ++k) {
      const Rgb& emissive = closures_[k].slab.emissive;
      if (emissive.x != 0.0 || emissive.y != 0.0 || emissive.z != 0.0)
        packed.losses.push_back({k, "emissive", "not stored: it is added to the picture at once"});
    }
    packed.words = std::move(bits_).words();
    return packed;
  }

 private:
  std::uint32_t header(const StorageField& field, int closure) const {
    const auto number = [](std::size_t n) { return static_cast<std::uint32_t>(n); };
    if (closure < 0) {
      if (field.name == "layout") return static_cast<std::uint32_t>(storage_->layout);
      if (field.name == "closures") return number(closures_.size() - 1);
      if (field.name == "bases") return number(storage_->has_tangent.size());
      if (field.name == "diffuse_model") return storage_->layout == StorageLayout::simple ? diffuse_model(0) : 0;
      return 0;
    }
    const auto k = static_cast<std::size_t>(closure);
    if (field.name == "features") return feature_bits(features_[k]);
    if (field.name == "diffuse_model") return diffuse_model(k);
    return static_cast<std::uint32_t>(storage_->basis_of_closure[k]);
  }

  std::uint32_t diffuse_model(std::size_t closure) const {
    return static_cast<std::uint32_t>(choice_number(closures_[closure].slab.diffuse_model, Slab::variant_count));
  }

  /// The closure whose normal and tangent a stored basis has: one that needs the tangent, if any does.
  const StoredClosure& representative(int stored_basis) const {
    const StoredClosure* found = nullptr;
    for (std::size_t k = 0; k < closures_.size(); ++k) {
      if (storage_->basis_of_closure[k] == stored_basis + 1 && (!found || features_[k].anisotropy))
        found = &closures_[k];
    }
    return *found;
  }

  void write_surface(const StorageField& field, int stored_basis) {
    const bool top = field.part == StoragePart::top_layer;
    const StoredClosure& closure = top ? closures_[0] : representative(stored_basis);
    if (field.name == "roughness") {
      write_number(field, 0, closure.slab.roughness);
      return;
    }
    const Direction normal = normalize(closure.basis.normal);
    const auto codes = direction_codes(field, field.name == "normal" ? normal : across(normal, closure.basis.tangent));
    for (std::size_t c = 0; c < 2; ++c) bits_.write(codes[c], field.bits[c]);
  }

  void write_numbers(const StorageField& field, std::size_t closure) {
    std::vector<double> numbers = stored_numbers(closures_[closure], field);
    for (double& number : numbers) {
      const double given = number;
      if (field.name == "glint_position") {
        number = fraction(number);
      } else if (field.encoding != StorageEncoding::ratio || number != 0.0) {
        number = std::clamp(number, field.lower, field.upper);
      }
      if (number != given) {
        const std::string_view became = field.name == "glint_position" ? "repeats as" : "is cut to";
        losses_->push_back({closure, std::string(field.name), fmt::format("{:.6g} {} {:.6g}", given, became, number)});
      }
    }
    for (std::size_t c = 0; c < numbers.size(); ++c) write_number(field, static_cast<int>(c), numbers[c]);
  }

  void write_number(const StorageField& field, int component, double number) {
    const StorageCode code(field, component);
    // One threshold for all would make all fields of a pixel err to the same side.
    const double threshold =
        dithering_.threshold ? fraction(*dithering_.threshold + inverse_golden_ratio * dithered_++) : 0.5;
    bits_.write(code.code(number, threshold), code.bits());
  }

  std::span<const StoredClosure> closures_;
  std::vector<ClosureFeatures> features_;
  Dithering dithering_;
  const MaterialStorage* storage_ = nullptr;
  std::vector<StorageLoss>* losses_ = nullptr;
  BitWriter bits_;
  int dithered_ = 0;
};

// ---- unpacking --------------------------------------------------------------------------------------------------

class Unpacker {
 public:
  explicit Unpacker(std::span<const std::uint32_t> words) : words_(words), bits_(words) {}

  UnpackedMaterial run() {
    read_headers_and_data();
    bits_.skip_padding();
    // Now all is known that the layout follows from.
    material_.storage = material_storage(features_);
    const MaterialStorage& storage = material_.storage;
    if (storage.layout != layout_) malformed_stream("the layout is not the closures'");
    if (storage.basis_of_closure != references_ || storage.has_tangent.size() != bases_)
      malformed_stream("the closures' tangent bases are not those that are stored");
    if (words_.size() != static_cast<std::size_t>(storage.words + storage.medium_words)) {
      malformed_stream(
          fmt::format("{} words where the material has {}", words_.size(), storage.words + storage.medium_words));
    }
    read_surfaces();
    for (std::size_t k = 0; k < material_.closures.size(); ++k) {
      for (const StorageField& field : storage_fields) {
        if (field.part == StoragePart::medium && is_stored(field, features_[k], layout_)) read_numbers(field, k);
      }
    }
    return std::move(material_);
  }

 private:
  std::uint32_t read_index(const StorageField& field) {
    const std::uint32_t code = bits_.read(field.bits[0]);
    if (code > field.upper) malformed_stream(fmt::format("{} is {}", field.name, code));
    return code;
  }

  void read_headers_and_data() {
    std::uint32_t simple_diffuse_model = 0;
    std::size_t count = 0;
    for (const StorageField& field : storage_fields) {
      if (field.part != StoragePart::material_header) continue;
      const std::uint32_t code = read_index(field);
      if (field.name == "layout") layout_ = static_cast<StorageLayout>(code);
      if (field.name == "closures") count = code + 1;
      if (field.name == "bases") bases_ = code;
      if (field.name == "diffuse_model") simple_diffuse_model = code;
    }
    if (layout_ != StorageLayout::simple && simple_diffuse_model != 0)
      malformed_stream("a header is not 0 where it must be");
    for (std::size_t k = 0; k < count; ++k) {
      StoredClosure& closure = material_.closures.emplace_back(StoredClosure{.slab = neutral_slab()});
      ClosureFeatures& features = features_.emplace_back();
      references_.push_back(0);
      closure.slab.diffuse_model = simple_diffuse_model;
      for (const StorageField& field : storage_fields) {
        if (!is_stored(field, features, layout_)) continue;
        if (field.part == StoragePart::closure_header) {
          const std::uint32_t code = read_index(field);
          if (field.name == "features") features = features_from_bits(code);
          if (field.name == "diffuse_model") closure.slab.diffuse_model = code;
          if (field.name == "tangent_basis") references_.back() = static_cast<int>(code);
        } else if (field.part == StoragePart::closure_data) {
          read_numbers(field, k);
        }
      }
      if (layout_ == StorageLayout::simple) features.diffuse = true;
    }
    // The TopLayer's normal is the first closure's, under the number of its whole basis if it has one.
    for (std::size_t k = 0; k < count; ++k)
      features_[k].tangent_basis = references_[k] ? references_[k] : references_[0];
  }

  void read_numbers(const StorageField& field, std::size_t closure) {
    std::vector<double> numbers;
    for (int c = 0; c < field.components(); ++c) {
      const StorageCode code(field, c);
      const std::uint32_t read = bits_.read(code.bits());
      if (read > code.last()) malformed_stream(fmt::format("{} has no code {}", field.name, read));
      numbers.push_back(code.value(read));
    }
    set_stored_numbers(material_.closures[closure], field, numbers);
  }

  Direction read_direction(const StorageField& field) {
    std::array<std::uint32_t, 2> codes{};
    for (std::size_t c = 0; c < 2; ++c) {
      codes[c] = bits_.read(field.bits[c]);
      if (codes[c] > StorageCode(field, static_cast<int>(c)).last())
        malformed_stream("a direction's code is out of range");
    }
    return decoded_direction(field, codes);
  }

  void read_surfaces() {
    std::vector<TangentBasis> stored;
    for (const auto& [field, closure] : material_.storage.fields) {
      if (field->part == StoragePart::normal) {
        stored.push_back(basis_of(read_direction(*field)));
      } else if (field->part == StoragePart::tangent_basis && field->name == "normal") {
        stored.push_back({.normal = read_direction(*field)});
      } else if (field->part == StoragePart::tangent_basis) {
        stored.back().tangent = across(stored.back().normal, read_direction(*field));
        if (is_zero(stored.back().tangent)) malformed_stream("a tangent lies along its normal");
      } else if (field->part == StoragePart::top_layer && field->name == "normal") {
        material_.top_normal = read_direction(*field);
      } else if (field->part == StoragePart::top_layer) {
        material_.top_roughness = StorageCode(*field, 0).value(bits_.read(field->bits[0]));
      }
    }
    for (std::size_t k = 0; k < references_.size(); ++k) {
      material_.closures[k].basis =
          references_[k] ? stored[static_cast<std::size_t>(references_[k] - 1)] : basis_of(material_.top_normal);
    }
  }

  std::span<const std::uint32_t> words_;
  BitReader bits_;
  UnpackedMaterial material_{};
  StorageLayout layout_ = StorageLayout::simple;
  std::size_t bases_ = 0;
  std::vector<ClosureFeatures> features_;
  std::vector<int> references_;
};

}  // namespace

// ---- materials --------------------------------------------------------------------------------------------------

Dithering Dithering::at(int x, int y) { return {fraction(52.9829189 * fraction(0.06711056 * x + 0.00583715 * y))}; }

std::vector<double> stored_numbers(const StoredClosure& closure, const StorageField& field) {
  std::vector<double> numbers;
  if (holds_numbers(field)) {
    visit_member(closure, field.name,
                 [&](const auto&... members) { numbers.assign({static_cast<double>(members)...}); });
  }
  return numbers;
}

void set_stored_numbers(StoredClosure& closure, const StorageField& field, std::span<const double> numbers) {
  if (!holds_numbers(field)) return;
  visit_member(closure, field.name, [&](auto&... members) {
    std::size_t k = 0;
    ((members = static_cast<std::remove_cvref_t<decltype(members)>>(numbers[k++])), ...);
  });
}

std::vector<StoredClosure> stored_closures(const std::vector<Closure>& closures, double cos_theta_o) {
  std::vector<StoredClosure> result;
  std::vector<const SpecularProfile*> profiles;
  const auto profile_number = [&](const SpecularProfile* profile) {
    if (!profile) return std::uint32_t{0};
    auto found = std::find(profiles.begin(), profiles.end(), profile);
    if (found == profiles.end()) found = profiles.insert(profiles.end(), profile);
    return static_cast<std::uint32_t>(found - profiles.begin()) + 1;
  };
  for (const Closure& closure : closures) {
    StoredClosure stored;
    stored.specular_profile = profile_number(closure.profile.get());
    stored.slab = closure.slab;
    // What a layer takes from light is stored with those below it; a clear one needs no medium of its own.
    if (largest_channel(closure.slab.diffuse_albedo) <= 0.0) stored.slab.mean_free_path = {0.0, 0.0, 0.0};
    stored.throughput = closure.view_throughput(cos_theta_o);
    stored.transmittance_above = closure.light_above.transmittance;
    stored.coverage_above = closure.light_above.coverage;
    result.push_back(stored);
  }
  return result;
}

std::vector<ClosureFeatures> storage_features(std::span<const StoredClosure> closures) {
  const auto differs = [](const Rgb& c) { return c.x != 1.0 || c.y != 1.0 || c.z != 1.0; };
  std::vector<ClosureFeatures> features;
  for (const StoredClosure& closure : closures) {
    ClosureFeatures& own = features.emplace_back(features_of(closure.slab));
    own.specular_profile = closure.specular_profile != 0;
    own.throughput = differs(closure.throughput);
    own.below = closure.coverage_above != 0.0 && differs(closure.transmittance_above);
    own.tangent_basis = -1;
  }
  // Whole bases first: an isotropic closure can do with any of its normal.
  std::vector<TangentBasis> bases;
  for (const bool anisotropic : {true, false}) {
    for (std::size_t k = 0; k < closures.size(); ++k) {
      if (features[k].anisotropy != anisotropic) continue;
      const TangentBasis& own = closures[k].basis;
      const auto found = std::ranges::find_if(bases, [&](const TangentBasis& basis) {
        return same(basis.normal, own.normal) && (!anisotropic || same(basis.tangent, own.tangent));
      });
      features[k].tangent_basis = static_cast<int>(found - bases.begin());
      if (found == bases.end()) bases.push_back(own);
    }
  }
  return features;
}

PackedMaterial pack_material(std::span<const StoredClosure> closures, const Dithering& dithering) {
  require_numbers(closures);
  return Packer(closures, dithering).run();
}

UnpackedMaterial unpack_material(std::span<const std::uint32_t> words) { return Unpacker(words).run(); }

std::vector<std::string> not_stored() {
  return {"emissive light: the base pass adds it to the picture at once",
          "the pixel's own coverage: blending with what is behind happens when the picture is made",
          "tangents of isotropic closures, phase and thickness of opaque ones, f90 that is grey or without f0: they "
          "have no effect",
          "the table of a specular profile: its number alone is stored", "whole turns of glint texture coordinates"};
}

}  // namespace lobefit
