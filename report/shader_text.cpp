#include "report/shader_text.h"

#include <fmt/format.h>

#include "evaluate/float_model.h"
#include "evaluate/shader.h"

namespace lobefit {

std::string shader_text(const Model& model, const ParameterValues& values, const Fit* fit, const std::string& language,
                        const std::string& command, const std::string& origin) {
  std::vector<ShaderParameter> parameters;
  for (const ParameterInfo& info : model.parameters) {
    const std::span<const double> slots = values.components(info);
    ShaderParameter parameter{info, {slots.begin(), slots.end()}, ""};
    if (fit) {
      for (const FitParameter& p : fit->parameters) {
        if (p.name != info.name || !p.free) continue;
        parameter.comment = p.estimate.at_bound               ? "fitted; at its bound"
                            : p.estimate.standard_error > 0.0 ? fmt::format("fitted; 95 % interval [{:.6g}, {:.6g}]",
                                                                            p.estimate.ci_low, p.estimate.ci_high)
                                                              : "fitted to an exact table";
      }
    }
    parameters.push_back(std::move(parameter));
  }
  std::vector<std::string> provenance{"Written by lobefit " LOBEFIT_VERSION ": " + command};
  if (!origin.empty()) provenance.push_back(origin);
  return print_shader(find_float_model(model.info->name).trace(), language, *model.info, parameters, provenance);
}

}  // namespace lobefit
