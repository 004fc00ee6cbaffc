#include "python/arrays.h"

#include <algorithm>
#include <cmath>

#include "models/error.h"
#include "models/instruction_sets.h"

namespace lobefit::python {

Directions::Directions(const py::array& array, std::string name)
    : name_(std::move(name)),
      data_(static_cast<const char*>(array.data())),
      size_(static_cast<std::size_t>(array.shape(0))),
      row_(array.strides(0)),
      column_(array.strides(1)),
      single_(array.itemsize() == sizeof(float)) {}

namespace {

constexpr float tolerance = 1e-5f;  // of a length's square: unit vectors in float pass

template <class Number>
bool is_unit(Number x, Number y, Number z) {
  return std::abs(x * x + y * y + z * z - Number(1)) <= Number(tolerance);  // NaN is not
}

// Of rows that lie close together. Both return whether all of them are unit vectors.

template <class Number>
LOBEFIT_CLONES [[gnu::noinline]] bool are_unit(const Number* rows, std::size_t n) {
  int bad = 0;
#pragma GCC ivdep
  for (std::size_t i = 0; i < n; ++i) bad |= is_unit(rows[3 * i], rows[3 * i + 1], rows[3 * i + 2]) ? 0 : 1;
  return bad == 0;
}

template <class Number>
LOBEFIT_CLONES [[gnu::noinline]] bool split(const Number* __restrict rows, std::size_t n, float* __restrict x,
                                            float* __restrict y, float* __restrict z) {
  int bad = 0;
#pragma GCC ivdep
  for (std::size_t i = 0; i < n; ++i) {
    x[i] = static_cast<float>(rows[3 * i]);
    y[i] = static_cast<float>(rows[3 * i + 1]);
    z[i] = static_cast<float>(rows[3 * i + 2]);
    bad |= is_unit(rows[3 * i], rows[3 * i + 1], rows[3 * i + 2]) ? 0 : 1;
  }
  return bad == 0;
}

LOBEFIT_CLONES [[gnu::noinline]] void join_floats(const float* __restrict r, const float* __restrict g,
                                                  const float* __restrict b, std::size_t n, float* __restrict out) {
#pragma GCC ivdep
  for (std::size_t i = 0; i < n; ++i) {
    out[3 * i] = r[i];
    out[3 * i + 1] = g[i];
    out[3 * i + 2] = b[i];
  }
}

}  // namespace

template <class Number, class Store>
bool Directions::read_as(const char* row, std::size_t n, Store&& store) const {
  bool good = true;
  for (std::size_t i = 0; i < n; ++i, row += row_) {
    Number w[3];
    for (int c = 0; c < 3; ++c) std::memcpy(&w[c], row + c * column_, sizeof(Number));
    good = is_unit(w[0], w[1], w[2]) && good;
    store(i, w);
  }
  return good;
}

template <class Store>
void Directions::read_all(std::size_t first, std::size_t n, Store&& store) const {
  const char* row = data_ + static_cast<std::ptrdiff_t>(first) * row_;
  if (!(single_ ? read_as<float>(row, n, store) : read_as<double>(row, n, store))) refuse(first, n);
}

template <class Number>
const Number* Directions::close_rows(std::size_t first) const {
  const char* row = data_ + static_cast<std::ptrdiff_t>(first) * row_;
  const bool close = single_ == std::is_same_v<Number, float> && row_ == 3 * sizeof(Number) &&
                     column_ == sizeof(Number) && reinterpret_cast<std::uintptr_t>(row) % alignof(Number) == 0;
  return close ? reinterpret_cast<const Number*>(row) : nullptr;
}

void Directions::read(std::size_t first, std::span<Direction> out) const {
  if (const double* rows = close_rows<double>(first)) {
    if (!are_unit(rows, out.size())) refuse(first, out.size());
    static_assert(sizeof(Direction) == 3 * sizeof(double));
    std::memcpy(static_cast<void*>(out.data()), rows, out.size_bytes());
    return;
  }
  read_all(first, out.size(), [&](std::size_t i, const auto* w) { out[i] = {w[0], w[1], w[2]}; });
}

void Directions::read(std::size_t first, std::span<float> x, std::span<float> y, std::span<float> z) const {
  const float* floats = close_rows<float>(first);
  const double* doubles = close_rows<double>(first);
  if (floats != nullptr || doubles != nullptr) {
    const bool good = floats != nullptr ? split(floats, x.size(), x.data(), y.data(), z.data())
                                        : split(doubles, x.size(), x.data(), y.data(), z.data());
    if (!good) refuse(first, x.size());
    return;
  }
  read_all(first, x.size(), [&](std::size_t i, const auto* w) {
    x[i] = static_cast<float>(w[0]);
    y[i] = static_cast<float>(w[1]);
    z[i] = static_cast<float>(w[2]);
  });
}

void Directions::refuse(std::size_t first, std::size_t n) const {
  const char* row = data_ + static_cast<std::ptrdiff_t>(first) * row_;
  for (std::size_t i = 0; i < n; ++i, row += row_) {
    double found[3];
    const auto one = [&](std::size_t, const auto* w) { std::copy_n(w, 3, found); };
    if (single_ ? read_as<float>(row, 1, one) : read_as<double>(row, 1, one)) continue;
    throw Error(ExitCode::usage,
                "(" + number_text(found[0]) + ", " + number_text(found[1]) + ", " + number_text(found[2]) +
                    ") is not a unit vector",
                name_ + ", direction " + std::to_string(first + i),
                "normalise it, or make directions of angles by lobefit.directions(theta, phi)");
  }
  throw Error(ExitCode::failure, "directions changed while they were read", name_, "evaluate a copy");
}

void join_channels(std::span<const float> r, std::span<const float> g, std::span<const float> b, float* out) {
  join_floats(r.data(), g.data(), b.data(), r.size(), out);
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

std::uint64_t counting_number(const py::handle& value, const std::string& name) {
  // What NumPy calls an integer has __index__ too.
  const auto index = py::reinterpret_steal<py::object>(PyNumber_Index(value.ptr()));
  const unsigned long long number = index ? PyLong_AsUnsignedLongLong(index.ptr()) : 0;
  if (PyErr_Occurred() == nullptr) return number;
  PyErr_Clear();
  throw Error(ExitCode::usage, "'" + py::repr(value).cast<std::string>() + "' is no whole number from 0 on", name, "");
}

void set_parameters(ParameterValues& values, const py::dict& parameters) {
  for (const auto& [name, value] : parameters) values.set_text(py::str(name).cast<std::string>(), setting_text(value));
}

py::object to_python(const nlohmann::ordered_json& json) {
  return py::module_::import("json").attr("loads")(json.dump());
}

}  // namespace lobefit::python
