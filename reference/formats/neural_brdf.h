// Neural-BRDF weights (Sztrajman et al. 2021) as text: a small network per material, evaluated into a MERL table.
//
// Lines of a name and 675 numbers: W1[6][21], b1[21], W2[21][21], b2[21], W3[21][3], b3[3]. With x the half vector at
// azimuth 0 and the difference vector, linear RGB in 1/sr is max(exp(relu(relu(x W1 + b1) W2 + b2) W3 + b3) - 1, 0).
#pragma once

#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "reference/formats/merl.h"

namespace lobefit {

class NeuralBrdf {
 public:
  /// Whether a text is such a file.
  static bool recognise(std::string_view text);
  static std::vector<std::string> materials(std::string_view text);
  /// `material` may be empty if the file has one. Throws Error(usage) for a name it lacks, Error(invalid_input) for a
  /// broken line.
  static NeuralBrdf parse(std::string_view text, const std::string& material, const std::string& place);

  Rgb evaluate(const HalfDifference& angles) const;
  /// All bins with light and view above the surface at the bin's centre; the network says nothing of the others.
  Merl merl() const;
  const std::string& name() const { return name_; }

 private:
  static constexpr std::size_t inputs = 6, width = 21, weight_count = 675;

  std::string name_;
  std::array<double, weight_count> weights_;
};

}  // namespace lobefit
