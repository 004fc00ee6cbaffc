// The steps of a step.
#pragma once

#include "reference/monitor.h"

namespace lobefit {

/// Tells nothing of what goes on inside one step of another monitor's, but stops when that one does.
class QuietMonitor : public Monitor {
 public:
  explicit QuietMonitor(Monitor& outer) : outer_(outer) {}
  void check() override { outer_.check(); }

 private:
  Monitor& outer_;
};

}  // namespace lobefit
