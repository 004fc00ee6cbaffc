// lobefit export: shader code with the constants baked in, or what the port's GBuffer keeps of them.
#include <fmt/format.h>

#include "cli/arguments.h"
#include "cli/gbuffer_export.h"
#include "evaluate/shader.h"
#include "report/shader_text.h"

namespace lobefit {

void add_export(CLI::App& app, Context& context) {
  std::string languages;
  for (const std::string& language : shader_languages()) languages += (languages.empty() ? "" : ", ") + language;
  CLI::App* verb =
      app.add_subcommand("export",
                         "Shader code of a model, with its constants and where they came from\n"
                         "  lobefit export fit.json --lang hlsl -o proxima.ush\n"
                         "  lobefit export eon --lang glsl --set roughness=0.3\n"
                         "  lobefit export fit.json --lang c -o proxima.h        C99, or C++: static inline functions\n"
                         "  lobefit export fit.json --gbuffer --table truth.exr\n"
                         "--gbuffer tells, of Callisto, what its port to Unreal Engine 4.27 keeps: bytes and "
                         "loss of each parameter, and the\n"
                         "error of the fit, of the port's formula, and of what is left after the bytes; "
                         "against the table (on the fit's grid,\n"
                         "with its weights, held-out entries included), or else between them. 'alone' is the "
                         "rms of log(1 + f cos) that one\n"
                         "parameter's byte costs.");
  struct Arguments {
    std::string language = "hlsl";
    GBufferSettings shared;  // what both kinds of export take, and more
    bool gbuffer = false;
  };
  const auto a = std::make_shared<Arguments>();
  GBufferSettings& shared = a->shared;
  verb->add_option("NAME", shared.name, "Fit (.json) or model")->required();
  CLI::Option* const language =
      verb->add_option("--lang", a->language, "Language: " + languages)->capture_default_str();
  CLI::Option* const gbuffer =
      verb->add_flag("--gbuffer", a->gbuffer, "Bytes, losses and error in the port's GBuffer, of callisto's models");
  gbuffer->excludes(language);
  verb->add_option("--table", shared.table, "With --gbuffer: table or measured file to hold the errors against")
      ->needs(gbuffer);
  verb->add_option("--material", shared.material, "Of a table file that holds several (default: the fit's)")
      ->needs("--table");
  verb->add_flag("--static-lighting", shared.options.static_lighting,
                 "With --gbuffer: the project allows static lighting, so ambient occlusion has no channel")
      ->needs(gbuffer);
  verb->add_flag(
          "--metallic", shared.options.metallic,
          "With --gbuffer: let Metallic carry f0 above .08 and its colour, as far as one base colour can be both "
          "albedo and f0")
      ->needs(gbuffer);
  add_repeatable(*verb, "--set", shared.settings, "NAME=VALUE or NAME=r,g,b (repeatable)");
  verb->add_option("-o,--output", shared.output, "File to write (default: stdout)");
  verb->callback([&context, a] {
    if (a->gbuffer) {
      export_gbuffer(a->shared, context);
      return;
    }
    const ModelChoice choice = find_model_or_fit(a->shared.name, a->shared.settings);
    const std::string origin =
        choice.fit ? "Fitted constants from " + std::filesystem::path(a->shared.name).filename().string() : "";
    write_or_print(shader_text(*choice.model, choice.values, choice.fit ? &*choice.fit : nullptr, a->language,
                               context.command, origin),
                   a->shared.output, context.force);
  });
}

}  // namespace lobefit
