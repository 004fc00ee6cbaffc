// lobefit check: the model as a GPU runs it against double precision and against a table.
#include <fmt/format.h>

#include <iostream>

#include "cli/arguments.h"
#include "cli/check_storage.h"
#include "cli/slice.h"
#include "evaluate/check.h"
#include "evaluate/shader.h"
#include "evaluate/spirv.h"
#include "evaluate/vulkan_evaluator.h"

namespace lobefit {

namespace {

struct CheckArguments {
  std::string name, table, device = "simd", language;
  std::vector<std::string> settings, mappings;
  bool all = false, list_devices = false;
  CheckOptions options;
  StorageSettings storage;
};

constexpr int parameter_set_count = 16;

/// What --device and --lang name.
struct Devices {
  std::vector<std::unique_ptr<const VulkanDevice>> vulkan;
  std::vector<std::unique_ptr<const FloatDevice>> evaluators;

  void add_vulkan(const std::string& which, const std::string& language) {
    vulkan.push_back(std::make_unique<const VulkanDevice>(which));
    for (const std::string& each : spirv_languages()) {
      if (language != "all" && language != each) continue;
      evaluators.push_back(std::make_unique<const VulkanEvaluator>(*vulkan.back(), each));
    }
  }
};

/// Every device that there is. A machine without Vulkan has one.
std::vector<VulkanDeviceInfo> vulkan_devices_or_none(const Context& context) {
  try {
    return vulkan_devices();
  } catch (const Error& error) {
    if (error.code() != ExitCode::missing_part) throw;
    context.say(std::string("no Vulkan: ") + error.what());
    return {};
  }
}

Devices find_devices(const std::string& device, const std::string& language, const Context& context) {
  const std::string vulkan = "vulkan";
  if (device != "simd" && device != "all" && device != vulkan && !device.starts_with(vulkan + ":")) {
    throw Error(ExitCode::usage, "unknown device '" + device + "'", "--device",
                "choose simd, vulkan, vulkan:INDEX, vulkan:NAME or all");
  }
  if (device == "simd" && !language.empty()) {
    throw Error(ExitCode::usage, "SIMD code is no shader and has no language", "--lang", "use --device vulkan with it");
  }
  Devices found;
  if (device == "simd" || device == "all") found.evaluators.push_back(std::make_unique<const SimdDevice>());
  if (device == "all") {
    for (const VulkanDeviceInfo& info : vulkan_devices_or_none(context)) {
      found.add_vulkan(std::to_string(info.index), language.empty() ? "all" : language);
    }
  } else if (device != "simd") {
    found.add_vulkan(device == vulkan ? "" : device.substr(vulkan.size() + 1), language.empty() ? "glsl" : language);
  }
  return found;
}

void list_devices(const Context& context) {
  const std::vector<VulkanDeviceInfo> devices = vulkan_devices_or_none(context);
  if (context.json) {
    Json list{{{"device", "simd"}, {"software", true}}};
    for (const VulkanDeviceInfo& info : devices) {
      list.push_back({{"device", "vulkan:" + std::to_string(info.index)},
                      {"name", info.name},
                      {"driver", info.driver},
                      {"software", info.software}});
    }
    std::cout << Json{{"devices", list}}.dump(2) << "\n";
    return;
  }
  fmt::print("  simd       vectorised float on the CPU\n");
  for (const VulkanDeviceInfo& info : devices) {
    fmt::print("  vulkan:{:<3} {}; {}{}\n", info.index, info.name, info.driver,
               info.software ? "; software: runs on the CPU" : "");
  }
}

std::vector<std::string> chosen_names(const CheckArguments& a) {
  if (!a.all) return {a.name};
  std::vector<std::string> names;
  for (const Model& model : models()) names.emplace_back(model.info->name);
  return names;
}

/// A fit's parameters stay; what a table's axis set for it, and all of a bare model's that are not given, vary.
CheckedModel choose_parameter_sets(const CheckArguments& a, const std::string& name, const Context& context) {
  const ModelChoice choice = find_model_or_fit(name, a.settings);
  std::vector<std::string> vary;
  for (const ParameterInfo& info : choice.values.list()) {
    const std::string parameter(info.name);
    const bool fitted = choice.fit && std::any_of(choice.fit->parameters.begin(), choice.fit->parameters.end(),
                                                  [&](const FitParameter& p) {
                                                    return p.name.substr(0, p.name.find('.')) == parameter;
                                                  });
    const bool given = std::any_of(a.settings.begin(), a.settings.end(),
                                   [&](const std::string& s) { return s.starts_with(parameter + "="); });
    if (!fitted && !given) vary.push_back(parameter);
  }
  return {choice.model, varied_parameters(choice.values, vary, parameter_set_count, context.seed)};
}

CheckResult check_one(const CheckArguments& a, const std::string& name, const FloatDevice& device,
                      const Context& context) {
  const CheckedModel checked = choose_parameter_sets(a, name, context);
  const auto monitor = context.monitor();
  CheckResult result = check_model(*checked.model, checked.parameter_sets, a.options, device, *monitor);
  if (!a.table.empty()) {
    const Table table = read_table(a.table);
    const ModelChoice on_table = choose_for_table(name, a.settings, a.mappings, table);
    result.table =
        check_against_table(TableModel(*on_table.model, on_table.values, table, on_table.mappings), table, device);
  }
  return result;
}

void print_result(const CheckResult& r) {
  fmt::print("  {:<26} {:<5} {:>9} {:>9.1e} {:>9.1e} {:>9.1e} {:>9.1e} {:>9.1e} {:>11} {:>8.1f}  {}\n", r.model,
             r.language.empty() ? r.device : r.language, r.pairs, r.max_abs, r.max_rel, r.p999_rel, r.rms, r.rms_rel,
             r.conditioned, r.evaluations_per_s * 1e-6, r.passed ? "passed" : "FAILED");
  if (r.table)
    fmt::print("  against the table: rms {:.6g} in double, {:.6g} in float\n", r.table->rms_double, r.table->rms_float);
}

std::string worst_text(const CheckResult& r) {
  std::string parameters;
  for (const ParameterInfo& info : r.worst_parameters.list()) {
    parameters += fmt::format(" --set {}={}", info.name, r.worst_parameters.text(info));
  }
  const auto angles = [](const Direction& w) {
    return fmt::format("{:.9g},{:.9g}", degrees(std::acos(w.z)), degrees(std::atan2(w.y, w.x)));
  };
  return fmt::format("lobefit eval {}{} --wi {} --wo {}", r.model, parameters, angles(r.worst_wi), angles(r.worst_wo));
}

}  // namespace

void add_check(CLI::App& app, Context& context) {
  CLI::App* verb = app.add_subcommand(
      "check",
      "Run a model as a GPU would (vectorised float, or its shader by Vulkan) against double precision and a table\n"
      "  lobefit check fit.json --table truth.exr\n"
      "  lobefit check --all\n"
      "  lobefit check --all --device vulkan --lang all      the exported shaders, on a Vulkan device\n"
      "A pair passes if |float - double| <= 1e-5 |double| + 1e-6/cos(theta_i), or if that much is beyond any float "
      "arithmetic: if\n"
      "moving each input by one float ulp moves the value by half the error (such pairs are counted as conditioned).\n"
      "One in eight pairs is hostile: grazing to within 1e-6 of the horizon, retro, mirror or normal. Relative errors\n"
      "are reported for values above 1e-3 1/sr. A fit keeps its parameters; what it does not hold varies over 16 "
      "parameter sets.\n"
      "  lobefit check proxima --storage unorm8 --storage albedo=rgb776\n"
      "tells instead what parameters in few bits cost: the rms error of log(1 + f cos) and of pi f cos with each "
      "parameter alone\n"
      "as it is read back, from the worst down, and with all of them.");
  const auto a = std::make_shared<CheckArguments>();
  auto* name = verb->add_option("NAME", a->name, "Fit (.json) or model");
  auto* all = verb->add_flag("--all", a->all, "Every registered model");
  name->excludes(all);
  add_repeatable(*verb, "--set", a->settings, "NAME=VALUE holds a parameter (repeatable)");
  verb->add_option("--table", a->table, "Also compare over this table's grid");
  add_repeatable(*verb, "--map", a->mappings, "NAME=SCALE*AXIS^POWER for --table (repeatable)");
  verb->add_option("--device", a->device,
                   "simd; vulkan, the exported shader on the first device, a GPU before a CPU; vulkan:INDEX or "
                   "vulkan:NAME, another one, by a part of its name; or all")
      ->capture_default_str();
  verb->add_option("--lang", a->language, "Of the shader: glsl, hlsl or all (default: glsl; with --device all both)")
      ->check(CLI::IsMember({"glsl", "hlsl", "all"}));
  verb->add_flag("--list-devices", a->list_devices, "Name the devices that there are")->excludes(name)->excludes(all);
  verb->add_option("--pairs", a->options.pairs, "Pairs of directions")
      ->check(CLI::Range(std::uint64_t{1024}, std::uint64_t{1} << 28))
      ->capture_default_str();
  CLI::Option* const storage =
      add_repeatable(*verb, "--storage", a->storage.codes,
                     "CODE for every parameter that is a number, or NAME=CODE for one (repeatable); its range is the "
                     "model's. Codes:" +
                         storage_help());
  for (const char* other : {"--table", "--map", "--device", "--lang", "--list-devices", "--pairs"})
    storage->excludes(verb->get_option(other));
  verb->add_option("--tolerance", a->storage.tolerance,
                   "With --storage: exit 5 if the rms of log(1 + f cos) of all parameters together is beyond it")
      ->check(CLI::NonNegativeNumber)
      ->needs(storage);
  verb->callback([&context, a] {
    if (a->list_devices) {
      list_devices(context);
      return;
    }
    if (a->name.empty() && !a->all)
      throw Error(ExitCode::usage, "check what?", "check", "name a fit or a model, or use --all");
    if (!a->storage.codes.empty()) {
      std::vector<CheckedModel> checked;
      for (const std::string& each : chosen_names(*a)) checked.push_back(choose_parameter_sets(*a, each, context));
      check_storage(checked, a->storage, context);
      return;
    }
    a->options.seed = context.seed;
    const Devices devices = find_devices(a->device, a->language, context);
    std::vector<CheckResult> results;
    for (const auto& device : devices.evaluators) {
      for (const std::string& each : chosen_names(*a)) results.push_back(check_one(*a, each, *device, context));
    }
    if (context.json) {
      Json list = Json::array();
      for (const CheckResult& result : results) list.push_back(result.json());
      std::cout << (a->all || list.size() > 1 ? Json{{"checks", list}} : list[0]).dump(2) << "\n";
    } else {
      fmt::print("  {:<26} {:<5} {:>9} {:>9} {:>9} {:>9} {:>9} {:>9} {:>11} {:>8}\n", "model", "dev", "pairs",
                 "max abs", "max rel", "p999 rel", "rms", "rms rel", "conditioned", "M eval/s");
      for (const CheckResult& result : results) print_result(result);
      for (const auto& device : devices.vulkan) {
        fmt::print("  The shaders ran on {}{}.\n", device->info().name,
                   device->info().software ? ", a software device: its rates are the CPU's" : "");
      }
      if (context.verbose) {
        for (const CheckResult& result : results) fmt::print("  worst: {}\n", worst_text(result));
      }
    }
    for (const CheckResult& result : results) {
      if (!result.passed) {
        throw Error(ExitCode::check_failed,
                    fmt::format("{} of {} pairs exceed the bound", result.failures, result.pairs),
                    result.model + " on " + result.device + (result.language.empty() ? "" : ", " + result.language),
                    "look at the worst with `" + worst_text(result) + "`");
      }
    }
  });
}

}  // namespace lobefit
