// How long work tells how far it is, and learns that it should stop.
#pragma once

#include <cstdint>
#include <string_view>

namespace lobefit {

/// Called from worker threads; the base class is silent and never stops.
class Monitor {
 public:
  virtual ~Monitor() = default;
  /// `done` of the steps were made in earlier runs.
  virtual void begin(std::string_view /*what*/, std::uint64_t /*steps*/, std::uint64_t /*done*/ = 0) {}
  virtual void advance(std::uint64_t /*steps*/) {}
  virtual void end() {}
  /// Throws Interrupted if the user asked to stop.
  virtual void check() {}
};

}  // namespace lobefit
