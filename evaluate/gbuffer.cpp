#include "evaluate/gbuffer.h"

#include <algorithm>
#include <cmath>

#include "evaluate/channels.h"
#include "evaluate/metallic_surface.h"
#include "reference/srgb.h"

namespace lobefit {

namespace {

using enum GBufferTexture;

constexpr std::array<GBufferField, 10> fields{{
    {"albedo", "BaseColor", c, 0, 3, 1.0, true},
    {"f0", "Specular", b, 1, 1, largest_dielectric_f0},
    {"metallic", "Metallic", b, 0},
    {"roughness", "Roughness", b, 2},
    {"specular_fresnel_falloff", "CustomData.r", d, 0},
    {"retroreflection", "CustomData.g", d, 1},
    {"terminator_length", "CustomData.b", d, 2},
    {"diffuse_fresnel_falloff", "CustomData.a", d, 3},
    {"diffuse_fresnel", "Anisotropy", f, 3, 1, 256.0},
    {"retroreflection_falloff", "GBufferAO", c, 3},
}};

/// The numbers that a field is to store.
Channels numbers_of(const GBufferField& field, const ParameterValues& port, const MetallicSurface& surface) {
  if (field.parameter == "albedo") return surface.base_color;
  if (field.parameter == "f0") return {surface.dielectric_f0};
  if (field.parameter == "metallic") return {surface.metallic};
  return channels_of(port, field.parameter);
}

}  // namespace

std::uint8_t GBufferField::encode(double value) const {
  const double share = std::clamp(value / full, 0.0, 1.0);
  return static_cast<std::uint8_t>(std::floor(255.0 * (srgb ? srgb_encode(share) : share) + 0.5));
}

double GBufferField::decode(std::uint8_t byte) const {
  const double share = byte / 255.0;
  return full * (srgb ? srgb_decode(share) : share);
}

std::string GBufferField::place() const {
  return std::string(gbuffer_texture_names[static_cast<std::size_t>(texture)]) + "." +
         std::string(std::string_view("rgba").substr(channel, components));
}

std::span<const GBufferField> gbuffer_fields() { return fields; }

const GBufferField* find_gbuffer_field(std::string_view parameter, const GBufferOptions& options) {
  if (options.static_lighting && parameter == "retroreflection_falloff") return nullptr;
  const auto found = std::ranges::find(fields, parameter, &GBufferField::parameter);
  return found != fields.end() ? &*found : nullptr;
}

GBufferPixel pack_gbuffer(const ParameterValues& port, const GBufferOptions& options) {
  if (port.owner() != gbuffer_model) {
    throw Error(ExitCode::usage, "'" + port.owner() + "' is not the port's model", "GBuffer",
                "give parameters of " + std::string(gbuffer_model));
  }
  const Channels albedo = channels_of(port, "albedo"), f0 = channels_of(port, "f0");
  const MetallicSurface surface =
      options.metallic ? MetallicSurface::nearest(albedo, f0) : MetallicSurface{albedo, mean(f0), 0.0};
  GBufferPixel pixel;
  for (const GBufferField& field : fields) {
    if (!find_gbuffer_field(field.parameter, options)) continue;
    const Channels numbers = numbers_of(field, port, surface);
    const std::span<std::uint8_t> bytes = field.bytes(pixel);
    for (std::size_t k = 0; k < bytes.size(); ++k) bytes[k] = field.encode(numbers[k]);
  }
  return pixel;
}

ParameterValues unpack_gbuffer(const GBufferPixel& pixel, const GBufferOptions& options) {
  ParameterValues values = find_model(gbuffer_model).defaults();
  MetallicSurface surface;
  for (const GBufferField& field : fields) {
    const std::span<const std::uint8_t> bytes = field.bytes(pixel);
    const double first = field.decode(bytes[0]);
    if (!find_gbuffer_field(field.parameter, options)) {
      values.set(field.parameter, 1.0);
    } else if (field.parameter == "albedo") {
      for (std::size_t k = 0; k < bytes.size(); ++k) surface.base_color[k] = field.decode(bytes[k]);
    } else if (field.parameter == "f0") {
      surface.dielectric_f0 = first;
    } else if (field.parameter == "metallic") {
      surface.metallic = first;
    } else {
      values.set(field.parameter, first);
    }
  }
  values.set("albedo", surface.albedo());
  values.set("f0", surface.f0());
  return values;
}

std::vector<std::string> gbuffer_assumptions(const GBufferOptions& options) {
  return {"8 bits to a channel, as with r.GBufferFormat's default",
          options.static_lighting
              ? "static lighting is allowed: GBufferC.a holds baked irradiance"
              : "no static lighting (r.AllowStaticLighting=0): else GBufferC.a holds baked irradiance, and "
                "retroreflection_falloff reads as 1 (--static-lighting)",
          "the byte of Anisotropy is diffuse_fresnel/256: if the anisotropy pass stores a/2 + 1/2, as the engine's "
          "does, the "
          "pin takes diffuse_fresnel/128 - 1",
          options.metallic ? "Metallic, base colour and Specular are the nearest to albedo and f0 together"
                           : "Metallic is 0, so f0 is .08 Specular (--metallic)"};
}

}  // namespace lobefit
