#pragma once

#include <string>

#include "report/metrics_report.h"

namespace lobefit {

/// A metrics report for people.
std::string metrics_text(const MetricsReport& report);

}  // namespace lobefit
