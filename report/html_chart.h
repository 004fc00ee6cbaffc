// Static parts of a page that are drawn from numbers: charts and shaded matrices.
#pragma once

#include <string>

#include "report/html_report.h"

namespace lobefit {

/// A figure whose SVG takes the page's colours; "" where no line has a point that can be drawn.
std::string chart_html(const HtmlChart& chart);

/// A table whose cells are shaded by size and sign.
std::string matrix_html(const HtmlMatrix& matrix);

}  // namespace lobefit
