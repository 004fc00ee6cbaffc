#include "reference/substrate/unreal_slabs.h"

#include "models/substrate/blend.h"
#include "models/substrate/conversions.h"

namespace lobefit {

namespace {

SlabValues default_lit(const UnrealSurface<double>& pins) {
  SlabValues slab = default_slab();
  set_metalness(slab, pins.base_color, pins.metallic, pins.specular);
  slab.roughness = pins.roughness;
  return slab;
}

template <class M>
int add_scattering(SlabTree& tree, const typename M::template Parameters<double>& pins) {
  const ScatteredShares scattered = scattered_shares<M>(pins);
  SlabValues slab = default_lit(pins);
  slab.diffuse_albedo = at_most(slab.diffuse_albedo + scattered.back, 1.0);
  slab.mean_free_path = mean_free_path_of(at_most(scattered.through, 1.0), slab.thickness);
  return tree.add_slab(slab, std::string(unreal_slab_name<M>));
}

}  // namespace

int add_unreal_slabs(SlabTree& tree, const UnrealDefaultLit::Parameters<double>& pins) {
  SlabValues slab = default_lit(pins);
  slab.anisotropy = min(max(pins.anisotropy, -0.9), 0.9);
  return tree.add_slab(slab, "default_lit");
}

int add_unreal_slabs(SlabTree& tree, const UnrealClearCoat::Parameters<double>& pins) {
  SlabValues film = default_slab();
  film.diffuse_albedo = {0.0, 0.0, 0.0};
  film.roughness = pins.clear_coat_roughness;
  film.mean_free_path = {longest_mean_free_path, longest_mean_free_path, longest_mean_free_path};
  const int base = tree.add_slab(default_lit(pins), "default_lit"), coat = tree.add_slab(film, "clear_coat");
  return tree.add_vertical(pins.clear_coat < 1.0 ? tree.add_coverage(coat, pins.clear_coat) : coat, base, 0.01);
}

int add_unreal_slabs(SlabTree& tree, const UnrealCloth::Parameters<double>& pins) {
  SlabValues slab = default_lit(pins);
  slab.fuzz_amount = pins.cloth;
  slab.fuzz_color = pins.fuzz_color;
  slab.fuzz_roughness = max(pins.roughness, 0.01);
  return tree.add_slab(slab, "cloth");
}

int add_unreal_slabs(SlabTree& tree, const UnrealSubsurface::Parameters<double>& pins) {
  return add_scattering<UnrealSubsurface>(tree, pins);
}
int add_unreal_slabs(SlabTree& tree, const UnrealTwoSidedFoliage::Parameters<double>& pins) {
  return add_scattering<UnrealTwoSidedFoliage>(tree, pins);
}
int add_unreal_slabs(SlabTree& tree, const UnrealPreintegratedSkin::Parameters<double>& pins) {
  return add_scattering<UnrealPreintegratedSkin>(tree, pins);
}

int add_unreal_slabs(SlabTree& tree, const UnrealSubsurfaceProfile::Parameters<double>& pins) {
  SlabValues slab = default_lit(pins);
  const double effect = saturate(10.0 * pins.opacity);
  slab.roughness = saturate(pins.roughness * lerp(1.0, pins.first_roughness_scale, effect));
  slab.second_roughness = saturate(pins.roughness * lerp(1.0, pins.second_roughness_scale, effect));
  slab.second_roughness_weight = pins.lobe_mix;
  return tree.add_slab(slab, "subsurface_profile");
}

int add_unreal_slabs(SlabTree& tree, const UnrealEye::Parameters<double>& pins) {
  return tree.add_slab(default_lit(pins), "eye");
}

}  // namespace lobefit
