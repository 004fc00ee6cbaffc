// lobefit: the command line. One file per verb; no numerics here.
#include <fmt/format.h>
#include <tbb/global_control.h>

#include <array>
#include <iostream>
#include <set>

#include "cli/arguments.h"
#include "cli/interrupt.h"

namespace lobefit {

namespace {

/// The command without options that can't change the result.
std::string canonical_command(int argc, char** argv) {
  const std::set<std::string> flags{"--quiet", "--verbose", "--progress", "--json", "--force", "--resume", "-q", "-v"};
  const std::set<std::string> with_value{"--threads", "-o", "--output", "--shard"};
  std::string command = "lobefit";
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    const std::string name = argument.substr(0, argument.find('='));
    if (flags.contains(name)) continue;
    if (with_value.contains(name)) {
      if (argument.find('=') == std::string::npos) ++i;
      continue;
    }
    command += argument.find_first_of(" '\"$*") == std::string::npos ? " " + argument : " '" + argument + "'";
  }
  return command;
}

/// CLI11's complaints in our form: WHAT (WHERE): HOW TO MEND.
Error usage_error(const CLI::App& app, const CLI::ParseError& error) {
  const auto chosen = app.get_subcommands();
  const std::string where = chosen.empty() ? "" : chosen.front()->get_name();
  std::string what = error.what();
  for (char& c : what) c = c == '\n' ? ' ' : c;
  return {ExitCode::usage, what, where, "see `lobefit " + where + (where.empty() ? "" : " ") + "--help`"};
}

/// Refuses an unknown verb with the nearest one; CLI11 would only say that an argument was not expected.
void check_verb(const CLI::App& app, int argc, char** argv) {
  std::vector<std::string> verbs;
  for (const CLI::App* verb : app.get_subcommands([](const CLI::App*) { return true; }))
    verbs.push_back(verb->get_name());
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    if (argument == "--threads" || argument == "--seed") {
      ++i;
    } else if (!argument.starts_with('-')) {
      if (std::find(verbs.begin(), verbs.end(), argument) != verbs.end()) return;
      throw Error(ExitCode::usage, "unknown verb '" + argument + "'", "",
                  "did you mean '" + nearest_name(argument, verbs) + "'? `lobefit --help` lists them all");
    }
  }
}

int run(int argc, char** argv) {
  Context context;
  context.command = canonical_command(argc, argv);

  CLI::App app{
      "lobefit fits analytic BRDFs to ground truth and measures how far they fall short.\n\n"
      "  lobefit refit proxima                       where do Proxima's -0.55 and 0.19 come from?\n"
      "  lobefit eval proxima --set alpha=0.5 --wi 60,0 --wo 0,0\n"
      "  lobefit reference microfacet_diffuse --set alpha=0.5 --wi 60,0 --wo 60,0 --exact\n"
      "  lobefit render microfacet_diffuse --grid default --axis alpha=0.1,0.5,1 -o truth.exr\n"
      "  lobefit fit proxima truth.exr --free a,b -o fit.json\n"
      "  lobefit check fit.json --table truth.exr\n"
      "  lobefit export fit.json --lang hlsl\n\n"
      "Angles are THETA,PHI in degrees; an azimuth difference of 0 is the retro side. Values are BRDFs in 1/sr,\n"
      "without cosine.\n\n"
      "Exit codes: 0 done, 1 internal or write failure, 2 usage, 3 invalid input, 4 a fit did not converge,\n"
      "5 a check failed, 6 a device or an optional part is missing, 130 interrupted.",
      "lobefit"};
  app.set_version_flag("--version", "lobefit " LOBEFIT_VERSION);
  app.require_subcommand(1);
  app.fallthrough();
  app.add_option("--threads", context.threads, "Threads to use (default: all)")->check(CLI::Range(1, 1024));
  app.add_option("--seed", context.seed, "Seed of all random numbers")->capture_default_str();
  app.add_flag("--quiet,-q", context.quiet, "No messages and no progress");
  app.add_flag("--verbose,-v", context.verbose, "More about what is done");
  app.add_flag("--progress", context.progress, "Progress also where stderr is no terminal");
  app.add_flag("--json", context.json, "One JSON document on stdout");
  app.add_flag("--force", context.force, "Replace existing output");
  add_models(app, context);
  add_eval(app, context);
  add_sample(app, context);
  add_albedo(app, context);
  add_albedo_table(app, context);
  add_references(app, context);
  add_reference(app, context);
  add_render(app, context);
  add_table(app, context);
  add_fit(app, context);
  add_refit(app, context);
  add_report(app, context);
  add_check(app, context);
  add_export(app, context);
  add_plot(app, context);
  add_sphere(app, context);
  add_slab(app, context);
  add_study(app, context);
  for (CLI::App* verb : app.get_subcommands([](const CLI::App*) { return true; })) {
    verb->fallthrough();
    // One line in the list of verbs; the rest, examples and remarks, where the verb's own help ends.
    const std::string description = verb->get_description();
    const std::size_t line = description.find('\n');
    if (line == std::string::npos) continue;
    verb->description(description.substr(0, line));
    verb->footer("\n" + description.substr(line + 1));
  }

  std::unique_ptr<tbb::global_control> threads;
  app.parse_complete_callback([&] {
    if (context.threads > 0) {
      threads = std::make_unique<tbb::global_control>(tbb::global_control::max_allowed_parallelism,
                                                      static_cast<std::size_t>(context.threads));
    }
  });
  check_verb(app, argc, argv);
  try {
    app.parse(argc, argv);
  } catch (const CLI::Success& request) {  // --help, --version
    return app.exit(request);
  } catch (const CLI::RuntimeError& status) {  // a verb's own exit code
    return status.get_exit_code();
  } catch (const CLI::ParseError& error) {
    throw usage_error(app, error);
  }
  return 0;
}

}  // namespace

}  // namespace lobefit

int main(int argc, char** argv) {
  using lobefit::ExitCode;
  lobefit::catch_interrupts();
  try {
    const int status = lobefit::run(argc, argv);
    std::cout.flush();
    if (!std::cout || std::fflush(stdout) != 0) {
      throw lobefit::Error(ExitCode::failure, "can't write to stdout", "", "check where it is piped to");
    }
    return status;
  } catch (const lobefit::Error& error) {
    fmt::print(stderr, "lobefit: error: {}\n", error.what());
    return static_cast<int>(error.code());
  } catch (const std::bad_alloc&) {
    fmt::print(stderr, "lobefit: error: out of memory: use a smaller grid or fewer parameter rows\n");
  } catch (const std::exception& error) {
    fmt::print(stderr, "lobefit: error: internal: {}: please report it with the command line\n", error.what());
  }
  return static_cast<int>(ExitCode::failure);
}
