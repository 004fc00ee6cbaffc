#include "fit/recipe.h"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>
#include <set>

#include "fit/recipe_reading.h"
#include "reference/output_file.h"

namespace lobefit {

namespace {

Rival read_rival(const JsonReader& reader, const std::vector<Axis>& axes) {
  reader.allow({"label", "model", "set", "map", "free_per_row"});
  Rival rival;
  rival.model = reader.at("model").text();
  rival.label = reader.has("label") ? reader.at("label").text() : rival.model;
  ParameterValues values = in_file(reader.at("model"), [&] { return find_model(rival.model).defaults(); });
  if (reader.has("set")) {
    set_parameters(values, reader.at("set"));
    for (const auto& [name, member] : reader.at("set").members())
      rival.set.emplace_back(name, number_or_numbers(member));
  }
  if (reader.has("map")) {
    for (const JsonReader& text : reader.at("map").elements()) {
      rival.mappings.push_back(in_file(text, [&] { return AxisMapping::parse(text.text()); }));
      const AxisMapping& mapping = rival.mappings.back();
      const auto axis = std::ranges::find(axes, mapping.axis, &Axis::name);
      if (axis == axes.end()) {
        throw text.error("the recipe has no axis '" + mapping.axis + "'", "map one of $.axes");
      }
      in_file(text, [&] {
        for (const double v : axis->values) ParameterValues(values).set(mapping.parameter, mapping.apply(v));
        return 0;
      });
    }
  }
  if (reader.has("free_per_row")) {
    for (const JsonReader& name : reader.at("free_per_row").elements()) {
      in_file(name, [&] { return values.info(name.text()); });
      rival.free_per_row.push_back(name.text());
    }
  }
  return rival;
}

RecipeRow read_row(const JsonReader& reader, const ParameterValues& recipe_values, const std::vector<Axis>& axes) {
  reader.allow({"name", "views", "model", "fixed", "reference", "grid", "metric", "weights", "free"});
  RecipeRow row;
  row.model = reader.has("model") ? reader.at("model").text() : recipe_values.owner();
  const ParameterValues model_values =
      reader.has("model") ? in_file(reader.at("model"), [&] { return find_model(row.model).defaults(); })
                          : recipe_values;
  if (!std::ranges::equal(model_values.list(), recipe_values.list(), {}, &ParameterInfo::name, &ParameterInfo::name)) {
    throw reader.at("model").error("'" + row.model + "' has other parameters than " + recipe_values.owner(),
                                   "name a variant of the recipe's model");
  }
  if (reader.has("fixed")) {
    ParameterValues values = model_values;
    set_parameters(values, reader.at("fixed"));
    for (const auto& [name, member] : reader.at("fixed").members()) {
      const std::span<const double> value = values.components(values.info(name));
      row.fixed.emplace_back(name, std::vector(value.begin(), value.end()));
    }
  }
  row.name = reader.at("name").text();
  row.views = reader.at("views").text();
  if (row.views != "all" && row.views != "normal_slice") {
    throw reader.at("views").error("unknown views '" + row.views + "'", "choose all or normal_slice");
  }
  const JsonReader reference = reader.at("reference");
  reference.allow({"name", "set"});
  row.reference = reference.at("name").text();
  row.reference_values = in_file(reference.at("name"), [&] { return find_reference(row.reference).defaults(); });
  if (reference.has("set")) set_parameters(row.reference_values, reference.at("set"));
  const JsonReader grid = reader.at("grid");
  if (grid.value().is_string()) {
    row.grid_name = grid.text();
    row.grid = in_file(grid, [&] { return Grid::named_or_file(row.grid_name, find_reference(row.reference).sphere); });
  } else {
    row.grid_name = row.name;
    row.grid = Grid::from_json(grid, find_reference(row.reference).sphere);
  }
  if (row.views == "normal_slice" && row.grid.theta_o.values != std::vector{0.0}) {
    throw grid.error("a normal_slice has views that are not normal", "write \"theta_o\": [0]");
  }
  row.quantity = in_file(reader.at("metric"), [&] { return parse_quantity(reader.at("metric").text()); });
  row.weights = in_file(reader.at("weights"), [&] { return parse_weights(reader.at("weights").text()); });
  if (std::ranges::find(row.weights, WeightFactor::inverse_variance) != row.weights.end()) {
    throw reader.at("weights").error("exact tables have no variance", "leave out inverse_variance");
  }
  for (const JsonReader& set : reader.at("free").elements()) {
    std::vector<std::string> names;
    for (const JsonReader& name : set.elements()) {
      in_file(name, [&] { return model_values.info(name.text()); });
      if (std::ranges::find(axes, name.text(), &Axis::name) != axes.end()) {
        throw name.error("'" + name.text() + "' is an axis", "an axis can't be free; leave it out");
      }
      if (std::ranges::find(names, name.text()) != names.end()) {
        throw set.error("'" + name.text() + "' is free twice", "name it once");
      }
      names.push_back(name.text());
    }
    row.free_sets.push_back(names);
  }
  return row;
}

std::string constants_text(const RecipeResultRow& row, const Recipe& recipe) {
  std::string text;
  for (const FitParameter& p : row.fit.parameters) {
    const bool published = std::any_of(recipe.published.begin(), recipe.published.end(),
                                       [&](const auto& constant) { return constant.first == p.name; });
    if (p.free && published) text += fmt::format("{}{} = {:.4f}", text.empty() ? "" : ", ", p.name, p.estimate.value);
  }
  return text;
}

/// Largest distance of a refitted constant from its published value.
double distance(const RecipeResultRow& row, const Recipe& recipe) {
  double worst = 0.0;
  for (const auto& [name, published] : recipe.published) {
    for (const FitParameter& p : row.fit.parameters) {
      if (p.free && p.name == name) worst = std::max(worst, std::abs(p.estimate.value - published));
    }
  }
  return worst;
}

std::string conclude(const Recipe& recipe, const std::vector<RecipeResultRow>& rows) {
  // Constants that every row frees first; the others are not decided here.
  std::string published, reproducing, others;
  for (const auto& [name, value] : recipe.published) {
    const bool refitted = std::ranges::all_of(recipe.rows, [&](const RecipeRow& row) {
      return std::ranges::find(row.free_sets.front(), name) != row.free_sets.front().end();
    });
    if (refitted) published += fmt::format("{}{} = {:g}", published.empty() ? "" : ", ", name, value);
  }
  for (const RecipeResultRow& row : rows) {
    // Told once per row, by its first set of constants and its exact table.
    if (row.method != "exact" || row.free != row.row->free_sets.front()) continue;
    const double off = distance(row, recipe);
    if (off <= recipe.tolerance) {
      reproducing +=
          fmt::format("{}{} ({})", reproducing.empty() ? "" : " and ", row.row->name, constants_text(row, recipe));
    } else {
      others += fmt::format("{}{} ({}; off by {:.4f})", others.empty() ? "" : ", ", row.row->name,
                            constants_text(row, recipe), off);
    }
  }
  if (reproducing.empty()) {
    return fmt::format("No row reproduces the published {} within {:g}: {}.", published, recipe.tolerance, others);
  }
  return fmt::format("The published {} are reproduced within {:g} by {}; not by {}.", published, recipe.tolerance,
                     reproducing, others.empty() ? "any other row" : others);
}

}  // namespace

RecipeKind recipe_kind(const std::filesystem::path& path) {
  const Json json = parse_json(read_file(path), path.string());
  const JsonReader reader(json, path.string());
  if (!reader.has("kind")) return RecipeKind::constants;
  const JsonReader kind = reader.at("kind");
  const auto found = std::ranges::find(recipe_kind_names, kind.text());
  if (found == recipe_kind_names.end()) {
    throw kind.error("unknown kind '" + kind.text() + "'",
                     "choose constants, curves, substrate_rules or approximations");
  }
  return static_cast<RecipeKind>(found - recipe_kind_names.begin());
}

Recipe Recipe::read(const std::filesystem::path& path) {
  const Json json = parse_json(read_file(path), path.string());
  const JsonReader reader(json, path.string());
  reader.allow({"recipe", "kind", "title", "description", "model", "fixed", "published", "axes", "samples", "facets",
                "tolerance", "rivals", "rows"});
  Recipe recipe;
  // Inner readers know their path in the document; the file's name is added here, once.
  return naming_file(path, [&] {
    recipe.name = reader.at("recipe").text();
    recipe.title = reader.at("title").text();
    recipe.description = reader.at("description").text();
    recipe.model = reader.at("model").text();
    recipe.fixed = in_file(reader.at("model"), [&] { return find_model(recipe.model).defaults(); });
    if (reader.has("fixed")) {
      set_parameters(recipe.fixed, reader.at("fixed"));
      for (const auto& [name, member] : reader.at("fixed").members()) recipe.fixed_names.push_back(name);
    }
    for (const auto& [name, member] : reader.at("published").members()) {
      in_file(member, [&] {
        ParameterValues(recipe.fixed).set(name, member.number());
        return 0;
      });
      recipe.published.emplace_back(name, member.number());
    }
    for (const auto& [name, member] : reader.at("axes").members()) {
      recipe.parameter_axes.push_back({name, "", member.numbers(), false});
    }
    if (reader.has("samples")) {
      const double samples = reader.at("samples").number();
      if (!(samples >= replicate_count && samples <= static_cast<double>(most_samples))) {
        throw reader.at("samples").error("out of range",
                                         fmt::format("choose from {} to {}", replicate_count, most_samples));
      }
      recipe.samples = static_cast<std::uint64_t>(samples);
    }
    if (reader.has("facets")) {
      const std::string facets = reader.at("facets").text();
      if (facets != "shared" && facets != "independent") {
        throw reader.at("facets").error("unknown choice '" + facets + "'", "choose shared or independent");
      }
      recipe.shared_facets = facets == "shared";
    }
    recipe.tolerance = reader.at("tolerance").number();
    if (reader.has("rivals")) {
      for (const JsonReader& rival : reader.at("rivals").elements())
        recipe.rivals.push_back(read_rival(rival, recipe.parameter_axes));
    }
    for (const JsonReader& row : reader.at("rows").elements())
      recipe.rows.push_back(read_row(row, recipe.fixed, recipe.parameter_axes));
    if (recipe.rows.empty()) throw reader.at("rows").error("the list is empty", "give at least one row");
    for (std::size_t i = 0; i < recipe.rows.size(); ++i) {
      const JsonReader row = reader.at("rows").elements()[i];
      for (std::size_t j = 0; j < i; ++j) {
        if (recipe.rows[j].name == recipe.rows[i].name) {
          throw row.at("name").error("two rows are called '" + recipe.rows[i].name + "'",
                                     "names become file names: change one");
        }
      }
      if (recipe.rows[i].free_sets.empty())
        throw row.at("free").error("the list is empty", "name the parameters to refit");
      for (const Axis& axis : recipe.parameter_axes) {
        const JsonReader place = reader.at("axes").at(axis.name);
        if (in_file(place, [&] { return !recipe.rows[i].reference_values.info(axis.name).choices.empty(); })) {
          throw place.error("'" + axis.name + "' is a choice, not a number", "make one row per choice");
        }
        in_file(place, [&] {
          for (const double value : axis.values) ParameterValues(recipe.rows[i].reference_values).set(axis.name, value);
          return 0;
        });
      }
    }
    return recipe;
  });
}

RecipeResult run_recipe(const Recipe& recipe, std::uint64_t seed, Monitor& monitor) {
  RecipeResult result;
  for (const RecipeRow& row : recipe.rows) {
    for (const char* method : {"monte_carlo", "exact"}) {
      const auto same = [&](const RecipeTable& known) {
        return known.method == method && known.row->reference == row.reference &&
               std::ranges::equal(known.row->reference_values.flat(), row.reference_values.flat()) &&
               known.row->grid.theta_i.values == row.grid.theta_i.values &&
               known.row->grid.theta_o.values == row.grid.theta_o.values &&
               known.row->grid.phi.values == row.grid.phi.values;
      };
      auto known = std::find_if(result.tables.begin(), result.tables.end(), same);
      if (known == result.tables.end()) {
        const RenderOptions options{.sampling = {.samples = recipe.samples, .seed = seed},
                                    .exact = std::string_view(method) == "exact",
                                    .shared_facets = recipe.shared_facets};
        result.tables.push_back({row.name + "." + method, &row, method,
                                 render(find_reference(row.reference), row.reference_values, recipe.parameter_axes,
                                        row.grid, options, monitor)});
        known = result.tables.end() - 1;
      }
      const Model& model = find_model(row.model);
      const Table& table = known->table;
      const std::vector<double> weights = entry_weights(table, row.weights, row.quantity);

      ParameterValues published = with_table_parameters(model.defaults(), table);
      for (const std::string& name : recipe.fixed_names) {
        published.set(name, recipe.fixed.components(recipe.fixed.info(name)));
      }
      for (const auto& [name, value] : recipe.published) published.set(name, value);
      for (const auto& [name, value] : row.fixed) published.set(name, value);
      const std::vector<float> published_values = TableModel(model, published, table).render().values;
      std::vector<RivalScore> rivals;
      for (const Rival& rival : recipe.rivals)
        rivals.push_back(score(rival, table, row.quantity, row.weights, monitor));
      for (const std::vector<std::string>& free : row.free_sets) {
        const FitOptions options{.free = free, .quantity = row.quantity, .weights = row.weights, .seed = seed};
        RecipeResultRow line{.row = &row,
                             .method = method,
                             .table = static_cast<std::size_t>(known - result.tables.begin()),
                             .free = free,
                             .published = published,
                             .fit = fit(model, published, table, options, monitor),
                             .rms_published = rms_difference(table, published_values, row.quantity, weights),
                             .published_values = published_values,
                             .rivals = rivals};
        line.refit_values = TableModel(model, line.fit.values(), table).render().values;
        line.rms_refit = rms_difference(table, line.refit_values, row.quantity, weights);
        result.rows.push_back(std::move(line));
      }
    }
  }
  result.conclusion = conclude(recipe, result.rows);
  return result;
}

Json RecipeResult::json(const Recipe& recipe, const std::string& command, std::uint64_t seed) const {
  Json lines = Json::array();
  for (const RecipeResultRow& line : rows) {
    const RecipeRow& row = *line.row;
    const Json reference = reference_json(row.reference, row.reference_values);
    Json axes = Json::object();
    for (const Axis& axis : recipe.parameter_axes) axes[axis.name] = axis.values;
    Json parameters = Json::object(), fixed = Json::object(), started = Json::object();
    for (const std::string& name : line.free) {
      const std::span<const double> value = line.published.components(line.published.info(name));
      started[name] = value.size() == 1 ? Json(value[0]) : Json(std::vector(value.begin(), value.end()));
    }
    for (const FitParameter& p : line.fit.parameters) {
      if (!p.free) {
        fixed[p.name] = p.estimate.value;
        continue;
      }
      parameters[p.name] = {{"value", p.estimate.value},
                            {"stderr", p.estimate.standard_error},
                            {"ci95", {p.estimate.ci_low, p.estimate.ci_high}},
                            {"misfit_stderr", p.estimate.misfit_standard_error},
                            {"at_bound", p.estimate.at_bound},
                            {"identifiable", p.estimate.identifiable}};
    }
    Json rms{{"published", line.rms_published}, {"refit", line.rms_refit}};
    for (const RivalScore& rival : line.rivals) rms[rival.label] = rival.rms;
    lines.push_back({{"name", row.name},
                     {"model", row.model},
                     {"reference", reference},
                     {"domain",
                      {{"views", row.views},
                       {"grid", row.grid_name},
                       {"axes", axes},
                       {"theta_i", row.grid.theta_i.values},
                       {"theta_o", row.grid.theta_o.values},
                       {"phi", row.grid.phi.values},
                       {"metric", quantity_names[static_cast<std::size_t>(row.quantity)]},
                       {"weights", weight_names(row.weights)}}},
                     {"method", line.method},
                     {"free", line.free},
                     {"fixed", fixed},
                     {"published", started},
                     {"params", parameters},
                     {"rms", rms},
                     {"identifiable", line.fit.solution.identifiable},
                     {"converged", line.fit.solution.converged},
                     {"remarks", line.fit.solution.remarks}});
  }
  Json published = Json::object();
  for (const auto& [name, value] : recipe.published) published[name] = value;
  return {{"recipe", recipe.name},
          {"title", recipe.title},
          {"description", recipe.description},
          {"published", published},
          {"rows", lines},
          {"conclusion", conclusion},
          {"provenance",
           {{"version", LOBEFIT_VERSION}, {"command", command}, {"seed", seed}, {"samples", recipe.samples}}}};
}

}  // namespace lobefit
