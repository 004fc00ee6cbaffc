#pragma once

#include <string>

#include "fit/fit.h"

namespace lobefit {

/// The exported shader of a model with `values`; intervals from `fit` where there is one. `origin` is one more line of
/// the head comment, or "".
std::string shader_text(const Model& model, const ParameterValues& values, const Fit* fit, const std::string& language,
                        const std::string& command, const std::string& origin);

}  // namespace lobefit
