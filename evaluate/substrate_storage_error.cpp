#include "evaluate/substrate_storage_error.h"

#include <algorithm>
#include <cmath>

#include "evaluate/storage_code.h"
#include "models/model.h"

namespace lobefit {

namespace {

/// A basis's own axes: x, y, z in the frame that it is given in.
struct Axes {
  Direction x, y, z;

  explicit Axes(const TangentBasis& basis)
      : x(normalize(basis.tangent - basis.normal * dot(basis.normal, basis.tangent) / dot(basis.normal, basis.normal))),
        y(cross(normalize(basis.normal), x)),
        z(normalize(basis.normal)) {}

  Direction from_local(const Direction& w) const { return x * w.x + y * w.y + z * w.z; }
  Direction to_local(const Direction& w) const { return {dot(x, w), dot(y, w), dot(z, w)}; }
};

/// An isotropic closure's tangent may lie along its normal.
TangentBasis usable(const TangentBasis& basis) {
  const Direction side = cross(normalize(basis.normal), basis.tangent);
  if (dot(side, side) > 1e-12) return basis;
  return {basis.normal, std::abs(basis.normal.x) < 0.7 ? Direction{1.0, 0.0, 0.0} : Direction{0.0, 1.0, 0.0}};
}

Direction turned(const Direction& w, double angle) {
  return {w.x * std::cos(angle) - w.y * std::sin(angle), w.x * std::sin(angle) + w.y * std::cos(angle), w.z};
}

double above(double coverage, double transmittance, double cosine) {
  return 1.0 - coverage + coverage * std::pow(transmittance, 1.0 / cosine);
}

std::vector<float> render(std::span<const StoredClosure> closures, const TangentBasis& frame, const Table& table,
                          double turn) {
  std::vector<float> values(table.values.size());
  for (std::size_t entry = 0; entry < table.entries(); ++entry) {
    if (!table.valid[entry]) continue;
    const Rgb f = closures_brdf(closures, frame, turned(table.wi(entry), turn), turned(table.wo(entry), turn));
    values[entry] = static_cast<float>(f.x);
    values[table.entries() + entry] = static_cast<float>(f.y);
    values[2 * table.entries() + entry] = static_cast<float>(f.z);
  }
  return values;
}

/// Whether two closures' directions do the same: an isotropic one has no use for its tangent.
bool same_directions(const StoredClosure& a, const StoredClosure& b) {
  const auto equal = [](const Direction& p, const Direction& q) { return p.x == q.x && p.y == q.y && p.z == q.z; };
  return equal(a.basis.normal, b.basis.normal) &&
         (equal(a.basis.tangent, b.basis.tangent) || (a.slab.anisotropy == 0.0 && b.slab.anisotropy == 0.0));
}

/// The given material at the directions of a table, to hold others against.
class Comparison {
 public:
  Comparison(std::span<const StoredClosure> given, const Table& table, const std::vector<double>& weights)
      : frame_(given[0].basis), weights_(weights) {
    const bool turns = std::ranges::any_of(given, [&](const StoredClosure& closure) {
      return closure.slab.anisotropy != 0.0 || !same_directions(closure, given[0]);
    });
    for (int k = 0; k < (turns ? 4 : 1); ++k) {
      const double turn = radians(45.0 * k);
      truth_.push_back({turn, table.with_values("closures", render(given, frame_, table, turn))});
    }
  }

  QuantityErrors errors(std::span<const StoredClosure> other) const {
    QuantityErrors squares{};
    for (const auto& [turn, table] : truth_) {
      const QuantityErrors rms = rms_differences(table, render(other, frame_, table, turn), weights_);
      for (std::size_t q = 0; q < rms.size(); ++q) squares[q] += square(rms[q]) / static_cast<double>(truth_.size());
    }
    for (double& each : squares) each = std::sqrt(each);
    return squares;
  }

 private:
  TangentBasis frame_;
  const std::vector<double>& weights_;
  std::vector<std::pair<double, Table>> truth_;
};

}  // namespace

QuantisationError quantisation_error(const StorageField& field, int component) {
  const StorageCode code(field, component);
  // Rounding to the nearest end of a step s errs by s²/12 in the mean square; the dithered one by s²/6, the mean of
  // t (1 - t) s² over places t between the ends.
  if (field.encoding == StorageEncoding::ratio) {
    const double step = std::pow(field.upper / field.lower, 1.0 / (code.last() - 1.0)) - 1.0;
    return {step, step / std::sqrt(12.0), step / std::sqrt(6.0), true};
  }
  double worst = 0.0, cubes = 0.0;
  if (field.encoding == StorageEncoding::square || field.encoding == StorageEncoding::srgb) {
    for (std::uint32_t k = 0; k < code.last(); ++k) {
      const double step = code.value(k + 1) - code.value(k);
      worst = std::max(worst, step);
      cubes += step * step * step;
    }
  } else {
    worst = (code.value(code.last()) - code.value(0)) / code.last();
    cubes = square(worst) * (field.upper - field.lower);
  }
  const double range = code.value(code.last()) - code.value(0);
  return {worst, std::sqrt(cubes / (12.0 * range)), std::sqrt(cubes / (6.0 * range)), false};
}

Rgb closures_brdf(std::span<const StoredClosure> closures, const TangentBasis& frame, const Direction& wi,
                  const Direction& wo) {
  const Axes axes(usable(frame));
  const Direction light = axes.from_local(wi), view = axes.from_local(wo);
  Rgb sum{};
  for (const StoredClosure& closure : closures) {
    const Axes own(usable(closure.basis));
    const Direction i = own.to_local(light), o = own.to_local(view);
    if (i.z <= 0.0 || o.z <= 0.0 || wi.z <= 0.0) continue;
    const double c = closure.coverage_above;
    const Rgb& t = closure.transmittance_above;
    const Rgb dimmed{above(c, t.x, i.z), above(c, t.y, i.z), above(c, t.z, i.z)};
    sum = sum + closure.throughput * dimmed * evaluate_brdf<Slab>(closure.slab, i, o) * (i.z / wi.z);
  }
  return sum;
}

SubstrateStorageError substrate_storage_error(std::span<const StoredClosure> given, std::span<const StoredClosure> read,
                                              const Table& table, const std::vector<double>& weights) {
  if (given.size() != read.size() || given.empty()) {
    throw Error(ExitCode::usage, "materials of different numbers of closures", "storage error",
                "compare what was packed with what was unpacked of it");
  }
  const Comparison comparison(given, table, weights);
  SubstrateStorageError error{.total = comparison.errors(read)};
  std::vector<StoredClosure> one(given.begin(), given.end());
  for (std::size_t k = 0; k < given.size(); ++k) {
    const auto measure = [&](std::string_view field) {
      error.alone.push_back({k, std::string(field), comparison.errors(one)[static_cast<std::size_t>(Quantity::log)]});
      one[k] = given[k];
    };
    for (const StorageField& field : storage_fields) {
      const std::vector<double> numbers = stored_numbers(read[k], field);
      if (numbers.empty() || numbers == stored_numbers(given[k], field)) continue;
      set_stored_numbers(one[k], field, numbers);
      measure(field.name);
    }
    if (!same_directions(given[k], read[k])) {
      one[k].basis = read[k].basis;
      measure("tangent_basis");
    }
  }
  std::ranges::stable_sort(error.alone, std::ranges::greater{}, &StoredFieldError::rms);
  return error;
}

}  // namespace lobefit
