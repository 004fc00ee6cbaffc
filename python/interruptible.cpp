#include "python/interruptible.h"

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "models/error.h"

namespace lobefit::python {

namespace {

class CallerMonitor : public Monitor {
 public:
  void begin(std::string_view what, std::uint64_t steps, std::uint64_t done) override {
    const std::lock_guard lock(mutex_);
    what_ = what;
    steps_ = steps;
    done_ = done;
  }
  void advance(std::uint64_t steps) override {
    const std::lock_guard lock(mutex_);
    done_ += steps;
  }
  void check() override {
    if (stopped_) throw Interrupted();
  }

  void stop() { stopped_ = true; }
  double fraction() {
    const std::lock_guard lock(mutex_);
    return steps_ == 0 ? 0.0 : static_cast<double>(done_) / static_cast<double>(steps_);
  }
  std::string what() {
    const std::lock_guard lock(mutex_);
    return what_;
  }

 private:
  std::atomic<bool> stopped_{false};
  std::mutex mutex_;
  std::string what_;
  std::uint64_t steps_ = 0, done_ = 0;
};

/// Work that a thread does, and its end.
class Worker {
 public:
  explicit Worker(const std::function<void()>& work)
      : thread_([this, &work] {
          try {
            work();
          } catch (...) {
            failure_ = std::current_exception();
          }
          const std::lock_guard lock(mutex_);
          finished_ = true;
          changed_.notify_one();
        }) {}
  ~Worker() { thread_.join(); }

  bool finished_within(std::chrono::milliseconds time) {
    std::unique_lock lock(mutex_);
    return changed_.wait_for(lock, time, [this] { return finished_; });
  }
  /// Once it has finished.
  void rethrow() const {
    if (failure_) std::rethrow_exception(failure_);
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  bool finished_ = false;
  std::exception_ptr failure_;
  std::thread thread_;  // last: it uses the others
};

}  // namespace

void run_interruptibly(const py::object& progress, const std::function<void(Monitor&)>& work) {
  CallerMonitor monitor;
  std::optional<py::error_already_set> raised;
  bool declined = false;
  const auto ask = [&] {
    if (PyErr_CheckSignals() != 0) throw py::error_already_set();
    if (!progress.is_none()) declined = progress(monitor.fraction(), monitor.what()).is(py::bool_(false));
  };
  {
    const std::function<void()> bound = [&] { work(monitor); };
    Worker worker(bound);
    const auto finished = [&] {
      const py::gil_scoped_release released;
      return worker.finished_within(std::chrono::milliseconds(100));
    };
    while (!finished()) {
      if (raised || declined) continue;
      try {
        ask();
      } catch (py::error_already_set& error) {
        raised.emplace(std::move(error));
      }
      if (raised || declined) monitor.stop();
    }
    if (!raised && !declined) worker.rethrow();
  }
  if (raised) throw std::move(*raised);
  if (declined) throw Interrupted();
  if (!progress.is_none()) progress(1.0, monitor.what());
}

}  // namespace lobefit::python
