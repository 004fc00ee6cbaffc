#include "fit/forms.h"

#include <fmt/format.h>

#include <algorithm>

#include "fit/dual.h"
#include "models/approximations/list.h"
#include "models/error.h"

namespace lobefit {

namespace {

template <class F>
double evaluate_form(std::span<const double> constants, std::span<const double> arguments, double* derivatives) {
  constexpr std::size_t constant_count = F::constants.size(), argument_count = F::arguments.size();
  if (!derivatives) {
    std::array<double, constant_count> c;
    std::array<double, argument_count> x;
    std::copy_n(constants.begin(), constant_count, c.begin());
    std::copy_n(arguments.begin(), argument_count, x.begin());
    return F::template evaluate<double>(c, x);
  }
  using D = Dual<static_cast<int>(constant_count)>;
  std::array<D, constant_count> c;
  std::array<std::conditional_t<is_quadrature<F>, double, D>, argument_count> x;
  for (std::size_t k = 0; k < constant_count; ++k) c[k] = D::variable(constants[k], static_cast<int>(k));
  for (std::size_t i = 0; i < argument_count; ++i) x[i] = arguments[i];
  const D value = F::template evaluate<D>(c, x);
  std::copy(value.derivative.begin(), value.derivative.end(), derivatives);
  return value.value;
}

template <class F>
Form make_form() {
  return {.name = F::name,
          .title = F::title,
          .formula = F::formula,
          .source = F::source,
          .arguments = {F::arguments.begin(), F::arguments.end()},
          .constants = {F::constants.begin(), F::constants.end()},
          .evaluate = &evaluate_form<F>,
          .has_shader = !is_quadrature<F>};
}

template <class... F>
std::vector<Form> make_forms(std::tuple<F...>*) {
  return {make_form<F>()...};
}

}  // namespace

std::vector<double> Form::published() const {
  std::vector<double> values;
  for (const FormConstant& constant : constants) values.push_back(constant.initial);
  return values;
}

std::size_t Form::constant_index(const std::string& constant) const {
  std::vector<std::string> names;
  for (std::size_t k = 0; k < constants.size(); ++k) {
    if (constants[k].name == constant) return k;
    names.emplace_back(constants[k].name);
  }
  throw Error(ExitCode::usage, fmt::format("{} has no constant '{}'", name, constant), "",
              fmt::format("choose among {}", fmt::join(names, ", ")));
}

const std::vector<Form>& forms() {
  static const std::vector<Form> list = make_forms(static_cast<ApproximationForms*>(nullptr));
  return list;
}

const Form& find_form(const std::string& name) {
  std::vector<std::string> names;
  for (const Form& form : forms()) {
    if (form.name == name) return form;
    names.emplace_back(form.name);
  }
  throw Error(ExitCode::usage, "no form is called '" + name + "'", "",
              fmt::format("did you mean '{}'? There are {}", nearest_name(name, names), fmt::join(names, ", ")));
}

}  // namespace lobefit
