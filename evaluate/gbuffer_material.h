// What a fitted material becomes in the GBuffer of Callisto's port to Unreal Engine 4.27.
//
//   const GBufferMaterial stored = gbuffer_material(values);  // of callisto, callisto_lambert or callisto_ue427
//   stored.port        parameters of callisto_ue427 as its shader has them, not yet stored
//   stored.pixel       the bytes
//   stored.decoded     parameters of callisto_ue427 as the shader reads them back
//   stored.parameters  for each parameter of `values`, where it went and what was lost
#pragma once

#include "evaluate/gbuffer.h"

namespace lobefit {

enum class GBufferLossKind {
  grey,       // a colour where there is one channel
  clamped,    // out of the field's range
  quantised,  // rounded to the nearest byte
  dropped,    // no field, and not what the port has in its place
  shared,     // albedo and f0 of a metallic surface: one base colour for both
};
inline constexpr std::array<std::string_view, 5> gbuffer_loss_names{"grey", "clamped", "quantised", "dropped",
                                                                    "shared"};

struct GBufferLoss {
  GBufferLossKind kind;
  double amount;  // largest difference that it makes in a component of the parameter
  std::string words;
};

/// What became of one parameter of the material. Numbers are in that parameter's terms: alpha stays alpha though its
/// root is what is stored.
struct GBufferParameter {
  std::string name;
  std::vector<double> value;            // 1 number, or 3 of a colour that isn't grey
  const GBufferField* field = nullptr;  // null: nowhere
  std::vector<std::uint8_t> bytes;      // of the field
  std::vector<double> decoded;          // what the port has in its place; empty if nothing
  std::vector<GBufferLoss> losses;
  std::string remark;  // what else happened to it, "" if nothing
};

struct GBufferMaterial {
  ParameterValues port, decoded;
  GBufferPixel pixel;
  std::vector<GBufferParameter> parameters;
  /// How the port's formula differs from the material's own model.
  std::vector<std::string> formula;
};

/// Tints are 1 in the port, so an intensity takes the mean of its product with its tint: of all single numbers, the
/// nearest to the three in least squares. A terminator, always of weight ½ in the port, gets length 0 where no
/// terminator at all is nearer to the material's own weight. Throws Error(usage) for other models.
GBufferMaterial gbuffer_material(const ParameterValues& values, const GBufferOptions& options = {});

}  // namespace lobefit
