// The storage of Substrate materials: bytes against S2's memory table and a sum of its own, streams against what went
// in, quantisation against its closed forms.

#include "evaluate/substrate_storage.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <fstream>
#include <functional>
#include <ranges>
#include <set>
#include <sstream>

#include "evaluate/gbuffer_error.h"
#include "evaluate/storage_code.h"
#include "evaluate/substrate_storage_error.h"
#include "reference/srgb.h"
#include "tests/directions.h"

namespace lobefit {
namespace {

constexpr std::size_t flags = closure_feature_flags.size();

ClosureFeatures with_flags(std::size_t bits) {
  ClosureFeatures features;
  for (std::size_t k = 0; k < flags; ++k) features.*closure_feature_flags[k] = ((bits >> k) & 1u) != 0;
  return features;
}

int bytes(const std::vector<ClosureFeatures>& closures) { return material_bytes(closures); }

const StorageField& find_field(StoragePart part, std::string_view name) {
  return *std::ranges::find_if(storage_fields,
                               [&](const StorageField& field) { return field.part == part && field.name == name; });
}
const StorageField& data(std::string_view name) { return find_field(StoragePart::closure_data, name); }

bool is_data(const StorageField& field) {
  return field.part == StoragePart::closure_data || field.part == StoragePart::medium;
}

ExitCode code_of(const std::function<void()>& run) {
  try {
    run();
  } catch (const Error& error) {
    return error.code();
  }
  return ExitCode::done;
}

Direction random_direction(UniformNumbers& uniform) {
  const double z = uniform.between(-1.0, 1.0), phi = uniform.between(0.0, 2.0 * pi), r = std::sqrt(1.0 - z * z);
  return {r * std::cos(phi), r * std::sin(phi), z};
}

TangentBasis random_basis(UniformNumbers& uniform) {
  const Direction normal = random_direction(uniform);
  return {normal, normalize(cross(normal, random_direction(uniform)))};
}

/// A closure of exactly these features, its numbers inside their fields' ranges.
StoredClosure random_closure(const ClosureFeatures& features, const TangentBasis& basis, UniformNumbers& uniform) {
  StoredClosure closure;
  closure.slab.f90 = {1.0, 1.0, 1.0};
  closure.basis = basis;
  closure.slab.diffuse_model = std::floor(uniform.between(0.0, 3.0));
  for (const StorageField& field : storage_fields) {
    if (!is_data(field) || (field.feature && !(features.*field.feature))) continue;
    std::vector<double> numbers;
    for (int c = 0; c < field.components(); ++c) {
      const double u = uniform.between(0.01, 0.99);
      numbers.push_back(field.encoding == StorageEncoding::ratio ? field.lower * std::pow(field.upper / field.lower, u)
                        : field.encoding == StorageEncoding::index ? std::floor(1.0 + u * 4e9)
                                                                   : field.lower + u * (field.upper - field.lower));
    }
    set_stored_numbers(closure, field, numbers);
  }
  return closure;
}

// ---- bytes ------------------------------------------------------------------------------------------------------

TEST(SubstrateStorage, BytesAreThoseOfTheMemoryTable) {
  // S2, "Storage & Evaluation - Memory @1080p", each row with all that stands above it.
  ClosureFeatures base{.diffuse = true};
  EXPECT_EQ(bytes({base}), 12);
  EXPECT_EQ(material_storage(std::array{base}).layout, StorageLayout::simple);
  base.medium = true;  // of the legacy shading models the one that a slab has more for
  EXPECT_EQ(bytes({base}), 16);
  EXPECT_EQ(material_storage(std::array{base}).layout, StorageLayout::single);
  base.second_lobe = base.f90 = true;
  EXPECT_EQ(bytes({base}), 20);
  base.fuzz = true;
  EXPECT_EQ(bytes({base}), 24);
  EXPECT_EQ(material_storage(std::array{base}).layout, StorageLayout::single);
  base.anisotropy = true;
  EXPECT_EQ(bytes({base}), 28);
  EXPECT_EQ(material_storage(std::array{base}).layout, StorageLayout::complex);
  const ClosureFeatures coat{};
  base.throughput = base.below = true;
  EXPECT_EQ(bytes({coat, base}), 40);
  EXPECT_EQ(material_storage(std::array{coat, base}).layout, StorageLayout::complex);
  base.specular_profile = true;
  EXPECT_EQ(bytes({coat, base}), 44);
  EXPECT_EQ(material_storage(std::array{coat, base}).layout, StorageLayout::special);
  base.glints = true;
  EXPECT_EQ(bytes({coat, base}), 60);
  EXPECT_EQ(material_storage(std::array{coat, base}).layout, StorageLayout::special);
  // "2 SSS data" of four bytes each.
  EXPECT_EQ(material_storage(std::array{coat, base}).medium_bytes(), 8);
}

TEST(SubstrateStorage, WidthsThatTheSlidesStateAreKept) {
  const auto part = [](StoragePart which) {
    int bits = 0;
    for (const StorageField& field : storage_fields) bits += field.part == which ? field.bit_count() : 0;
    return bits;
  };
  EXPECT_EQ(part(StoragePart::material_header), 16);
  EXPECT_EQ(part(StoragePart::closure_header), 16);
  EXPECT_EQ(part(StoragePart::top_layer), 32);
  EXPECT_EQ(part(StoragePart::tangent_basis), 32);
  EXPECT_EQ(part(StoragePart::medium), 64);
  for (const char* name : {"f0", "diffuse_albedo"}) EXPECT_EQ(data(name).bits, (std::array{7, 7, 6})) << name;
  EXPECT_EQ(data("diffuse_albedo").encoding, StorageEncoding::srgb);
  EXPECT_EQ(data("fuzz_amount").bit_count(), 6);
  // "Closure Data: 6 bytes" of the simple layout.
  EXPECT_EQ(data("diffuse_albedo").bit_count() + data("f0").bit_count() + data("roughness").bit_count(), 48);
}

TEST(SubstrateStorage, OtherAccountsOfTheSlidesAreAsTheDocumentSays) {
  // docs/substrate_storage.md: V(A, H(B, C)) of plain slabs, its two collapses; opal; the compile dump; four
  // closures with LUT and glints; a payload.
  const ClosureFeatures top{.diffuse = true}, under{.diffuse = true, .throughput = true, .below = true};
  EXPECT_EQ(bytes({top, under, under}), 44);
  EXPECT_EQ(bytes({top, under}), 28);
  EXPECT_EQ(bytes({top}), 12);
  ClosureFeatures full{.diffuse = true, .f90 = true, .second_lobe = true, .fuzz = true, .medium = true};
  ClosureFeatures full_under = full;
  full_under.throughput = full_under.below = true;
  EXPECT_EQ(bytes({full, full_under, full_under}), 72);
  EXPECT_EQ(bytes({full, full_under}), 48);
  EXPECT_EQ(bytes({full}), 24);
  const ClosureFeatures coat{}, opal{.diffuse = true, .f90 = true, .medium = true, .throughput = true, .below = true};
  EXPECT_EQ(bytes({coat, opal, opal}), 48);
  EXPECT_EQ(material_storage(std::array{coat, opal, opal}).medium_bytes(), 16);
  const ClosureFeatures subsurface{.diffuse = true, .medium = true, .throughput = true};
  ClosureFeatures brushed{.diffuse = true, .anisotropy = true, .throughput = true, .tangent_basis = 1};
  EXPECT_EQ(bytes({subsurface, brushed}), 36);
  ClosureFeatures pearl = under, flakes = under;
  pearl.specular_profile = flakes.glints = true;
  EXPECT_EQ(bytes({coat, pearl, flakes, under}), 76);
  // Any single closure fits into a ray's 64 bytes, its medium included.
  const MaterialStorage largest = material_storage(std::array{with_flags((std::size_t{1} << flags) - 1)});
  EXPECT_EQ(largest.bytes(), 56);
  EXPECT_LE(largest.bytes() + largest.medium_bytes(), 64);
}

/// Bits of one closure's header and data, and bytes of a material, added up apart from the table.
int bits_of(const ClosureFeatures& f) {
  return 16 + 28 + 20 * f.diffuse + 20 * f.f90 + 12 * f.second_lobe + 32 * f.fuzz + 8 * f.medium + 8 * f.anisotropy +
         20 * f.throughput + 28 * f.below + 32 * f.specular_profile + 128 * f.glints;
}
int bytes_of(const std::vector<ClosureFeatures>& closures) {
  int bits = 16;
  bool more = closures.size() > 1;
  std::set<int> whole, normals;
  for (const ClosureFeatures& f : closures) {
    bits += bits_of(f);
    more = more || bits_of(f) > 44 + 20 * f.diffuse;
    if (f.anisotropy) whole.insert(f.tangent_basis);
  }
  for (const ClosureFeatures& f : closures) {
    if (!whole.contains(f.tangent_basis) && f.tangent_basis != closures[0].tangent_basis)
      normals.insert(f.tangent_basis);
  }
  if (!more) return 12;
  return 4 * ((bits + 31) / 32 + static_cast<int>(whole.size() + normals.size()) + 1);
}

TEST(SubstrateStorage, BytesAreTheSumOfTheWidths) {
  for (std::size_t bits = 0; bits < std::size_t{1} << flags; ++bits)
    EXPECT_EQ(bytes({with_flags(bits)}), bytes_of({with_flags(bits)})) << bits;
  UniformNumbers uniform(1);
  for (int repeat = 0; repeat < 2000; ++repeat) {
    std::vector<ClosureFeatures> closures;
    const auto count = static_cast<std::size_t>(uniform.between(1.0, most_closures + 1.0));
    for (std::size_t k = 0; k < count; ++k) {
      closures.push_back(with_flags(static_cast<std::size_t>(uniform.between(0.0, 1024.0))));
      closures.back().tangent_basis = static_cast<int>(uniform.between(0.0, 4.0));
    }
    EXPECT_EQ(bytes(closures), bytes_of(closures));
    const MaterialStorage storage = material_storage(closures);
    int sum = storage.padding_bits;
    for (const StoredField& each : storage.fields) sum += each.field->bit_count();
    EXPECT_EQ(sum, 32 * (storage.words + storage.medium_words));
    EXPECT_LT(storage.padding_bits, 32);
  }
}

TEST(SubstrateStorage, MoreFeaturesAndMoreClosuresNeverTakeLess) {
  for (std::size_t bits = 0; bits < std::size_t{1} << flags; ++bits) {
    for (std::size_t k = 0; k < flags; ++k) {
      for (const bool under : {false, true}) {
        std::vector<ClosureFeatures> fewer{with_flags(bits)}, more{with_flags(bits | (std::size_t{1} << k))};
        if (under) {
          // The other one has a normal of its own.
          for (auto* list : {&fewer, &more}) list->insert(list->begin(), ClosureFeatures{.tangent_basis = 1});
        }
        EXPECT_LE(bytes(fewer), bytes(more)) << bits << ' ' << k;
        EXPECT_LT(bytes({with_flags(bits)}), bytes({with_flags(bits), with_flags(bits)}));
      }
    }
  }
}

TEST(SubstrateStorage, OrderOfClosuresIsFreeWhereTheyShareABasis) {
  UniformNumbers uniform(2);
  for (int repeat = 0; repeat < 500; ++repeat) {
    std::vector<ClosureFeatures> closures;
    for (int k = 0; k < 5; ++k) closures.push_back(with_flags(static_cast<std::size_t>(uniform.between(0.0, 1024.0))));
    const int forwards = bytes(closures);
    std::ranges::reverse(closures);
    EXPECT_EQ(bytes(closures), forwards);
  }
}

TEST(SubstrateStorage, ABasisIsStoredOnce) {
  const ClosureFeatures brushed{.anisotropy = true}, plain{};
  const auto stored = [](const std::vector<ClosureFeatures>& closures) {
    return material_storage(closures).has_tangent;
  };
  ClosureFeatures other = brushed, tilted = plain;
  other.tangent_basis = tilted.tangent_basis = 1;
  EXPECT_EQ(stored({plain, plain, plain}), std::vector<bool>{});
  EXPECT_EQ(stored({brushed, brushed, plain}), std::vector<bool>{true});
  EXPECT_EQ(stored({plain, brushed, brushed}), std::vector<bool>{true});
  EXPECT_EQ(stored({brushed, other, brushed}), (std::vector<bool>{true, true}));
  EXPECT_EQ(stored({plain, tilted, tilted}), std::vector<bool>{false});
  EXPECT_EQ(stored({plain, tilted, other}), std::vector<bool>{true});
  EXPECT_EQ(material_storage(std::array{plain, tilted, other}).basis_of_closure, (std::vector{0, 1, 1}));
}

TEST(SubstrateStorage, AnIsotropicClosureTakesAnyBasisOfItsNormal) {
  const Direction tilted = direction(0.2, 1.0), across = normalize(cross(tilted, Direction{1.0, 0.0, 0.0}));
  StoredClosure top, plain, brushed, other;
  plain.basis = {tilted, {1.0, 0.0, 0.0}};
  brushed.basis = {tilted, across};
  other.basis = {tilted, cross(tilted, across)};
  brushed.slab.anisotropy = other.slab.anisotropy = 0.5;
  const auto stored = [](const std::vector<StoredClosure>& closures) {
    return material_storage(storage_features(closures)).has_tangent;
  };
  EXPECT_EQ(stored({top, plain, brushed}), std::vector<bool>{true});
  EXPECT_EQ(stored({top, brushed, plain}), std::vector<bool>{true});
  EXPECT_EQ(stored({plain, brushed, other, top}), (std::vector<bool>{true, true, false}));
  // What comes back is each one's own.
  const UnpackedMaterial read = unpack_material(pack_material(std::array{top, plain, brushed, other}).words);
  for (const std::size_t k : {1u, 2u, 3u}) EXPECT_GT(dot(read.closures[k].basis.normal, tilted), 0.9999);
  EXPECT_GT(dot(read.closures[2].basis.tangent, across), 0.999);
  EXPECT_GT(dot(read.closures[3].basis.tangent, other.basis.tangent), 0.999);
}

TEST(SubstrateStorage, OneToEightClosures) {
  for (std::size_t count = 0; count <= most_closures + 1; ++count) {
    const std::vector<ClosureFeatures> closures(count);
    const bool fits = count >= 1 && count <= most_closures;
    EXPECT_EQ(code_of([&] { material_bytes(closures); }), fits ? ExitCode::done : ExitCode::invalid_input) << count;
    const std::vector<StoredClosure> stored(count);
    EXPECT_EQ(code_of([&] { pack_material(stored); }), fits ? ExitCode::done : ExitCode::invalid_input) << count;
  }
}

TEST(SubstrateStorage, FeaturesAreWhatDiffersFromNeutral) {
  const ClosureFeatures none = features_of({.f90 = {1.0, 1.0, 1.0}, .roughness = 0.3, .second_roughness = 0.8});
  EXPECT_EQ(none, ClosureFeatures{});
  UniformNumbers uniform(3);
  for (std::size_t bits = 0; bits < std::size_t{1} << flags; ++bits) {
    const ClosureFeatures features = with_flags(bits);
    const std::array closures{random_closure(features, {}, uniform)};
    EXPECT_EQ(storage_features(closures)[0], features) << bits;
  }
  // A second lobe like the first, a colour at grazing angles of an interface that is none.
  EXPECT_FALSE(
      features_of({.f90 = {1.0, 1.0, 1.0}, .roughness = 0.3, .second_roughness = 0.3, .second_roughness_weight = 0.5})
          .second_lobe);
  EXPECT_FALSE(features_of({.f90 = {1.0, 0.5, 1.0}}).f90);
}

// ---- codes ------------------------------------------------------------------------------------------------------

TEST(SubstrateStorage, CodesAreTheStatedScales) {
  const StorageCode f0(data("f0"), 0), blue(data("f0"), 2), albedo(data("diffuse_albedo"), 1);
  EXPECT_EQ(f0.last(), 127u);
  EXPECT_EQ(blue.last(), 63u);
  EXPECT_NEAR(f0.value(25), 25.0 * 25.0 / (127.0 * 127.0), 1e-16);
  EXPECT_NEAR(albedo.value(64), srgb_decode(64.0 / 127.0), 1e-16);
  const StorageCode anisotropy(data("anisotropy"), 0);
  EXPECT_EQ(anisotropy.value(127), 0.0);
  EXPECT_EQ(anisotropy.last(), 254u);
  EXPECT_NEAR(anisotropy.value(254), 0.9, 1e-15);
  const StorageCode length(find_field(StoragePart::medium, "mean_free_path"), 0);
  EXPECT_EQ(length.value(0), 0.0);
  EXPECT_NEAR(length.value(1), 1e-5, 1e-20);
  EXPECT_NEAR(length.value(65535), 1e3, 1e-9);
  EXPECT_NEAR(length.value(32768), 0.1, 1e-12);  // the geometric mean
  EXPECT_EQ(length.code(1e-7), 1u);
  EXPECT_EQ(length.code(1e-7, 0.999), 1u);
  EXPECT_EQ(length.code(0.0, 0.0), 0u);
}

TEST(SubstrateStorage, EveryCodeComesBackAndCodesAscend) {
  for (const StorageField& field : storage_fields) {
    for (int c = 0; c < field.components(); ++c) {
      const StorageCode code(field, c);
      // All codes of narrow fields, some of the others.
      const std::uint32_t stride = std::max(code.last() / 5000u, 1u);
      for (std::uint64_t k = 0; k <= code.last(); k += stride) {
        const auto each = static_cast<std::uint32_t>(k);
        for (const double threshold : {0.0, 0.5, 0.999})
          ASSERT_EQ(code.code(code.value(each), threshold), each) << field.name << ' ' << threshold;
        if (each < code.last()) {
          ASSERT_LT(code.value(each), code.value(each + 1)) << field.name;
        }
      }
    }
  }
}

TEST(SubstrateStorage, MeanOverThresholdsIsTheNumber) {
  // Of n thresholds in the middles of n cells the upper code takes as many as its share, rounded: the mean is off by
  // half a cell of the step.
  constexpr int n = 1000;
  UniformNumbers uniform(4);
  for (const StorageField& field : storage_fields) {
    if (!is_data(field) || field.encoding == StorageEncoding::index) continue;
    for (int repeat = 0; repeat < 20; ++repeat) {
      const StorageCode code(field, 0);
      const double u = uniform();
      const double number = field.encoding == StorageEncoding::ratio
                                ? field.lower * std::pow(field.upper / field.lower, u)
                                : field.lower + u * (field.upper - field.lower);
      double sum = 0.0;
      for (int k = 0; k < n; ++k) sum += code.value(code.code(number, (k + 0.5) / n));
      const double rounding = 1e-12 * std::max(std::abs(number), field.upper * 1e-6);
      EXPECT_NEAR(sum / n, number, 0.5 / n * code.step(number) + rounding) << field.name;
      // And each is one of the two neighbours.
      const double nearest = code.value(code.code(number));
      EXPECT_LE(std::abs(nearest - number), 0.5 * code.step(number) * (1.0 + 1e-9) + rounding) << field.name;
    }
  }
}

TEST(SubstrateStorage, NoiseOfPixelsIsEven) {
  // Jimenez's formula at (1, 0): 52.9829189 × .06711056 = 3.55571335….
  EXPECT_NEAR(*Dithering::at(1, 0).threshold, 0.555713, 1e-6);
  EXPECT_EQ(*Dithering::at(0, 0).threshold, 0.0);
  constexpr int side = 256, cells = 64;
  std::array<int, cells> count{};
  for (int y = 0; y < side; ++y) {
    for (int x = 0; x < side; ++x) {
      const double t = *Dithering::at(x, y).threshold;
      ASSERT_GE(t, 0.0);
      ASSERT_LT(t, 1.0);
      ++count[static_cast<std::size_t>(t * cells)];
    }
  }
  // No cell may be off by more than five standard deviations of random thresholds; the noise is far more even.
  const double expected = static_cast<double>(side * side) / cells;
  for (const int each : count) EXPECT_NEAR(each, expected, 5.0 * std::sqrt(expected));
}

TEST(SubstrateStorage, QuantisationErrorIsThatOfRoundingAndDithering) {
  for (const StorageField& field : storage_fields) {
    if (!is_data(field) || field.encoding == StorageEncoding::index) continue;
    for (int c = 0; c < field.components(); ++c) {
      const StorageCode code(field, c);
      const QuantisationError error = quantisation_error(field, c);
      EXPECT_EQ(error.relative, field.encoding == StorageEncoding::ratio);
      constexpr int n = 200000;
      double nearest = 0.0, dithered = 0.0, worst = 0.0;
      // A low-discrepancy sequence in numbers and thresholds, which meets narrow steps evenly.
      for (int k = 0; k < n; ++k) {
        const double u = std::fmod((k + 0.5) * 0.75487766624669276, 1.0),
                     t = std::fmod((k + 0.5) * 0.5698402909980532, 1.0);
        const double number = error.relative ? field.lower * std::pow(field.upper / field.lower, u)
                                             : field.lower + u * (field.upper - field.lower);
        const double scale = error.relative ? number : 1.0;
        nearest += square((code.value(code.code(number)) - number) / scale);
        dithered += square((code.value(code.code(number, t)) - number) / scale);
        worst = std::max(worst, code.step(number) / scale);
      }
      // 2 %: what the sequence leaves of 200,000 points. Fields of 32 bits err by less than doubles resolve of 1e9.
      EXPECT_NEAR(std::sqrt(nearest / n) / error.rms_nearest, 1.0, 0.02) << field.name;
      EXPECT_NEAR(std::sqrt(dithered / n) / error.rms_dithered, 1.0, 0.02) << field.name;
      EXPECT_NEAR(worst / error.worst_step, 1.0, 0.02) << field.name;
    }
  }
}

// ---- streams ----------------------------------------------------------------------------------------------------

struct RandomMaterial {
  std::vector<StoredClosure> closures;
  std::vector<ClosureFeatures> features;
};
RandomMaterial random_material(UniformNumbers& uniform, std::size_t count) {
  const std::array bases{random_basis(uniform), random_basis(uniform), random_basis(uniform)};
  RandomMaterial material;
  for (std::size_t k = 0; k < count; ++k) {
    // A quarter of the flags each, so that small layouts come up too.
    std::size_t bits = 0;
    for (std::size_t flag = 0; flag < flags; ++flag) bits |= std::size_t{uniform() < 0.25} << flag;
    const auto basis = static_cast<std::size_t>(uniform.between(0.0, 3.0));
    material.features.push_back(with_flags(bits));
    material.features.back().tangent_basis = static_cast<int>(basis);
    material.closures.push_back(random_closure(material.features.back(), bases[basis], uniform));
  }
  return material;
}

/// The worst angle of an octahedral code with steps of `step` in both directions. A face holds equilateral triangles of
/// side √2 step, whose middle is √2/√3 step away from all three corners; the sphere inside touches faces at a distance
/// of 1/√3, where angles are √3 times as large, and nowhere larger.
double worst_angle(double step) { return std::sqrt(2.0) * step; }

TEST(SubstrateStorage, StreamIsAsLongAsTheBytesAndComesBack) {
  UniformNumbers uniform(5);
  std::array<int, 4> seen{};
  for (int repeat = 0; repeat < 600; ++repeat) {
    const RandomMaterial material = random_material(uniform, 1 + static_cast<std::size_t>(repeat) % most_closures);
    const bool dithered = repeat % 2 != 0;
    const PackedMaterial packed =
        pack_material(material.closures, dithered ? Dithering::at(repeat, 3 * repeat) : Dithering{});
    EXPECT_EQ(packed.words.size() * 4,
              static_cast<std::size_t>(packed.storage.bytes() + packed.storage.medium_bytes()));
    EXPECT_EQ(packed.storage.bytes(), bytes(material.features));
    EXPECT_TRUE(packed.losses.empty());
    ++seen[static_cast<std::size_t>(packed.storage.layout)];
    const UnpackedMaterial read = unpack_material(packed.words);
    ASSERT_EQ(read.closures.size(), material.closures.size());
    EXPECT_EQ(read.storage.layout, packed.storage.layout);
    for (std::size_t k = 0; k < read.closures.size(); ++k) {
      const StoredClosure &given = material.closures[k], &got = read.closures[k];
      EXPECT_EQ(got.slab.diffuse_model, given.slab.diffuse_model);
      EXPECT_EQ(got.specular_profile, given.specular_profile);
      for (const StorageField& field : storage_fields) {
        if (!is_data(field) || (field.feature && !(material.features[k].*field.feature))) continue;
        const std::vector<double> was = stored_numbers(given, field), is = stored_numbers(got, field);
        for (std::size_t c = 0; c < was.size(); ++c) {
          const double step = StorageCode(field, static_cast<int>(c)).step(was[c]);
          EXPECT_LE(std::abs(is[c] - was[c]), (dithered ? 1.0 : 0.5) * step * (1.0 + 1e-6) + 1e-12 * std::abs(was[c]))
              << field.name;
        }
      }
      const int basis = read.storage.basis_of_closure[k];
      const bool whole = basis > 0 && read.storage.has_tangent[static_cast<std::size_t>(basis - 1)];
      const double step = 2.0 / (whole ? 510.0 : basis > 0 ? 65534.0 : 4094.0);
      EXPECT_LE(std::acos(dot(got.basis.normal, given.basis.normal)), worst_angle(step) + 1e-7);
      EXPECT_NEAR(dot(got.basis.normal, got.basis.tangent), 0.0, 1e-14);
      EXPECT_NEAR(dot(got.basis.tangent, got.basis.tangent), 1.0, 1e-14);
      if (material.features[k].anisotropy) {
        // Turning into the stored normal's plane adds at most the normal's own angle.
        EXPECT_LE(std::acos(dot(got.basis.tangent, given.basis.tangent)),
                  worst_angle(2.0 / 126.0) + worst_angle(step) + 1e-7);
      }
    }
  }
  for (const int each : seen) EXPECT_GT(each, 0);
}

TEST(SubstrateStorage, DitheredStreamsAreTheMaterialInTheMean) {
  UniformNumbers uniform(6);
  const RandomMaterial material = random_material(uniform, 6);
  constexpr int n = 500;
  std::vector<std::vector<double>> sums;
  std::vector<double> given, steps;
  for (int repeat = 0; repeat < n; ++repeat) {
    const UnpackedMaterial read =
        unpack_material(pack_material(material.closures, Dithering{(repeat + 0.5) / n}).words);
    std::vector<double>& all = sums.emplace_back();
    for (std::size_t k = 0; k < read.closures.size(); ++k) {
      for (const StorageField& field : storage_fields) {
        if (!is_data(field) || (field.feature && !(material.features[k].*field.feature))) continue;
        const std::vector<double> was = stored_numbers(material.closures[k], field),
                                  is = stored_numbers(read.closures[k], field);
        for (std::size_t c = 0; c < is.size(); ++c) {
          all.push_back(is[c]);
          if (repeat == 0)
            given.push_back(was[c]), steps.push_back(StorageCode(field, static_cast<int>(c)).step(was[c]));
        }
      }
    }
  }
  for (std::size_t j = 0; j < given.size(); ++j) {
    double mean = 0.0;
    for (const auto& each : sums) mean += each[j] / n;
    // Evenly spaced thresholds stay so when they are shifted: a count off by one at most.
    EXPECT_NEAR(mean, given[j], steps[j] / n + 1e-11 * std::abs(given[j])) << j;
  }
  // Fields err apart from each other: under one threshold this near to 0 nearly all would go up.
  const auto up = std::ranges::count_if(std::views::iota(std::size_t{0}, given.size()),
                                        [&](std::size_t j) { return sums[5][j] > given[j]; });
  EXPECT_GT(up, static_cast<long>(given.size() / 4));
  EXPECT_LT(up, static_cast<long>(given.size() - given.size() / 4));
}

TEST(SubstrateStorage, EightClosuresWithEverythingFit) {
  UniformNumbers uniform(7);
  std::vector<StoredClosure> closures;
  for (int k = 0; k < most_closures; ++k)
    closures.push_back(random_closure(with_flags(1023), random_basis(uniform), uniform));
  const PackedMaterial packed = pack_material(closures);
  EXPECT_EQ(packed.storage.has_tangent, std::vector<bool>(most_closures, true));
  EXPECT_EQ(unpack_material(packed.words).closures.size(), closures.size());
  EXPECT_EQ(packed.words.size(), static_cast<std::size_t>((16 + 8 * bits_of(with_flags(1023)) + 31) / 32 + 8 + 1 + 16));
  // On one basis they need one word for it.
  for (StoredClosure& closure : closures) closure.basis = closures[0].basis;
  EXPECT_EQ(pack_material(closures).words.size(), packed.words.size() - 7);
}

TEST(SubstrateStorage, WhatIsLostIsSaid) {
  StoredClosure closure;
  closure.slab = {.f0 = {0.04, 0.04, 0.04},
                  .f90 = {1.0, 1.0, 1.0},
                  .roughness = 1.5,
                  .specular_tint = {1.0, 1.0, 1.0},
                  .emissive = {0.0, 2.0, 0.0}};
  closure.slab.glint_density = 10.0;
  closure.slab.mean_free_path = {1e-7, 0.0, 1.0};
  closure.glints = {.u = 3.25, .v = 0.5, .major = 0.01, .minor = 0.01};
  const PackedMaterial packed = pack_material(std::array{closure});
  std::set<std::string> lost;
  for (const StorageLoss& each : packed.losses) lost.insert(each.parameter);
  EXPECT_EQ(lost, (std::set<std::string>{"roughness", "emissive", "glint_position", "mean_free_path"}));
  const StoredClosure read = unpack_material(packed.words).closures[0];
  EXPECT_EQ(read.slab.roughness, 1.0);
  EXPECT_NEAR(read.glints.u, 0.25, 1e-7);
  EXPECT_NEAR(read.slab.mean_free_path.x, 1e-5, 1e-15);
  EXPECT_EQ(read.slab.mean_free_path.y, 0.0);
  EXPECT_FALSE(not_stored().empty());
}

TEST(SubstrateStorage, NumbersThatAreNoneAreRefused) {
  const auto refused = [](auto change) {
    StoredClosure closure;
    change(closure);
    return code_of([&] { pack_material(std::array{closure}); }) == ExitCode::invalid_input;
  };
  EXPECT_FALSE(refused([](StoredClosure&) {}));
  EXPECT_TRUE(refused([](StoredClosure& c) { c.slab.roughness = std::nan(""); }));
  EXPECT_TRUE(refused([](StoredClosure& c) { c.throughput.y = INFINITY; }));
  EXPECT_TRUE(refused([](StoredClosure& c) { c.slab.emissive.z = INFINITY; }));
  EXPECT_TRUE(refused([](StoredClosure& c) { c.glints.angle = -INFINITY; }));
  EXPECT_TRUE(refused([](StoredClosure& c) { c.basis.normal = {}; }));
  EXPECT_TRUE(refused([](StoredClosure& c) { c.slab.anisotropy = 0.5, c.basis.tangent = c.basis.normal; }));
}

TEST(SubstrateStorage, MalformedStreamsAreRefused) {
  UniformNumbers uniform(8);
  const auto refused = [](const std::vector<std::uint32_t>& words) {
    return code_of([&] { unpack_material(words); }) == ExitCode::invalid_input;
  };
  EXPECT_TRUE(refused({}));
  for (int repeat = 0; repeat < 100; ++repeat) {
    const RandomMaterial material = random_material(uniform, 1 + static_cast<std::size_t>(repeat) % most_closures);
    const PackedMaterial packed = pack_material(material.closures);
    for (std::size_t length = 0; length < packed.words.size(); ++length) {
      EXPECT_TRUE(refused({packed.words.begin(), packed.words.begin() + static_cast<std::ptrdiff_t>(length)}));
    }
    std::vector<std::uint32_t> longer = packed.words;
    longer.push_back(0);
    EXPECT_TRUE(refused(longer));
    const auto flipped = [&](std::size_t bit) {
      std::vector<std::uint32_t> words = packed.words;
      words[bit / 32] ^= 1u << (bit % 32);
      return words;
    };
    // Reserved bits and padding.
    for (std::size_t bit = 11; bit < 16; ++bit) EXPECT_TRUE(refused(flipped(bit)));
    std::size_t end = 0;
    for (const StoredField& each : packed.storage.fields) {
      const StoragePart part = each.field->part;
      if (part == StoragePart::material_header || part == StoragePart::closure_header ||
          part == StoragePart::closure_data)
        end += static_cast<std::size_t>(each.field->bit_count());
    }
    for (std::size_t bit = end; bit % 32 != 0; ++bit) EXPECT_TRUE(refused(flipped(bit)));
    // The layout and the number of bases follow from the closures.
    for (const std::size_t bit : {0u, 1u, 5u, 6u, 7u, 8u}) EXPECT_TRUE(refused(flipped(bit))) << bit;
    // Any other flip either is refused or reads as a material whose storage is the stream's.
    for (std::size_t bit = 0; bit < 32 * packed.words.size(); ++bit) {
      try {
        const UnpackedMaterial read = unpack_material(flipped(bit));
        EXPECT_EQ(static_cast<std::size_t>(read.storage.words + read.storage.medium_words), packed.words.size());
      } catch (const Error& error) {
        EXPECT_EQ(error.code(), ExitCode::invalid_input);
      }
    }
  }
}

TEST(SubstrateStorage, SimpleStreamReadsAsTheSlideDrawsIt) {
  // Material header 16 bits, closure 48, TopLayer 32; codes by hand.
  StoredClosure closure;
  closure.slab.f90 = {1.0, 1.0, 1.0};
  closure.slab.diffuse_albedo = {1.0, srgb_decode(64.0 / 127.0), 0.0};
  closure.slab.f0 = {square(2.0 / 127.0), square(3.0 / 127.0), square(5.0 / 63.0)};
  closure.slab.roughness = 51.0 / 255.0;
  closure.slab.diffuse_model = 1.0;
  const std::vector<std::uint32_t> words = pack_material(std::array{closure}).words;
  ASSERT_EQ(words.size(), 3u);
  const std::uint64_t low = words[0] | (std::uint64_t{words[1]} << 32);
  // layout 0, one closure 0, no bases 0, diffuse model 1.
  EXPECT_EQ(low & 0xffff, 1u << 9);
  const std::uint64_t codes = low >> 16;
  EXPECT_EQ(codes & 127, 127u);
  EXPECT_EQ((codes >> 7) & 127, 64u);
  EXPECT_EQ((codes >> 14) & 63, 0u);
  EXPECT_EQ((codes >> 20) & 127, 2u);
  EXPECT_EQ((codes >> 27) & 127, 3u);
  EXPECT_EQ((codes >> 34) & 63, 5u);
  EXPECT_EQ(codes >> 40, 51u);
  // The normal is the octahedron's middle.
  EXPECT_EQ(words[2], 2047u | (2047u << 12) | (51u << 24));
}

// ---- error of the BRDF ------------------------------------------------------------------------------------------

Table small_directions() {
  Table table;
  table.grid = Grid::named_or_file("small");
  table.channels = 3;
  table.allocate();
  return table;
}

TEST(SubstrateStorage, ClosuresAddUpUnderWhatLiesAbove) {
  // Face-on Lambertian slabs: throughput ρ/π (1 - C + C T), C = ½ and T = ¼ giving .625.
  StoredClosure closure;
  closure.slab.diffuse_albedo = {0.5, 0.5, 0.5};
  closure.slab.diffuse_model = 2.0;
  closure.coverage_above = 0.5;
  closure.transmittance_above = {0.25, 1.0, 0.0};
  closure.throughput = {0.5, 1.0, 1.0};
  const Direction up{0.0, 0.0, 1.0};
  const Rgb once = closures_brdf(std::array{closure}, {}, up, up);
  EXPECT_NEAR(once.x, 0.5 * 0.5 / pi * 0.625, 1e-15);
  EXPECT_NEAR(once.y, 0.5 / pi, 1e-15);
  EXPECT_NEAR(once.z, 0.5 / pi * 0.5, 1e-15);
  // At 60° the light passes twice as far: 1 - ½ + ½/16.
  EXPECT_NEAR(closures_brdf(std::array{closure}, {}, direction(radians(60.0), 0.3), up).x,
              0.5 * 0.5 / pi * (0.5 + 0.5 / 16.0), 1e-15);
  const Rgb twice = closures_brdf(std::array{closure, closure}, {}, up, up);
  EXPECT_NEAR(twice.x, 2.0 * once.x, 1e-15);
  // A surface tilted by 30° gets cos 30° of the frame's light, at 90° none.
  closure.coverage_above = 0.0;
  closure.basis.normal = direction(radians(30.0), 0.0);
  EXPECT_NEAR(closures_brdf(std::array{closure}, {}, up, up).y, 0.5 / pi * std::cos(radians(30.0)), 1e-15);
  closure.basis.normal = {1.0, 0.0, 0.0};
  EXPECT_EQ(closures_brdf(std::array{closure}, {}, up, up).y, 0.0);
}

TEST(SubstrateStorage, ErrorOfALambertianMaterialIsItsAlbedos) {
  StoredClosure closure;
  closure.slab.f90 = {1.0, 1.0, 1.0};
  closure.slab.diffuse_model = 2.0;
  closure.slab.diffuse_albedo = {0.2, 0.4, 0.6};
  const UnpackedMaterial read = unpack_material(pack_material(std::array{closure}).words);
  const Table table = small_directions();
  const std::vector<double> weights = entry_weights(table, {}, Quantity::brdf);
  const SubstrateStorageError error = substrate_storage_error(std::array{closure}, read.closures, table, weights);
  const Rgb lost = read.closures[0].slab.diffuse_albedo - closure.slab.diffuse_albedo;
  // π f is the albedo, in floats.
  EXPECT_NEAR(error.total[static_cast<std::size_t>(Quantity::brdf)], std::sqrt(dot(lost, lost) / 3.0), 2e-7);
  ASSERT_FALSE(error.alone.empty());
  EXPECT_EQ(error.alone[0].field, "diffuse_albedo");
  EXPECT_NEAR(error.alone[0].rms, error.total[static_cast<std::size_t>(Quantity::log)], 1e-12);
}

/// A document's line must be this one; what stands in for it is printed.
void expect_line(const std::string& line) {
  std::ostringstream document;
  document << std::ifstream(LOBEFIT_DOCS "/substrate_storage.md").rdbuf();
  EXPECT_NE(document.str().find(line + '\n'), std::string::npos) << line;
}

TEST(SubstrateStorage, FieldsStandInTheDocument) {
  for (const StorageField& field : storage_fields) {
    std::string bits = fmt::format("{}", field.bits[0]);
    for (int c = 1; c < field.components(); ++c) bits += fmt::format("/{}", field.bits[static_cast<std::size_t>(c)]);
    std::string line = fmt::format("| {} | {} | {} | {} |", storage_part_names[static_cast<std::size_t>(field.part)],
                                   field.name, bits, field.purpose);
    if (is_data(field) && field.encoding != StorageEncoding::index) {
      const QuantisationError error = quantisation_error(field, 0);
      const std::string unit = error.relative ? " of it" : "";
      line += fmt::format(" {}, {:.4g} to {:.4g} | {:.2g}{} | {:.2g} | {:.2g} |",
                          storage_encoding_names[static_cast<std::size_t>(field.encoding)], field.lower, field.upper,
                          error.worst_step, unit, error.rms_nearest, error.rms_dithered);
    } else {
      line += fmt::format(" {} | | | |", storage_encoding_names[static_cast<std::size_t>(field.encoding)]);
    }
    expect_line(line);
  }
}

TEST(SubstrateStorage, ErrorsOfMaterialsStandInTheDocument) {
  const auto slab = [](Rgb albedo, Rgb f0, double roughness) {
    StoredClosure closure;
    closure.slab = {.diffuse_albedo = albedo,
                    .f0 = f0,
                    .f90 = {1.0, 1.0, 1.0},
                    .roughness = roughness,
                    .specular_tint = {1.0, 1.0, 1.0}};
    return closure;
  };
  const Rgb glass{0.04, 0.04, 0.04}, gold{1.0, 0.71, 0.29};
  std::vector<std::pair<std::string, std::vector<StoredClosure>>> materials{
      {"plastic, roughness .3", {slab({0.5, 0.2, 0.1}, glass, 0.3)}},
      {"dark plastic, roughness .3", {slab({0.02, 0.03, 0.02}, glass, 0.3)}},
      {"gold, roughness .5", {slab({}, gold, 0.5)}},
      {"gold, roughness .15", {slab({}, gold, 0.15)}}};
  StoredClosure brushed = slab({}, gold, 0.5);
  brushed.slab.anisotropy = 0.75;
  brushed.basis = {direction(radians(3.0), 1.0), {}};
  brushed.basis.tangent = normalize(cross(brushed.basis.normal, Direction{0.3, 0.8, 0.1}));
  materials.push_back({"brushed gold, roughness .5, anisotropy .75, normal tilted", {brushed}});
  StoredClosure hazy = slab({0.5, 0.2, 0.1}, glass, 0.2);
  hazy.slab.second_roughness = 0.55;
  hazy.slab.second_roughness_weight = 0.3;
  hazy.slab.fuzz_amount = 0.2;
  hazy.slab.fuzz_color = {0.8, 0.6, 0.4};
  hazy.slab.fuzz_roughness = 0.4;
  materials.push_back({"hazy plastic with fuzz", {hazy}});
  StoredClosure under = slab({}, gold, 0.5);
  under.throughput = {0.8, 0.5, 0.35};
  under.transmittance_above = {0.85, 0.55, 0.4};
  under.coverage_above = 0.9;
  materials.push_back({"gold under a coat of 90 % coverage", {slab({}, glass, 0.3), under}});

  const Table table = gbuffer_directions();
  const std::vector<double> weights = entry_weights(table, {}, Quantity::log);
  const auto log = static_cast<std::size_t>(Quantity::log), cosine = static_cast<std::size_t>(Quantity::cosine);
  for (const auto& [name, closures] : materials) {
    const PackedMaterial packed = pack_material(closures);
    const SubstrateStorageError error =
        substrate_storage_error(closures, unpack_material(packed.words).closures, table, weights);
    expect_line(fmt::format("| {} | {} | {:.2g} | {:.2g} | {} ({:.2g}) |", name, packed.storage.bytes(),
                            error.total[log], error.total[cosine], error.alone[0].field, error.alone[0].rms));
  }
}

TEST(SubstrateStorage, WhatHasBeenStoredOnceLosesNothingMore) {
  UniformNumbers uniform(9);
  const Table table = small_directions();
  const std::vector<double> weights = entry_weights(table, {}, Quantity::log);
  for (int repeat = 0; repeat < 6; ++repeat) {
    RandomMaterial material = random_material(uniform, 1 + static_cast<std::size_t>(repeat) % 4);
    // Seen from above, and sharp lobes dulled.
    for (StoredClosure& closure : material.closures) closure.basis.normal.z = std::abs(closure.basis.normal.z);
    const UnpackedMaterial once = unpack_material(pack_material(material.closures).words);
    const UnpackedMaterial twice = unpack_material(pack_material(once.closures).words);
    EXPECT_GT(substrate_storage_error(material.closures, once.closures, table, weights).total[0], 0.0);
    const SubstrateStorageError error = substrate_storage_error(once.closures, twice.closures, table, weights);
    for (const StoredFieldError& each : error.alone) EXPECT_EQ(each.rms, 0.0) << each.field;
    EXPECT_EQ(error.total[0], 0.0);
  }
  EXPECT_EQ(code_of([&] {
              const std::vector<StoredClosure> one(1), two(2);
              substrate_storage_error(one, two, table, weights);
            }),
            ExitCode::usage);
}

}  // namespace
}  // namespace lobefit
