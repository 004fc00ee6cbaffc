// Closed forms with constants (models/approximations), by name and with derivatives.
#pragma once

#include <functional>
#include <span>
#include <string>
#include <vector>

#include "models/approximations/form.h"

namespace lobefit {

struct Form {
  std::string_view name, title, formula, source;
  std::vector<std::string> arguments;
  std::vector<FormConstant> constants;
  /// The value; its derivatives by the constants too, unless `derivatives` is null.
  std::function<double(std::span<const double> constants, std::span<const double> arguments, double* derivatives)>
      evaluate;
  bool has_shader = true;  // not of integrals

  /// All constants as published.
  std::vector<double> published() const;
  /// Throws Error(usage) with the names that there are.
  std::size_t constant_index(const std::string& constant) const;
};

const std::vector<Form>& forms();
/// Throws Error(usage) with the nearest name.
const Form& find_form(const std::string& name);

}  // namespace lobefit
