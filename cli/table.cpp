// lobefit table: what is in a table, and how far two are apart.
#include <fmt/format.h>

#include <iostream>

#include "cli/arguments.h"
#include "cli/sampling.h"
#include "cli/slice.h"
#include "reference/formats/brdf_file.h"
#include "reference/merge.h"
#include "reference/output_file.h"
#include "report/image.h"

namespace lobefit {

namespace {

/// A file to read, with what only some formats need.
struct FileArguments {
  std::string name, material, utia = "raw", wo, wi;

  void add_to(CLI::App& verb) {
    verb.add_option("FILE", name, "Table or measured file, known by its bytes")->required();
    verb.add_option("--material", material, "Which material of a file that holds several (NBRDF weights)");
    verb.add_option("--utia-scale", utia,
                    "UTIA files only, whose scale readers dispute: raw, or srgb (/140, decoded, times 100)")
        ->check(CLI::IsMember({"raw", "srgb"}))
        ->capture_default_str();
    CLI::Option* view = verb.add_option("--wo", wo, "Lat-long pictures over the light: the view THETA,PHI in degrees");
    verb.add_option("--wi", wi, "Lat-long pictures over the view: the light THETA,PHI in degrees")->excludes(view);
  }
  ReadOptions read_options() const {
    ReadOptions options{.material = material, .utia_scale = utia == "raw" ? Utia::Scale::raw : Utia::Scale::srgb};
    const std::string& text = wo.empty() ? wi : wo;
    if (text.empty()) return options;
    const char* option = wo.empty() ? "--wi" : "--wo";
    parse_direction(text, option);  // its range
    const std::vector<double> angles = parse_numbers(text, option);
    options.held = {wo.empty() ? FixedDirection::light : FixedDirection::view, angles[0], angles[1]};
    return options;
  }
};

void add_info(CLI::App& tables, Context& context) {
  CLI::App* verb = tables.add_subcommand("info", "Axes, channels, entries and provenance");
  const auto a = std::make_shared<FileArguments>();
  a->add_to(*verb);
  verb->callback([&context, a] {
    const BrdfFile file = read_brdf_file(a->name, a->read_options());
    const Table& table = file.table;
    Json description = table.describe();
    description["format"] = file_format_names[static_cast<std::size_t>(file.format)];
    if (context.json) {
      std::cout << description.dump(2) << "\n";
      return;
    }
    for (const Json& axis : description["axes"]) {
      const auto values = axis["values"].get<std::vector<double>>();
      fmt::print("  {:<10} {:>4} {} from {:g} to {:g} {}\n", axis["name"].get<std::string>(), values.size(),
                 axis["kind"].get<std::string>(), values.front(), values.back(), axis["unit"].get<std::string>());
    }
    fmt::print("  {} coordinates, file format {}\n", description["coordinates"].get<std::string>(),
               description["format"].get<std::string>());
    fmt::print("  {} entries, {} masked, {} channel{}, {} replicates\n", table.entries(), table.masked(),
               table.channels, table.channels == 1 ? "" : "s", description["replicates"].get<int>());
    for (const auto& [key, value] : description["provenance"].items()) {
      fmt::print("  {:<14} {}\n", key, value.is_string() ? value.get<std::string>() : value.dump());
    }
  });
}

void add_slice(CLI::App& tables, Context& context) {
  CLI::App* verb = tables.add_subcommand("slice",
                                         "Part of a table as CSV, or as a false-colour picture of two axes\n"
                                         "  lobefit table slice truth.exr --at alpha=0.5 --at theta_o=60 --at phi=0\n"
                                         "  lobefit table slice truth.exr --at alpha=0.5 --at phi=180 -o slice.png");
  struct Arguments {
    std::string name, output;
    std::vector<std::string> at;
  };
  const auto a = std::make_shared<Arguments>();
  verb->add_option("TABLE", a->name, "Table file")->required();
  add_repeatable(*verb, "--at", a->at, "AXIS=VALUE holds an axis at one of its values (repeatable)");
  verb->add_option("-o,--output", a->output, "File to write, .csv or .png (default: CSV on stdout)");
  verb->callback([&context, a] {
    const Table table = read_table(a->name);
    const Slice slice = cut(table, a->at);
    if (!a->output.ends_with(".png")) {
      write_or_print(slice.csv(), a->output, context.force);
      return;
    }
    if (slice.axes.size() != 2) {
      throw Error(ExitCode::usage, fmt::format("a picture shows two axes, {} are left", slice.axes.size()),
                  "table slice", "hold the others with --at AXIS=VALUE");
    }
    write_false_colour(slice.cosine_picture(), slice.axes[1].size(), slice.axes[0].size(), a->output, context.force);
  });
}

void print_written(const Context& context, const Table& table, const std::string& output) {
  if (context.json) {
    Json description = table.describe();
    description["file"] = output;
    description["failed"] = table.failed().size();
    std::cout << description.dump(2) << "\n";
  } else {
    fmt::print("{}: {} entries ({} masked)\n", output, table.entries(), table.masked());
  }
}

void add_convert(CLI::App& tables, Context& context) {
  CLI::App* verb = tables.add_subcommand(
      "convert",
      "Between formats: any file is read, known by its bytes; EXR, MERL, RGL, ALTA text and CSV are written\n"
      "  lobefit table convert aurora_white_rgb.bsdf -o aurora_white.binary      RGL to MERL\n"
      "  lobefit table convert merl_nbrdf.txt --material brass -o brass.binary   network weights to a MERL table\n"
      "  lobefit table convert brass.binary --grid default -o brass.exr          onto a grid of angles\n"
      "  lobefit table convert lobe30.exr --wo 30,0 -o lobe30_table.exr          a lat-long picture of a BRDF\n"
      "Lat-long pictures: f in 1/sr without cosine over the light's directions for one view (or the reverse, --wi);\n"
      "2:1 the whole sphere, 4:1 the upper hemisphere, the normal at the top, azimuth 0 at the left edge and growing\n"
      "to the right, angles at the centres of pixels. Attributes theta_o, phi_o (or theta_i, phi_i) of the file name\n"
      "the direction that it holds. `lobefit table merge` joins the tables of several views.\n"
      "Files keep their own grid where the format written has one for it. A MERL bin holds the mean of both orders\n"
      "of its directions; values below 0 become 0 there, and what has no value -1.");
  struct Arguments {
    FileArguments file;
    std::string output, format, grid;
    std::vector<std::string> settings;
  };
  const auto a = std::make_shared<Arguments>();
  a->file.add_to(*verb);
  verb->add_option("-o,--output", a->output, "File to write: .exr, .binary (MERL), .bsdf (RGL), .alta, .csv")
      ->required();
  verb->add_option("--format", a->format, "Instead of the extension: exr, merl, rgl, alta, csv");
  verb->add_option("--grid", a->grid, "Resample onto a grid of angles: small, default, fine, or a JSON file");
  add_repeatable(*verb, "--set", a->settings, "AXIS=VALUE: one row of a table with parameter axes (repeatable)");
  verb->callback([&context, a] {
    const FileFormat format = a->format.empty() ? format_of_extension(a->output) : parse_output_format(a->format);
    OutputFile output(a->output, context.force);
    BrdfFile file = read_brdf_file(a->file.name, a->file.read_options());
    if (!a->settings.empty()) file = file.row_slice(find_row(file.table, a->settings));
    if (!a->grid.empty()) {
      file = {.format = file.format, .table = file.resampled(Grid::named_or_file(a->grid)), .rgl = nullptr};
    }
    if (file.table.version.empty()) file.table.version = LOBEFIT_VERSION;
    file.table.command += (file.table.command.empty() ? "" : " && ") + context.command;
    write_brdf_file(file, format, output.temporary());
    output.commit();
    const auto name = [](FileFormat f) { return file_format_names[static_cast<std::size_t>(f)]; };
    if (context.json) {
      std::cout << Json{{"file", a->output}, {"from", name(file.format)}, {"to", name(format)}}.dump(2) << "\n";
    } else {
      fmt::print("{}: {}, from {} with {} entries ({} masked)\n", a->output, name(format), name(file.format),
                 file.table.entries(), file.table.masked());
    }
  });
}

Table merged(const std::vector<std::filesystem::path>& paths, bool partial, const Context& context) {
  Table first = read_table(paths.front());
  if (first.shards.count > 1) return merge_shards(paths, partial);
  if (partial) throw Error(ExitCode::usage, "whole tables leave no shards out", "--partial", "leave it out");
  std::vector<Table> tables{std::move(first)};
  for (std::size_t k = 1; k < paths.size(); ++k) tables.push_back(read_table(paths[k]));
  Table joined = join_polar_angles(tables, paths);
  joined.command = context.command;
  if (joined.version.empty()) joined.version = LOBEFIT_VERSION;
  return joined;
}

void add_merge(CLI::App& tables, Context& context) {
  CLI::App* verb = tables.add_subcommand("merge",
                                         "Joins the shards of one render into the table that one run would have made\n"
                                         "  for i in 1 2 3; do\n"
                                         "    lobefit render microfacet_diffuse --shard $i/3 -o part$i.exr\n"
                                         "  done\n"
                                         "  lobefit table merge part1.exr part2.exr part3.exr -o truth.exr\n"
                                         "or whole tables that differ in theta_o (or theta_i) alone, as lat-long\n"
                                         "pictures for several views do\n"
                                         "  lobefit table merge lobe00.exr lobe30.exr lobe60.exr -o lobes.exr");
  struct Arguments {
    std::vector<std::string> names;
    std::string output;
    bool partial = false;
  };
  const auto a = std::make_shared<Arguments>();
  verb->add_option("SHARDS", a->names, "Tables that `lobefit render --shard` wrote, or of single polar angles")
      ->required();
  verb->add_option("-o,--output", a->output, "Table to write (.exr)")->required();
  verb->add_flag("--partial", a->partial, "Mask the lines of missing shards; the result can be merged further");
  verb->callback([&context, a] {
    OutputFile file(a->output, context.force);
    const std::vector<std::filesystem::path> paths(a->names.begin(), a->names.end());
    const Table table = merged(paths, a->partial, context);
    table.write(file.temporary());
    file.commit();
    if (table.shards.count > 1)
      context.say(fmt::format("warning: the table holds shards {} only", table.shards.text()));
    warn_about_failed(context, table);
    print_written(context, table, a->output);
  });
}

void add_recolor(CLI::App& tables, Context& context) {
  CLI::App* verb = tables.add_subcommand("recolor",
                                         "The same surface at another albedo, from a table rendered with --orders\n"
                                         "  lobefit render microfacet_diffuse --set bounces=all --orders -o truth.exr\n"
                                         "  lobefit table recolor truth.exr --set albedo=0.9,0.5,0.2 -o gold.exr\n"
                                         "No further sampling: errors follow from those of the orders.");
  struct Arguments {
    std::string name, output;
    std::vector<std::string> settings;
  };
  const auto a = std::make_shared<Arguments>();
  verb->add_option("TABLE", a->name, "Table that `lobefit render --orders` wrote")->required();
  add_repeatable(*verb, "--set", a->settings, "albedo=VALUE or albedo=r,g,b")->required();
  verb->add_option("-o,--output", a->output, "Table to write (.exr)")->required();
  verb->callback([&context, a] {
    OutputFile file(a->output, context.force);
    const Table table = Table::read(a->name);
    const Reference* reference = find_reference_or_null(table.model);
    if (!reference || table.orders == 0) {
      throw Error(ExitCode::usage, "the table keeps no orders of scattering", a->name,
                  "render it with --orders: then any albedo follows from it");
    }
    // Names and ranges are those of the reference.
    ParameterValues values = reference->defaults();
    set_parameters(values, a->settings);
    for (const std::string& setting : a->settings) {
      if (setting.substr(0, setting.find('=')) != "albedo") {
        throw Error(ExitCode::usage, "only the albedo can change without another render", "--set " + setting,
                    "write --set albedo=r,g,b");
      }
    }
    const std::span<const double> albedo = values.components(values.info("albedo"));
    Table recolored = table.with_albedo({albedo.front(), albedo[albedo.size() / 2], albedo.back()});
    // Both are needed to make it again.
    recolored.command = table.command + " && " + context.command;
    recolored.write(file.temporary());
    file.commit();
    print_written(context, recolored, a->output);
  });
}

}  // namespace

void add_table(CLI::App& app, Context& context) {
  CLI::App* verb = app.add_subcommand("table", "Look into tables and measured files, convert, join and recolour them");
  verb->require_subcommand(1);
  add_info(*verb, context);
  add_slice(*verb, context);
  add_table_compare(*verb, context);
  add_convert(*verb, context);
  add_merge(*verb, context);
  add_recolor(*verb, context);
  for (CLI::App* part : verb->get_subcommands([](const CLI::App*) { return true; })) part->fallthrough();
}

}  // namespace lobefit
