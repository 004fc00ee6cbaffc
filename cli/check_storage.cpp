#include "cli/check_storage.h"

#include <fmt/format.h>

#include <iostream>

#include "evaluate/parameter_storage.h"

namespace lobefit {

namespace {

Json rms_json(const QuantityErrors& rms) {
  Json json = Json::object();
  for (std::size_t q = 0; q < rms.size(); ++q) json[std::string(quantity_names[q])] = rms[q];
  return json;
}

double log_rms(const QuantityErrors& rms) { return rms[static_cast<std::size_t>(Quantity::log)]; }
double cosine_rms(const QuantityErrors& rms) { return rms[static_cast<std::size_t>(Quantity::cosine)]; }

/// "" where storing costs nothing.
std::string worst(const ParameterStorageError& error) {
  return error.alone.empty() || log_rms(error.alone.front().rms) == 0.0 ? "" : error.alone.front().name;
}

bool passed(const ParameterStorageError& error, const StorageSettings& settings) {
  return error.non_finite == 0 && !(settings.tolerance && log_rms(error.together) > *settings.tolerance);
}

Json to_json(const CheckedModel& checked, const ParameterStorageError& error, const StorageSettings& settings) {
  Json parameters = Json::array();
  for (const StoredParameterError& one : error.alone) {
    parameters.push_back({{"name", one.name},
                          {"code", one.code->name},
                          {"bits", one.bits},
                          {"largest_error", one.largest_error},
                          {"rms_alone", rms_json(one.rms)},
                          {"unrepresentable", one.overflows}});
  }
  return {{"model", checked.model->info->name},
          {"parameter_sets", error.parameter_sets},
          {"pairs", error.pairs},
          {"rms", rms_json(error.together)},
          {"worst", worst(error)},
          {"params", parameters},
          {"non_finite", error.non_finite},
          {"passed", passed(error, settings)}};
}

void print(const CheckedModel& checked, const ParameterStorageError& error) {
  const std::string hardest = worst(error);
  fmt::print("  {:<30} {:<9} {:>4} {:>13} {:>10} {:>10}\n", checked.model->info->name, "code", "bits", "largest error",
             "rms log", "rms cosine");
  for (const StoredParameterError& one : error.alone) {
    fmt::print("  {:<30} {:<9} {:>4} {:>13.3g} {:>10.3g} {:>10.3g}{}\n", one.name, one.code->name, one.bits,
               one.largest_error, log_rms(one.rms), cosine_rms(one.rms), one.name == hardest ? "  the worst" : "");
  }
  fmt::print("  {:<30} {:<9} {:>4} {:>13} {:>10.3g} {:>10.3g}\n", "all together", "", "", "", log_rms(error.together),
             cosine_rms(error.together));
  for (const StoredParameterError& one : error.alone) {
    if (one.overflows > 0) {
      fmt::print("  {} is beyond {}'s largest number, {:g}, in {} of {} parameter sets, and is taken as that\n",
                 one.name, one.code->name, largest_half, one.overflows, error.parameter_sets);
    }
  }
  if (error.non_finite > 0) fmt::print("  {} values are no finite numbers\n", error.non_finite);
  fmt::print("\n");
}

}  // namespace

std::string storage_help() {
  std::string text;
  for (const ParameterCode& code : parameter_codes()) text += fmt::format("\n  {:<10} {}", code.name, code.doc);
  return text;
}

void check_storage(const std::vector<CheckedModel>& models, const StorageSettings& settings, const Context& context) {
  Json list = Json::array();
  std::string failed;
  for (const CheckedModel& checked : models) {
    const StorageChoice choice = choose_codes(checked.model->parameters, settings.codes);
    const ParameterStorageError error = parameter_storage_error(*checked.model, checked.parameter_sets, choice);
    if (context.json)
      list.push_back(to_json(checked, error, settings));
    else
      print(checked, error);
    if (!passed(error, settings)) failed += (failed.empty() ? "" : ", ") + std::string(checked.model->info->name);
  }
  if (context.json) std::cout << (list.size() > 1 ? Json{{"checks", list}} : list[0]).dump(2) << "\n";
  if (!failed.empty()) {
    throw Error(ExitCode::check_failed, "what is stored is too far from what was given, or not finite", failed,
                "store the worst parameter in more bits, or raise --tolerance");
  }
}

}  // namespace lobefit
