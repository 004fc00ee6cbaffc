// Options of everything that integrates.
#pragma once

#include <fmt/format.h>

#include "cli/arguments.h"

namespace lobefit {

struct SamplingArguments {
  SamplingOptions options;
  bool exact = false;
  std::string sampler = "sobol";
  CLI::Option* stderr_option = nullptr;

  void add_to(CLI::App& verb, const char* per_what) {
    auto* samples = verb.add_option("--samples", options.samples, std::string("Samples ") + per_what)
                        ->check(CLI::Range(std::uint64_t{replicate_count}, most_samples))
                        ->capture_default_str();
    stderr_option = verb.add_option("--stderr", options.stderr_target,
                                    "Instead: double the samples until no standard error of f (1/sr) is larger");
    auto* quadrature = verb.add_flag("--exact", exact, "Instead: by quadrature");
    verb.add_option("--sampler", sampler, "Owen-scrambled sobol points, or philox random numbers")
        ->check(CLI::IsMember({"sobol", "philox"}))
        ->capture_default_str();
    samples->excludes(stderr_option)->excludes(quadrature);
    stderr_option->excludes(quadrature);
  }

  SamplingOptions checked(std::uint64_t seed) const {
    SamplingOptions result = options;
    result.seed = seed;
    result.sampler = sampler == "sobol" ? Sampler::sobol : Sampler::philox;
    if (stderr_option->count() > 0) {
      if (!(result.stderr_target > 0.0 && std::isfinite(result.stderr_target))) {
        throw Error(ExitCode::usage, "the target must be a positive number", "--stderr", "choose one such as 1e-4");
      }
      result.samples = 1u << 10;
    }
    return result;
  }
};

inline void warn_above_target(const Context& context, const Estimate& estimate, double target) {
  const double worst = max(estimate.stderr_f.x, max(estimate.stderr_f.y, estimate.stderr_f.z));
  if (worst > target) {
    context.say(fmt::format("warning: stopped at {} samples with a standard error of {:.2e}, above the target",
                            estimate.samples, worst));
  }
}

/// Entries whose results were no finite numbers: never silent.
inline void warn_about_failed(const Context& context, const Table& table) {
  const std::vector<std::size_t> failed = table.failed();
  if (failed.empty()) return;
  context.say(fmt::format("warning: {} of {} entries {} not finite and masked; the first is at {}", failed.size(),
                          table.entries(), failed.size() == 1 ? "is" : "are", table.place(failed.front())));
}

}  // namespace lobefit
