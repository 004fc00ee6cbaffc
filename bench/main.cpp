// lobefit_bench: runs every benchmark, then prints what each evaluates per second and how many times its baseline
// that is. Google Benchmark's flags apply (--benchmark_filter=REGEX, --benchmark_out=FILE.json, …).
#include <benchmark/benchmark.h>
#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <string>
#include <vector>

#include "bench/benchmarks.h"

namespace lobefit {

namespace {

/// Keeps the best repetition of each benchmark: other work on the machine only ever slows one down.
class RatioTable : public benchmark::BenchmarkReporter {
 public:
  bool ReportContext(const Context& context) override {
    PrintBasicContext(&GetErrorStream(), context);
    return true;
  }

  void ReportRuns(const std::vector<Run>& runs) override {
    for (const Run& run : runs) {
      if (run.run_type != Run::RT_Iteration) continue;
      // Repetitions arrive in random order; rows stand in the order of registration.
      Row& row = rows_[run.family_index];
      row.name = run.run_name.function_name;
      row.baseline = run.report_label;
      row.rate = std::max(row.rate, run.counters.at("items_per_second").value);
    }
  }

  void Finalize() override {
    fmt::print("{:<30} {:>16} {:>8}  {}\n", "benchmark", "M evaluations/s", "ratio", "baseline");
    std::map<std::string, double> rates;
    for (const auto& [_, row] : rows_) rates[row.name] = row.rate;
    for (const auto& [_, row] : rows_) {
      const auto baseline = rates.find(row.baseline);
      const std::string ratio = baseline == rates.end() ? "" : fmt::format("{:.2f}", row.rate / baseline->second);
      fmt::print("{:<30} {:>16.4g} {:>8}  {}\n", row.name, row.rate * 1e-6, ratio, row.baseline);
    }
  }

 private:
  struct Row {
    std::string name, baseline;
    double rate = 0.0;  // evaluations per second of CPU time
  };
  std::map<std::int64_t, Row> rows_;
};

}  // namespace

}  // namespace lobefit

int main(int argc, char** argv) {
  // Short repetitions in random order meet the same disturbances; flags of the command line come later and win.
  std::vector<std::string> defaults{"--benchmark_repetitions=5", "--benchmark_min_time=0.05",
                                    "--benchmark_enable_random_interleaving=true"};
  std::vector<char*> arguments{argv[0]};
  for (std::string& flag : defaults) arguments.push_back(flag.data());
  arguments.insert(arguments.end(), argv + 1, argv + argc);
  int count = static_cast<int>(arguments.size());
  arguments.push_back(nullptr);
  benchmark::Initialize(&count, arguments.data());
  if (benchmark::ReportUnrecognizedArguments(count, arguments.data())) return 2;

  lobefit::register_model_batches();
  lobefit::register_instruction_sets();
  lobefit::register_integrator();
  lobefit::register_material_fit();
  lobefit::RatioTable table;
  benchmark::RunSpecifiedBenchmarks(&table);
  benchmark::Shutdown();
}
