// NumPy arrays and parameters on their way into the library. What is wrong with shapes is told in Python (lobefit/
// arrays.py); here numbers are looked at.
#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <nlohmann/json.hpp>
#include <span>
#include <string>

#include "models/geometry.h"
#include "models/parameter.h"

namespace lobefit::python {

namespace py = pybind11;

/// A view of (n, 3) directions, float or double, any strides; the array must outlive it.
class Directions {
 public:
  Directions(const py::array& array, std::string name);

  std::size_t size() const { return size_; }
  /// Directions first, …, as many as `out`. Throws Error(usage) for one that is not a unit vector.
  void read(std::size_t first, std::span<Direction> out) const;
  /// The same rounded to float, one array per component.
  void read(std::size_t first, std::span<float> x, std::span<float> y, std::span<float> z) const;

 private:
  template <class Store>
  void read_all(std::size_t first, std::size_t n, Store&& store) const;
  template <class Number, class Store>
  bool read_as(const char* row, std::size_t n, Store&& store) const;
  /// Null where rows are of another type or lie apart.
  template <class Number>
  const Number* close_rows(std::size_t first) const;
  [[noreturn]] void refuse(std::size_t first, std::size_t n) const;

  std::string name_;
  const char* data_;
  std::size_t size_;
  std::ptrdiff_t row_, column_;  // bytes
  bool single_;
};

/// (n, 3) numbers from n of each channel.
void join_channels(std::span<const float> r, std::span<const float> g, std::span<const float> b, float* out);

/// "0.5", "0.1,0.2,0.3" or a choice, as the command line has them.
std::string setting_text(const py::handle& value);
/// A whole number from 0 on; throws Error(usage).
std::uint64_t counting_number(const py::handle& value, const std::string& name);
/// Sets those of a dict; throws Error(usage).
void set_parameters(ParameterValues& values, const py::dict& parameters);

/// Python's dict or list of a document.
py::object to_python(const nlohmann::ordered_json& json);

}  // namespace lobefit::python
