// How far closed forms of rough diffuse surfaces are from facets under Smith masking, with one bounce and with all.
#pragma once

#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "fit/rival.h"

namespace lobefit {

inline constexpr std::array<std::string_view, 2> diffuse_reference_names{"one bounce", "all bounces"};

struct DiffuseErrorOptions {
  std::vector<double> alphas = {0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.45, 0.5,
                                0.55, 0.6, 0.65, 0.7, 0.75, 0.8, 0.85, 0.9, 0.95, 1.0};
  std::uint64_t samples = 1u << 15;  // of the reference of all bounces; that of one bounce is exact
  std::uint64_t seed = 1;
};

/// A form and its rms of π (f - f_ref) cos theta_i at albedo 1, a plain mean over alpha and the default grid, against
/// diffuse_reference_names. Against one bounce a form goes without its own term for further ones.
struct DiffuseError {
  std::string label, model;
  std::string note;  // what was fitted or mapped
  std::array<double, 2> rms;
};

/// Every form that the comparison names, Lambert, Burley, Hammon, Chan, Oren-Nayar, EON,
/// Proxima as published and refitted, Callisto's c1 on Lambert fitted per alpha.
std::vector<DiffuseError> diffuse_errors(const DiffuseErrorOptions& options, Monitor& monitor);

}  // namespace lobefit
