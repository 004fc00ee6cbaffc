// What report/page/ holds, compiled in.
#pragma once

#include <string_view>

namespace lobefit {

struct HtmlPage {
  std::string_view text, style, script;
};

extern const HtmlPage html_page;

}  // namespace lobefit
