#include "python/arrays.h"

#include <cmath>

#include "models/error.h"

namespace lobefit::python {

Directions::Directions(const py::array& array, std::string name)
    : name_(std::move(name)),
      data_(static_cast<const char*>(array.data())),
      size_(static_cast<std::size_t>(array.shape(0))),
      row_(array.strides(0)),
      column_(array.strides(1)),
      single_(array.itemsize() == sizeof(float)) {}

template <class Number>
void Directions::read_as(std::size_t first, std::span<Direction> out) const {
  const char* row = data_ + static_cast<std::ptrdiff_t>(first) * row_;
  const auto number = [&](std::ptrdiff_t column) {
    Number value;
    std::memcpy(&value, row + column * column_, sizeof(value));
    return static_cast<double>(value);
  };
  double worst = 0.0;
  for (std::size_t i = 0; i < out.size(); ++i, row += row_) {
    out[i] = {number(0), number(1), number(2)};
    const double off = std::abs(dot(out[i], out[i]) - 1.0);
    worst = off <= worst ? worst : off;  // NaN counts
  }
  constexpr double tolerance = 1e-5;  // of a length's square: unit vectors in float pass
  if (worst <= tolerance) return;
  for (std::size_t i = 0; i < out.size(); ++i) {
    if (std::abs(dot(out[i], out[i]) - 1.0) <= tolerance) continue;
    throw Error(ExitCode::usage,
                "(" + std::to_string(out[i].x) + ", " + std::to_string(out[i].y) + ", " + std::to_string(out[i].z) +
                    ") is not a unit vector",
                name_ + ", direction " + std::to_string(first + i),
                "normalise it, or make directions of angles by lobefit.directions(theta, phi)");
  }
}

void Directions::read(std::size_t first, std::span<Direction> out) const {
  if (single_)
    read_as<float>(first, out);
  else
    read_as<double>(first, out);
}

std::string setting_text(const py::handle& value) {
  if (py::isinstance<py::str>(value)) return value.cast<std::string>();
  const auto numbers = py::array_t<double, py::array::c_style | py::array::forcecast>::ensure(value);
  if (!numbers || numbers.ndim() > 1) {
    PyErr_Clear();
    throw Error(ExitCode::usage, "'" + py::repr(value).cast<std::string>() + "' is no parameter's value", "",
                "give a number, three numbers for a colour, or a choice's name");
  }
  std::string text;
  for (py::ssize_t i = 0; i < numbers.size(); ++i) {
    const double number = numbers.data()[i];
    if (!std::isfinite(number))
      throw Error(ExitCode::usage, "a parameter's value is not finite", "", "give finite numbers");
    text += (i > 0 ? "," : "") + number_text(number);
  }
  return text;
}

void set_parameters(ParameterValues& values, const py::dict& parameters) {
  for (const auto& [name, value] : parameters) values.set_text(py::str(name).cast<std::string>(), setting_text(value));
}

py::object to_python(const nlohmann::ordered_json& json) {
  return py::module_::import("json").attr("loads")(json.dump());
}

}  // namespace lobefit::python
