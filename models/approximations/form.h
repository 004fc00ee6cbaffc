// Closed forms with their constants as arguments: what a refit moves, and what the engines' published constants are
// values of. A form is a struct with
//
//   name, title, formula, source
//   arguments    names of its arguments, as the truths that it stands for name them
//   constants    with published values, or starting values where nothing is published
//   evaluate(c, x)   one text for all scalars, constants and arguments of one type
//   quadrature   if there, the form is an integral: no text for shaders, and x are doubles
//
// Directions enter by cosines and sines. Lists of forms end the headers beside this one; approximations/list.h joins
// them.
#pragma once

#include <array>
#include <string_view>

#include "models/scalar.h"

namespace lobefit {

struct FormConstant {
  std::string_view name;
  double initial;  // as published
  double lower, upper;
  std::string_view doc = "";
};

template <class F>
inline constexpr bool is_quadrature = requires {
  F::quadrature;
};

}  // namespace lobefit
