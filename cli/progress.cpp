// Progress on stderr, and Ctrl-C.
#include <fmt/format.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <csignal>
#include <mutex>

#include "cli/arguments.h"
#include "cli/interrupt.h"

namespace lobefit {

namespace {

std::atomic<bool> interrupt_requested{false};
static_assert(std::atomic<bool>::is_always_lock_free);

using Clock = std::chrono::steady_clock;

class TerminalMonitor : public Monitor {
 public:
  TerminalMonitor(bool shown, bool terminal) : shown_(shown), terminal_(terminal) {}
  ~TerminalMonitor() override { clear(); }

  void begin(std::string_view what, std::uint64_t steps, std::uint64_t done) override {
    const std::lock_guard lock(mutex_);
    what_ = what;
    steps_ = steps;
    done_ = resumed_ = done;
    start_ = last_ = Clock::now();
  }

  void advance(std::uint64_t steps) override {
    const std::lock_guard lock(mutex_);
    done_ += steps;
    const Clock::time_point now = Clock::now();
    // Short work passes in silence; a log needs fewer lines than a terminal.
    const auto pause = terminal_ ? std::chrono::milliseconds(200) : std::chrono::milliseconds(1000);
    if (!shown_ || now - last_ < pause || steps_ == 0) return;
    last_ = now;
    const double elapsed = std::chrono::duration<double>(now - start_).count();
    // What earlier runs did took none of this run's time.
    const double rate = static_cast<double>(done_ - resumed_) / elapsed;
    const auto left = static_cast<std::int64_t>(std::ceil(static_cast<double>(steps_ - done_) / rate));
    const std::string hours =
        left >= 3600 ? fmt::format("{}:{:02}", left / 3600, left / 60 % 60) : fmt::format("{}", left / 60);
    fmt::print(stderr, "{}{}: {:3.0f} %, {}:{:02} left{}", terminal_ ? "\r" : "", what_,
               100.0 * static_cast<double>(done_) / static_cast<double>(steps_), hours, left % 60,
               terminal_ ? "\033[K" : "\n");
    std::fflush(stderr);
    drawn_ = terminal_;
  }

  void end() override {
    const std::lock_guard lock(mutex_);
    clear();
  }

  void check() override {
    if (interrupt_requested) throw Interrupted();
  }

 private:
  void clear() {
    if (drawn_) fmt::print(stderr, "\r\033[K");
    drawn_ = false;
  }

  std::mutex mutex_;
  std::string what_;
  std::uint64_t steps_ = 0, done_ = 0, resumed_ = 0;
  Clock::time_point start_, last_;
  bool shown_, terminal_, drawn_ = false;
};

}  // namespace

void catch_interrupts() {
  struct sigaction action = {};
  action.sa_handler = [](int) { interrupt_requested = true; };
  // A second Ctrl-C ends the program at once, whatever it is doing.
  action.sa_flags = static_cast<int>(SA_RESETHAND);
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
}

std::unique_ptr<Monitor> Context::monitor() const {
  const bool terminal = isatty(STDERR_FILENO) != 0;
  return std::make_unique<TerminalMonitor>(!quiet && (terminal || progress), terminal);
}

void Context::say(const std::string& message) const {
  if (!quiet) fmt::print(stderr, "lobefit: {}\n", message);
}

}  // namespace lobefit
