#include "reference/formats/neural_brdf.h"

#include <tbb/parallel_for.h>

#include <algorithm>

#include "models/parameter.h"
#include "reference/formats/byte_reader.h"

namespace lobefit {

bool NeuralBrdf::recognise(std::string_view text) {
  const std::string_view first = text.substr(0, text.find('\n'));
  return first.starts_with("#") && first.find("NBRDF") != std::string_view::npos;
}

std::vector<std::string> NeuralBrdf::materials(std::string_view text) {
  LineReader lines(text, "");
  std::vector<std::string> names;
  while (auto line = lines.next()) {
    if (line->starts_with('#')) continue;
    const std::string_view name = next_word(*line);
    if (!name.empty()) names.emplace_back(name);
  }
  return names;
}

NeuralBrdf NeuralBrdf::parse(std::string_view text, const std::string& material, const std::string& place) {
  const std::vector<std::string> names = materials(text);
  if (names.empty()) {
    throw Error(ExitCode::invalid_input, "no material in the file", place, "fetch the file again");
  }
  if (material.empty() && names.size() > 1) {
    throw Error(ExitCode::usage, "which of the " + std::to_string(names.size()) + " materials?", place,
                "add --material NAME, such as " + names.front());
  }
  if (!material.empty() && std::find(names.begin(), names.end(), material) == names.end()) {
    throw Error(ExitCode::usage, "no material '" + material + "'", place,
                "did you mean '" + nearest_name(material, names) + "'?");
  }
  NeuralBrdf result;
  result.name_ = material.empty() ? names.front() : material;
  LineReader lines(text, place);
  while (auto line = lines.next()) {
    if (line->starts_with('#') || next_word(*line) != result.name_) continue;
    for (std::size_t k = 0; k < weight_count; ++k) {
      const std::string_view word = next_word(*line);
      const auto value = parse_double(word);
      if (word.empty()) {
        throw lines.error("truncated: " + std::to_string(k) + " numbers instead of " + std::to_string(weight_count));
      }
      if (!value || !std::isfinite(*value)) throw lines.error("weight " + std::to_string(k + 1) + " is no number");
      result.weights_[k] = *value;
    }
    if (!next_word(*line).empty()) throw lines.error("more than " + std::to_string(weight_count) + " numbers");
    return result;
  }
  throw lines.error("the material's line is gone");
}

Rgb NeuralBrdf::evaluate(const HalfDifference& angles) const {
  const Direction h = direction(angles.theta_h, 0.0), d = direction(angles.theta_d, angles.phi_d);
  const std::array<double, inputs> x{h.x, h.y, h.z, d.x, d.y, d.z};
  // out = in W + b; the weights of one input lie side by side.
  const auto layer = [](const double* weights, std::size_t in_count, const double* in, std::size_t out_count,
                        double* out) {
    const double* bias = weights + in_count * out_count;
    for (std::size_t j = 0; j < out_count; ++j) out[j] = bias[j];
    for (std::size_t i = 0; i < in_count; ++i) {
      for (std::size_t j = 0; j < out_count; ++j) out[j] += in[i] * weights[i * out_count + j];
    }
    return bias + out_count;
  };
  const auto rectify = [](std::array<double, width>& values) {
    for (double& value : values) value = std::max(value, 0.0);
  };
  std::array<double, width> first, second;
  std::array<double, 3> y;
  const double* weights = layer(weights_.data(), inputs, x.data(), width, first.data());
  rectify(first);
  weights = layer(weights, width, first.data(), width, second.data());
  rectify(second);
  layer(weights, width, second.data(), 3, y.data());
  return {std::max(std::expm1(y[0]), 0.0), std::max(std::expm1(y[1]), 0.0), std::max(std::expm1(y[2]), 0.0)};
}

Merl NeuralBrdf::merl() const {
  Merl result;
  result.values.assign(3 * Merl::bins, -1.0);
  constexpr std::size_t line = Merl::theta_d_bins * Merl::phi_d_bins;
  tbb::parallel_for(std::size_t{0}, Merl::theta_h_bins, [&](std::size_t h) {
    for (std::size_t bin = h * line; bin < (h + 1) * line; ++bin) {
      if (!Merl::above(bin)) continue;
      const Rgb f = evaluate(Merl::centre(bin));
      result.values[bin] = f.x;
      result.values[Merl::bins + bin] = f.y;
      result.values[2 * Merl::bins + bin] = f.z;
    }
  });
  return result;
}

}  // namespace lobefit
