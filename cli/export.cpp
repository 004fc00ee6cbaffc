// lobefit export: shader code with the constants baked in.
#include <fmt/format.h>

#include "cli/arguments.h"
#include "cli/shader_text.h"
#include "evaluate/shader.h"

namespace lobefit {

void add_export(CLI::App& app, Context& context) {
  std::string languages;
  for (const std::string& language : shader_languages()) languages += (languages.empty() ? "" : ", ") + language;
  CLI::App* verb = app.add_subcommand("export",
                                      "Shader code of a model, with its constants and where they came from\n"
                                      "  lobefit export fit.json --lang hlsl -o proxima.ush\n"
                                      "  lobefit export eon --lang glsl --set roughness=0.3");
  struct Arguments {
    std::string name, language = "hlsl", output;
    std::vector<std::string> settings;
  };
  const auto a = std::make_shared<Arguments>();
  verb->add_option("NAME", a->name, "Fit (.json) or model")->required();
  verb->add_option("--lang", a->language, "Language: " + languages)->capture_default_str();
  add_repeatable(*verb, "--set", a->settings, "NAME=VALUE or NAME=r,g,b (repeatable)");
  verb->add_option("-o,--output", a->output, "File to write (default: stdout)");
  verb->callback([&context, a] {
    const ModelChoice choice = find_model_or_fit(a->name, a->settings);
    const std::string origin =
        choice.fit ? "Fitted constants from " + std::filesystem::path(a->name).filename().string() : "";
    write_or_print(shader_text(*choice.model, choice.values, choice.fit ? &*choice.fit : nullptr, a->language,
                               context.command, origin),
                   a->output, context.force);
  });
}

}  // namespace lobefit
