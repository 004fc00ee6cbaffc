// The GBuffer of Callisto's port to Unreal Engine 4.27: which byte holds what.
//
//   const GBufferPixel pixel = pack_gbuffer(port);        // parameters of callisto_ue427
//   const ParameterValues read = unpack_gbuffer(pixel);   // as the port's shader reads them back
//
// gbuffer_material.h brings other models here, and tells what is lost.
//
// Sources. CustomData, Anisotropy and ambient occlusion are as in S0's listings of ShadingModelsMaterial.ush and
// CallistoBxDF: Retroreflection goes into CustomData.g as it is, while the pin's range is 0…256, and DiffuseFresnel is
// 256 times the anisotropy. The rest S0 leaves to the engine, whose public sources say (DeferredShadingCommon.ush,
// SceneRenderTargets.cpp):
//   - B = Metallic, Specular, Roughness; C = base colour, ambient occlusion; D = CustomData; F.a = Anisotropy;
//   - all four are PF_B8G8R8A8 with r.GBufferFormat's default, C with TexCreate_SRGB: its colour is stored in sRGB;
//   - specular colour is .08 Specular for a dielectric, base colour for a metal;
//   - bytes are made by the hardware, to nearest: Direct3D's rules for FLOAT to UNORM and to SRGB.
// Two traps, stated with every result (gbuffer_assumptions()): C.a holds ambient occlusion only in projects without
// static lighting, and the anisotropy pass stores a/2 + 1/2.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "models/registry.h"

namespace lobefit {

inline constexpr std::string_view gbuffer_model = "callisto_ue427";

/// The textures that hold parameters.
enum class GBufferTexture { b, c, d, f };
inline constexpr std::array<std::string_view, 4> gbuffer_texture_names{"GBufferB", "GBufferC", "GBufferD", "GBufferF"};

/// One pixel's bytes; 0 where no parameter lies (normals and shading model, among others).
struct GBufferPixel {
  std::array<std::array<std::uint8_t, 4>, gbuffer_texture_names.size()> bytes{};  // [texture][r, g, b, a]

  bool operator==(const GBufferPixel&) const = default;
};

/// Where a number lies, and how it is stored.
struct GBufferField {
  std::string_view parameter;    // of callisto_ue427; "metallic" is none, and has a part in albedo and f0
  std::string_view engine_name;  // in the engine's FGBufferData
  GBufferTexture texture;
  std::size_t channel;         // the first
  std::size_t components = 1;  // one byte each; a colour in a field of one is stored as its mean
  double full = 1.0;           // what byte 255 stands for
  bool srgb = false;

  /// The nearest byte, in sRGB by its code; out of range the nearest end.
  std::uint8_t encode(double value) const;
  double decode(std::uint8_t byte) const;
  /// "GBufferC.rgb".
  std::string place() const;
  std::span<const std::uint8_t> bytes(const GBufferPixel& pixel) const {
    return std::span(pixel.bytes[static_cast<std::size_t>(texture)]).subspan(channel, components);
  }
  std::span<std::uint8_t> bytes(GBufferPixel& pixel) const {
    return std::span(pixel.bytes[static_cast<std::size_t>(texture)]).subspan(channel, components);
  }
};

struct GBufferOptions {
  /// The project allows static lighting (r.AllowStaticLighting, the engine's default): C.a then holds baked irradiance,
  /// and ambient occlusion reads as 1.
  bool static_lighting = false;
  /// Store Metallic too, so that f0 above .08, and its colour, survive as far as one base colour can be albedo and f0
  /// (MetallicSurface); else it is 0.
  bool metallic = false;
};

std::span<const GBufferField> gbuffer_fields();
/// Null if no channel holds the parameter.
const GBufferField* find_gbuffer_field(std::string_view parameter, const GBufferOptions& options);

/// What the port hard-codes is not stored. Throws Error(usage) for parameters of another model than callisto_ue427.
GBufferPixel pack_gbuffer(const ParameterValues& port, const GBufferOptions& options = {});
/// Parameters of callisto_ue427; what the port hard-codes as it does, which are the model's defaults.
ParameterValues unpack_gbuffer(const GBufferPixel& pixel, const GBufferOptions& options = {});

/// What the layout rests on, a sentence each.
std::vector<std::string> gbuffer_assumptions(const GBufferOptions& options);

}  // namespace lobefit
