// What results of closed forms say for people: of a line of result.json, wherever it is shown.
#pragma once

#include <string>

#include "reference/json_reader.h"

namespace lobefit {

/// "longitudinal, width = 0.5"
std::string form_line_title(const JsonReader& line);
/// Of the line's files: "longitudinal.width_0.5".
std::string form_line_stem(const JsonReader& line);
/// A refitted constant with its interval; in parentheses if it was held.
std::string form_constant_text(const JsonReader& constant);
/// rms or max, "published" or "refit" or a rival's, in the line's own metric.
std::string form_error_text(const JsonReader& line, std::string_view norm, std::string_view which);
/// By what the published constants are optimal, as the recipe's readings go; "" where nothing was read.
std::string form_verdict(const JsonReader& line);
/// The axes of the domain: "cos_theta_d 0 … 89° (90)".
std::string form_domain_text(const JsonReader& line);

}  // namespace lobefit
