#include "evaluate/shader.h"

#include "evaluate/shader_printer.h"

namespace lobefit {

std::string print_shader(const Shader& shader, std::string_view language_name, const ModelInfo& model,
                         std::span<const ShaderParameter> parameters, std::span<const std::string> provenance) {
  const ShaderLanguage& language = find_shader_language(language_name);
  const std::string vector(language.vector);
  const std::string name = "Lobefit_" + std::string(model.name);
  std::string text = "// " + std::string(model.title) + ".\n// Source: " + std::string(model.source) + ".\n";
  for (const std::string& line : provenance) text += "// " + line + "\n";
  const std::string_view axis = is_hair(model.kind) ? "the fibre's axis" : "the normal";
  const std::string_view result =
      is_hair(model.kind) && is_term(model.kind) ? "the term, the same in all channels"
      : is_hair(model.kind) ? "S in 1/sr: the radiance that leaves is the integral of S L over all directions, without "
                              "cosine"
      : is_term(model.kind) ? "the term at their half vector, the same in all channels"
                            : "the BRDF in 1/sr, without cosine";
  text += "// wi: to the light, wo: to the viewer; unit vectors of the tangent frame, z " + std::string(axis) +
          ".\n// Returns " + std::string(result) + "." +
          (model.transmits ? "\n// Multiply it by |N.L|: light from behind comes through." : "") + "\n\n" +
          shader_prologue(language) + struct_text(language, name + "_Parameters", parameters) +
          definitions_text(language, shader);
  text += function_head(language, vector, name,
                        argument_text(language, vector, "wi") + ", " + argument_text(language, vector, "wo") + ", " +
                            argument_text(language, name + "_Parameters", "p")) +
          body_text(language, shader.brdf, {"p"}) + "}\n\n";

  return text + values_text(language, name + "_Parameters", name + "_Fitted", parameters);
}

}  // namespace lobefit
