// Tables in model texts: one interface for all scalars.
//
//   struct MyTable {                                         // entries at equal steps of u and v over [0, 1]
//     static constexpr const char* name = "my_table";        // of the shader's function and array
//     static constexpr int columns = 16, rows = 12;          // along u, along v
//     static constexpr std::array<float, (columns + 2) * (rows + 2)> entries{…};   // row by row
//   };
//   const T value = lookup<MyTable>(u, v);                   // u, v clamped to [0, 1]
//
// A table of one row is read as lookup<MyTable>(u), and has columns + 2 entries. Catmull-Rom splines between the
// entries: continuous slopes, which fits over the table's own coordinates need. The outermost entries lie one step
// outside [0, 1] and continue the table there, so that a read knows no borders.
//
// A scalar takes part by floor(x) and to_index(x) for x ≥ 0, both flat; Expression by TracedEntry instead. In float, a
// loop over reads is still SIMD code; in a shader the table is a constant array.
#pragma once

#include <cstdint>

#include "models/scalar.h"

namespace lobefit {

LOBEFIT_TEXT double floor(double x) { return std::floor(x); }
LOBEFIT_TEXT constexpr std::int32_t to_index(double x) { return static_cast<std::int32_t>(x); }

/// How Expression reads a table; defined in evaluate/expression.h.
template <class Table>
struct TracedEntry;

/// The entry whose number is the whole number `index`.
template <class Table, class T>
LOBEFIT_TEXT auto table_entry(const T& index) {
  if constexpr (is_traced<T>) {
    return TracedEntry<Table>::trace(index);
  } else {
    return T(Table::entries[static_cast<std::size_t>(to_index(index))]);
  }
}

/// Through b at s = 0 and c at s = 1, with the slopes (c - a)/2 and (d - b)/2 there.
struct CatmullRom {
  static constexpr const char* name = "catmull_rom";
  static constexpr std::array arguments{"a", "b", "c", "d", "s"};

  template <class T>
  LOBEFIT_TEXT static T evaluate(const T& a, const T& b, const T& c, const T& d, const T& s) {
    return b + 0.5 * s * (c - a + s * (2.0 * a - 5.0 * b + 4.0 * c - d + s * (3.0 * (b - c) + d - a)));
  }
};

template <class Table>
struct LineLookup {
  static constexpr const char* name = Table::name;
  static constexpr std::array arguments{"u"};

  template <class T>
  LOBEFIT_TEXT static T evaluate(const T& u) {
    const T x = let("x", (Table::columns - 1.0) * saturate(u));
    const T column = let("column", min(floor(x), Table::columns - 2.0));
    return call<CatmullRom>(table_entry<Table>(column), table_entry<Table>(column + 1.0),
                            table_entry<Table>(column + 2.0), table_entry<Table>(column + 3.0), x - column);
  }
};

template <class Table>
struct PlaneLookup {
  static constexpr const char* name = Table::name;
  static constexpr std::array arguments{"u", "v"};

  template <class T>
  LOBEFIT_TEXT static T evaluate(const T& u, const T& v) {
    const T x = let("x", (Table::columns - 1.0) * saturate(u));
    const T column = let("column", min(floor(x), Table::columns - 2.0));
    const T s = let("s", x - column);
    const T y = let("y", (Table::rows - 1.0) * saturate(v));
    const T row = let("row", min(floor(y), Table::rows - 2.0));
    constexpr double stride = Table::columns + 2.0;
    const T first = let("first", row * stride + column);
    const auto along = [&](const T& begin) {
      return call<CatmullRom>(table_entry<Table>(begin), table_entry<Table>(begin + 1.0),
                              table_entry<Table>(begin + 2.0), table_entry<Table>(begin + 3.0), s);
    };
    const T a = let("a", along(first));
    const T b = let("b", along(let("second", first + stride)));
    const T c = let("c", along(let("third", first + 2.0 * stride)));
    const T d = let("d", along(let("fourth", first + 3.0 * stride)));
    return call<CatmullRom>(a, b, c, d, y - row);
  }
};

template <class Table, class T>
LOBEFIT_TEXT T lookup(const T& u) {
  return call<LineLookup<Table>>(u);
}
template <class Table, class T>
LOBEFIT_TEXT T lookup(const T& u, const T& v) {
  return call<PlaneLookup<Table>>(u, v);
}

}  // namespace lobefit
