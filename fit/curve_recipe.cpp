#include "fit/curve_recipe.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <set>

#include "fit/dual_model.h"
#include "fit/recipe_reading.h"
#include "reference/output_file.h"
#include "reference/quiet_monitor.h"

namespace lobefit {

namespace {

// ---- Reading --------------------------------------------------------------------------------------------------

std::vector<std::string> read_names(const JsonReader& reader, const CurveRecipe& recipe) {
  std::vector<std::string> names;
  for (const JsonReader& name : reader.elements()) {
    for (const CurveModel& model : recipe.models) {
      const ParameterInfo& info =
          in_file(name, [&]() -> const ParameterInfo& { return model.values.info(name.text()); });
      if (!info.choices.empty()) throw name.error("'" + name.text() + "' is a choice, not a number", "leave it out");
    }
    if (name.text() == "alpha" || name.text() == "roughness") {
      throw name.error("'" + name.text() + "' is what the curves run over", "leave it out");
    }
    const auto known = [&](const std::vector<std::string>& list) {
      return std::ranges::find(list, name.text()) != list.end();
    };
    if (known(names) || known(recipe.free)) throw name.error("'" + name.text() + "' is free twice", "name it once");
    names.push_back(name.text());
  }
  return names;
}

bool is_free(const CurveRecipe& recipe, const std::string& name) {
  return std::ranges::find(recipe.free, name) != recipe.free.end() ||
         std::ranges::find(recipe.contested, name) != recipe.contested.end();
}

void require_free(const CurveRecipe& recipe, const std::string& name, const JsonReader& reader) {
  if (!is_free(recipe, name)) throw reader.error("'" + name + "' is never free", "name one of $.free or $.contested");
}

std::vector<FitBounds> read_bounds(const JsonReader& reader, const CurveRecipe& recipe) {
  std::vector<FitBounds> bounds;
  for (const auto& [name, member] : reader.members()) {
    require_free(recipe, name, member);
    const std::vector<double> pair = member.numbers();
    if (pair.size() != 2 || !(pair[0] < pair[1]))
      throw member.error("expected two increasing numbers", "write [lower, upper]");
    bounds.push_back({name, pair[0], pair[1]});
  }
  return bounds;
}

std::vector<double> read_alphas(const JsonReader& reader) {
  const std::vector<double> alphas = reader.numbers();
  for (std::size_t i = 0; i < alphas.size(); ++i) {
    if (!(alphas[i] >= 0.001 && alphas[i] <= 1.0)) throw reader.error("out of range", "choose from 0.001 to 1");
    if (i > 0 && alphas[i] <= alphas[i - 1]) throw reader.error("the values do not increase", "sort them");
  }
  return alphas;
}

CurveModel read_model(const JsonReader& reader) {
  reader.allow({"model", "label", "fixed", "rival", "verdict"});
  CurveModel model;
  model.model = reader.at("model").text();
  model.label = reader.at("label").text();
  model.values = in_file(reader.at("model"), [&] { return find_model(model.model).defaults(); });
  if (reader.has("fixed")) set_parameters(model.values, reader.at("fixed"));
  if (reader.has("rival")) {
    model.rival = reader.at("rival").text();
    model.verdict = reader.at("verdict").text();
  }
  if (!model.values.has("albedo")) throw reader.at("model").error("the model has no albedo", "choose one with");
  return model;
}

CurveReference read_reference(const JsonReader& reader) {
  reader.allow({"name", "reference", "set", "albedo"});
  CurveReference reference;
  reference.name = reader.at("name").text();
  reference.reference = reader.at("reference").text();
  reference.values = in_file(reader.at("reference"), [&] { return find_reference(reference.reference).defaults(); });
  if (reader.has("set")) set_parameters(reference.values, reader.at("set"));
  reference.albedos = reader.at("albedo").numbers();
  for (const double albedo : reference.albedos) {
    if (!(albedo > 0.0 && albedo <= 1.0)) throw reader.at("albedo").error("out of range", "choose above 0, up to 1");
  }
  in_file(reader, [&] {
    reference.values.set("albedo", 1.0);
    reference.values.info("alpha");
    const auto integrator = find_reference(reference.reference).make(reference.values);
    if (!integrator->has_exact() || integrator->orders() == 0) {
      throw Error(ExitCode::usage, "no exact orders of scattering", reference.reference,
                  "choose parameters with a quadrature and with orders");
    }
    return 0;
  });
  return reference;
}

CurveComparison read_comparison(const JsonReader& reader, const CurveRecipe& recipe) {
  reader.allow({"name", "reference", "set", "model", "shared", "alpha", "samples"});
  CurveComparison comparison;
  comparison.name = reader.at("name").text();
  comparison.reference = reader.at("reference").text();
  comparison.plain_values =
      in_file(reader.at("reference"), [&] { return find_reference(comparison.reference).defaults(); });
  if (reader.has("set")) set_parameters(comparison.plain_values, reader.at("set"));
  comparison.model = reader.at("model").text();
  const auto model = std::ranges::find(recipe.models, comparison.model, &CurveModel::model);
  if (model == recipe.models.end()) {
    throw reader.at("model").error("'" + comparison.model + "' is not among $.models", "choose one of them");
  }
  comparison.plain_model_values = model->values;
  comparison.plain_model_values.set("albedo", 1.0);
  comparison.values = comparison.plain_values;
  comparison.model_values = comparison.plain_model_values;
  set_parameters(comparison.values, reader.at("shared"));
  set_parameters(comparison.model_values, reader.at("shared"));
  comparison.alphas = read_alphas(reader.at("alpha"));
  if (reader.has("samples")) {
    const double samples = reader.at("samples").number();
    if (!(samples >= replicate_count && samples <= static_cast<double>(most_samples))) {
      throw reader.at("samples").error("out of range",
                                       fmt::format("choose from {} to {}", replicate_count, most_samples));
    }
    comparison.samples = static_cast<std::uint64_t>(samples);
  }
  return comparison;
}

// ---- Rows -----------------------------------------------------------------------------------------------------

/// Sets a parameter even outside its range.
void force(ParameterValues& values, std::string_view name, double value) {
  const ParameterInfo& info = values.info(name);
  for (int c = 0; c < info.components; ++c) values.flat()[static_cast<std::size_t>(info.offset + c)] = value;
}

void set_alpha(ParameterValues& values, double alpha) {
  for (const ParameterInfo& info : values.list()) {
    if (info.name == "alpha") values.set("alpha", alpha);
    if (info.perceptual_roughness) values.set(info.name, std::sqrt(alpha));
  }
}

/// A model's parameters as a fit left them.
ParameterValues fitted_values(const CurveModel& model, double alpha, const Fit& fit) {
  ParameterValues values = model.values;
  set_alpha(values, alpha);
  for (const FitParameter& p : fit.parameters) {
    if (p.free) force(values, p.name, p.estimate.value);
  }
  return values;
}

double rms_of(const Fit& fit, double albedo) { return std::sqrt(fit.solution.sum_of_squares) / albedo; }

bool at_bound(const Fit& fit) {
  return std::ranges::any_of(fit.parameters, [](const FitParameter& p) { return p.free && p.estimate.at_bound; });
}

std::vector<float> render_values(const Model& model, const ParameterValues& values, const Table& table) {
  return TableModel(model, values, table).render().values;
}

/// A table of one alpha, and a thinner one for the search among starts.
struct Slice {
  Table table, sparse;
};

Slice make_slice(const Table& table, std::size_t row) {
  Slice slice{.table = table.row_slice(row)};
  slice.sparse = slice.table;
  // Every other polar pair as on a chessboard, every third azimuth.
  for (std::size_t entry = 0; entry < slice.sparse.entries(); ++entry) {
    const bool kept = (slice.sparse.theta_i_index(entry) + slice.sparse.theta_o_index(entry)) % 2 == 0 &&
                      slice.sparse.phi_index(entry) % 3 == 0;
    if (!kept) slice.sparse.valid[entry] = 0;
  }
  return slice;
}

class SeriesFitter {
 public:
  SeriesFitter(const CurveRecipe& recipe, const CurveSeries& series, const std::vector<Slice>& slices, Monitor& monitor)
      : recipe_(recipe), series_(series), slices_(slices), monitor_(monitor), model_(find_model(series.model->model)) {
    options_ = {.free = series.free, .bounds = recipe.bounds, .quantity = recipe.quantity, .weights = recipe.weights};
  }

  /// The best of every start, of both neighbours in alpha and of the `held` rows, whose parameters are some of ours, on
  /// the sparse tables; then that one on the whole table.
  std::vector<CurveRow> rows(std::size_t series_index, const std::vector<CurveRow>* held) const {
    const std::size_t n = recipe_.alphas.size();
    std::vector<std::optional<Fit>> best(n), lowest(n);  // among the usable ones, and among all
    FitOptions search = options_;
    search.maximum_iterations = 80;
    const auto attempt = [&](std::size_t i, const ParameterValues& start) {
      const Fit candidate = fit(model_, start, slices_[i].sparse, search, monitor_);
      const auto keep_better = [&](std::optional<Fit>& kept) {
        if (!kept || candidate.solution.sum_of_squares < kept->solution.sum_of_squares) kept = candidate;
      };
      keep_better(lowest[i]);
      if (usable(candidate)) keep_better(best[i]);
    };
    const auto from_neighbour = [&](std::size_t i, std::size_t neighbour) {
      if (best[neighbour]) attempt(i, fitted_values(*series_.model, recipe_.alphas[i], *best[neighbour]));
    };
    for (std::size_t i = 0; i < n; ++i) {
      for (const auto& given : recipe_.starts) {
        ParameterValues start = series_.model->values;
        set_alpha(start, recipe_.alphas[i]);
        force(start, "albedo", series_.albedo);
        for (const auto& [name, value] : given) {
          if (std::ranges::find(series_.free, name) != series_.free.end()) force(start, name, value);
        }
        attempt(i, start);
      }
      if (i > 0) from_neighbour(i, i - 1);
      if (held) attempt(i, fitted_values(*series_.model, recipe_.alphas[i], (*held)[i].fit));
    }
    for (std::size_t i = n - 1; i-- > 0;) from_neighbour(i, i + 1);
    std::vector<CurveRow> result;
    for (std::size_t i = 0; i < n; ++i) {
      const double alpha = recipe_.alphas[i];
      const Table& table = slices_[i].table;
      const auto polish = [&](const Fit& from, const FitOptions& options) {
        return fit(model_, inside(fitted_values(*series_.model, alpha, from), options), table, options, monitor_);
      };
      std::optional<Fit> chosen;
      const auto offer = [&](Fit candidate) {
        const bool better = !chosen || candidate.solution.sum_of_squares < chosen->solution.sum_of_squares;
        if (better && usable(candidate)) chosen = std::move(candidate);
      };
      if (best[i]) offer(polish(*best[i], options_));
      if (!chosen) {
        // No minimum in the usable range: its border has the lowest place.
        if (i > 0) offer(polish(result[i - 1].fit, within_usable()));
        if (held) offer(polish((*held)[i].fit, within_usable()));
        if (!chosen) offer(polish(*lowest[i], within_usable()));
      }
      CurveRow row{.series = series_index, .alpha = i, .fit = std::move(*chosen)};
      row.rms = rms_of(row.fit, series_.albedo);
      FitOptions brief = options_;
      brief.maximum_iterations = 60;
      Fit anywhere = polish(*lowest[i], brief);
      row.rms_lowest = rms_of(anywhere, series_.albedo);
      if (row.rms_lowest < 0.995 * row.rms) row.lowest = std::move(anywhere);
      ParameterValues plain = series_.model->values;
      set_alpha(plain, alpha);
      force(plain, "albedo", series_.albedo);
      row.rms_default = rms_difference(table, render_values(model_, plain, table), recipe_.quantity,
                                       entry_weights(table, recipe_.weights, recipe_.quantity)) /
                        series_.albedo;
      if (at_bound(row.fit) && !recipe_.wide_bounds.empty()) {
        FitOptions wide = brief;
        wide.bounds = recipe_.wide_bounds;
        for (const FitBounds& bounds : recipe_.bounds) {
          if (std::ranges::find(wide.bounds, bounds.name, &FitBounds::name) == wide.bounds.end())
            wide.bounds.push_back(bounds);
        }
        row.beyond = fit(model_, fitted_values(*series_.model, alpha, row.fit), table, wide, monitor_);
        row.rms_beyond = rms_of(*row.beyond, series_.albedo);
      }
      result.push_back(std::move(row));
    }
    return result;
  }

 private:
  FitOptions within_usable() const {
    FitOptions options = options_;
    for (FitBounds bounds : recipe_.usable) {
      if (bounds.name == "albedo") {
        bounds.lower *= series_.albedo;
        bounds.upper *= series_.albedo;
      }
      std::erase_if(options.bounds, [&](const FitBounds& own) { return own.name == bounds.name; });
      options.bounds.push_back(bounds);
    }
    return options;
  }

  bool usable(const Fit& fit) const {
    return std::ranges::all_of(within_usable().bounds, [&](const FitBounds& bounds) {
      const auto p = std::ranges::find(fit.parameters, bounds.name, &FitParameter::name);
      return !p->free || (p->estimate.value >= bounds.lower && p->estimate.value <= bounds.upper);
    });
  }

  /// Moves the free parameters inside the bounds.
  ParameterValues inside(ParameterValues values, const FitOptions& options) const {
    for (const FitBounds& bounds : options.bounds) {
      if (std::ranges::find(series_.free, bounds.name) != series_.free.end())
        force(values, bounds.name, std::clamp(values.get(bounds.name), bounds.lower, bounds.upper));
    }
    return values;
  }

  const CurveRecipe& recipe_;
  const CurveSeries& series_;
  const std::vector<Slice>& slices_;
  Monitor& monitor_;
  const Model& model_;
  FitOptions options_;
};

// ---- Curves ---------------------------------------------------------------------------------------------------

/// All alphas of a series at once. A curve's variables are its values at three alphas, which are of one size and far
/// less correlated than its coefficients.
class CurveProblem {
 public:
  CurveProblem(const CurveRecipe& recipe, const CurveSeries& series, const std::vector<Slice>& slices, bool sparse)
      : recipe_(recipe),
        parameters_(series.free.size()),
        dual_(dual_model(find_model(series.model->model))),
        variable_of_slot_(series.model->values.flat().size(), -1) {
    const double first = std::sqrt(recipe.alphas.front()), last = std::sqrt(recipe.alphas.back());
    nodes_ = {first, 0.5 * (first + last), last};
    for (std::size_t p = 0; p < parameters_; ++p) {
      const ParameterInfo& info = series.model->values.info(series.free[p]);
      for (int c = 0; c < info.components; ++c)
        variable_of_slot_[static_cast<std::size_t>(info.offset + c)] = static_cast<int>(p);
      const auto given = std::ranges::find(recipe.bounds, series.free[p], &FitBounds::name);
      lower_.push_back(given != recipe.bounds.end() ? given->lower : info.lower);
      upper_.push_back(given != recipe.bounds.end() ? given->upper : info.upper);
    }
    for (std::size_t i = 0; i < recipe.alphas.size(); ++i) {
      const Table& table = sparse ? slices[i].sparse : slices[i].table;
      const std::vector<double> weights = entry_weights(table, recipe.weights, recipe.quantity);
      Line line{.basis = basis(std::sqrt(recipe.alphas[i])), .first_residual = residuals_};
      ParameterValues values = series.model->values;
      set_alpha(values, recipe.alphas[i]);
      line.flat.assign(values.flat().begin(), values.flat().end());
      for (std::size_t entry = 0; entry < table.entries(); ++entry) {
        if (weights[entry] == 0.0) continue;
        line.wi.push_back(table.wi(entry));
        line.wo.push_back(table.wo(entry));
        line.root_weight.push_back(std::sqrt(weights[entry]) / series.albedo);
        line.target.push_back(transform(recipe.quantity, table.value(entry), line.wi.back().z).value);
      }
      residuals_ += line.wi.size();
      lines_.push_back(std::move(line));
    }
  }

  /// Curves through the rows' values, as nearly as three numbers each can.
  std::vector<double> start(const std::vector<CurveRow>& rows) const {
    std::vector<double> x;
    for (std::size_t p = 0; p < parameters_; ++p) {
      // Normal equations of the node values, solved by elimination; two alphas or fewer have too little to say.
      std::array<std::array<double, 4>, 3> m{};
      for (std::size_t i = 0; i < lines_.size(); ++i) {
        const double value = free_value(rows[i].fit, p);
        for (std::size_t k = 0; k < 3; ++k) {
          for (std::size_t l = 0; l < 3; ++l) m[k][l] += lines_[i].basis[k] * lines_[i].basis[l];
          m[k][3] += lines_[i].basis[k] * value;
        }
      }
      for (std::size_t k = 0; k < 3; ++k) m[k][k] += 1e-9;
      for (std::size_t k = 0; k < 3; ++k) {
        for (std::size_t l = 0; l < 3; ++l) {
          if (l == k) continue;
          const double factor = m[l][k] / m[k][k];
          for (std::size_t c = k; c < 4; ++c) m[l][c] -= factor * m[k][c];
        }
      }
      for (std::size_t k = 0; k < 3; ++k) x.push_back(m[k][3] / m[k][k]);
    }
    return x;
  }

  /// Minimises the mean over alphas of importance × (rms/rms of the row)².
  std::vector<double> solve(std::vector<double> start, const std::vector<double>& importance, Monitor& monitor) const {
    LeastSquaresProblem problem;
    problem.residual_count = residuals_;
    problem.start = std::move(start);
    problem.maximum_iterations = 60;
    for (std::size_t k = 0; k < 3 * parameters_; ++k) {
      problem.names.push_back(fmt::format("{}", k));
      problem.lower.push_back(-std::numeric_limits<double>::infinity());
      problem.upper.push_back(std::numeric_limits<double>::infinity());
    }
    problem.evaluate = [&](std::span<const double> x, std::span<double> residuals, double* jacobian) {
      return evaluate(x, importance, residuals, jacobian);
    };
    std::vector<double> x;
    for (const FittedVariable& variable : lobefit::solve(problem, monitor).variables) x.push_back(variable.value);
    return x;
  }

  /// rms of the curves at every alpha.
  std::vector<double> rms(std::span<const double> x) const {
    std::vector<double> residuals(residuals_), result;
    evaluate(x, std::vector<double>(lines_.size(), 1.0), residuals, nullptr);
    for (const Line& line : lines_) {
      double sum = 0.0;
      for (std::size_t k = 0; k < line.wi.size(); ++k) sum += square(residuals[line.first_residual + k]);
      result.push_back(std::sqrt(sum));
    }
    return result;
  }

  Curve curve(const std::string& name, std::size_t p, std::span<const double> x) const {
    // Σ v_k Π_{l≠k} (r - r_l)/(r_k - r_l), expanded.
    Curve result{.parameter = name, .coefficients = {}, .lower = lower_[p], .upper = upper_[p]};
    for (std::size_t k = 0; k < 3; ++k) {
      const double a = nodes_[(k + 1) % 3], b = nodes_[(k + 2) % 3];
      const double v = x[3 * p + k] / ((nodes_[k] - a) * (nodes_[k] - b));
      result.coefficients[0] += v * a * b;
      result.coefficients[1] -= v * (a + b);
      result.coefficients[2] += v;
    }
    return result;
  }

 private:
  struct Line {
    std::array<double, 3> basis;
    std::size_t first_residual;
    std::vector<double> flat;
    std::vector<Direction> wi, wo;
    std::vector<double> root_weight, target;
  };

  double free_value(const Fit& fit, std::size_t parameter) const {
    for (const FitParameter& p : fit.parameters) {
      if (p.free && parameter-- == 0) return p.estimate.value;
    }
    return 0.0;
  }

  std::array<double, 3> basis(double r) const {
    std::array<double, 3> result;
    for (std::size_t k = 0; k < 3; ++k) {
      const double a = nodes_[(k + 1) % 3], b = nodes_[(k + 2) % 3];
      result[k] = (r - a) * (r - b) / ((nodes_[k] - a) * (nodes_[k] - b));
    }
    return result;
  }

  bool evaluate(std::span<const double> x, const std::vector<double>& importance, std::span<double> residuals,
                double* jacobian) const {
    std::vector<char> finite(lines_.size(), 1);
    tbb::parallel_for(std::size_t{0}, lines_.size(), [&](std::size_t index) {
      const Line& line = lines_[index];
      const std::size_t n = line.wi.size();
      std::vector<double> flat = line.flat, inside(parameters_);
      for (std::size_t p = 0; p < parameters_; ++p) {
        double value = 0.0;
        for (std::size_t k = 0; k < 3; ++k) value += line.basis[k] * x[3 * p + k];
        inside[p] = value >= lower_[p] && value <= upper_[p] ? 1.0 : 0.0;
        for (std::size_t slot = 0; slot < flat.size(); ++slot) {
          if (variable_of_slot_[slot] == static_cast<int>(p)) flat[slot] = std::clamp(value, lower_[p], upper_[p]);
        }
      }
      std::vector<double> values(n), derivatives(n * dual_width);
      dual_.evaluate(flat, variable_of_slot_, 0, line.wi, line.wo, 1, values.data(), derivatives.data());
      const double root = std::sqrt(importance[index]);
      for (std::size_t i = 0; i < n; ++i) {
        const ValueAndSlope model = transform(recipe_.quantity, values[i], line.wi[i].z);
        const double weight = root * line.root_weight[i];
        const std::size_t row = line.first_residual + i;
        residuals[row] = weight * (model.value - line.target[i]);
        if (!std::isfinite(residuals[row])) finite[index] = 0;
        if (!jacobian) continue;
        for (std::size_t p = 0; p < parameters_; ++p) {
          const double slope = weight * model.slope * inside[p] * derivatives[i * dual_width + p];
          for (std::size_t k = 0; k < 3; ++k) jacobian[row * 3 * parameters_ + 3 * p + k] = slope * line.basis[k];
        }
      }
    });
    return std::ranges::all_of(finite, [](char f) { return f != 0; });
  }

  const CurveRecipe& recipe_;
  std::size_t parameters_;
  const DualModel& dual_;
  std::vector<int> variable_of_slot_;
  std::array<double, 3> nodes_;
  std::vector<double> lower_, upper_;
  std::vector<Line> lines_;
  std::size_t residuals_ = 0;
};

double worst_loss(const std::vector<double>& rms, const std::vector<CurveRow>& rows) {
  double worst = 0.0;
  for (std::size_t i = 0; i < rms.size(); ++i) worst = std::max(worst, rms[i] / rows[i].rms - 1.0);
  return worst;
}

void fit_curves(const CurveRecipe& recipe, const std::vector<Slice>& slices, const std::vector<CurveRow>& rows,
                CurveSeries& series, Monitor& monitor) {
  const CurveProblem sparse(recipe, series, slices, true), whole(recipe, series, slices, false);
  std::vector<double> importance;
  for (const CurveRow& row : rows) importance.push_back(1.0 / (square(row.rms) * static_cast<double>(rows.size())));
  // Rounds that give more weight to the alphas that lose most, until all lose little enough.
  constexpr int most_rounds = 4;
  std::vector<double> x = sparse.start(rows), best;
  double best_loss = std::numeric_limits<double>::infinity();
  for (int round = 0; round < most_rounds && !(best_loss <= 0.6 * recipe.tolerance); ++round) {
    x = sparse.solve(std::move(x), importance, monitor);
    const std::vector<double> rms = whole.rms(x);
    const double loss = worst_loss(rms, rows);
    if (loss < best_loss) {
      best_loss = loss;
      best = x;
    }
    double sum = 0.0;
    for (std::size_t i = 0; i < rows.size(); ++i) {
      importance[i] *= square(rms[i] / rows[i].rms);
      sum += importance[i] * square(rows[i].rms);
    }
    for (double& weight : importance) weight /= sum;
  }
  for (std::size_t p = 0; p < series.free.size(); ++p) series.curves.push_back(whole.curve(series.free[p], p, best));
  series.rms = whole.rms(best);
  series.worst_loss = best_loss;
}

// ---- Comparisons ----------------------------------------------------------------------------------------------

void compare(const CurveRecipe& recipe, const CurveComparison& comparison, std::uint64_t seed, Monitor& monitor,
             std::vector<ComparisonRow>& rows) {
  const std::vector<Axis> axes{{"alpha", "", comparison.alphas, false}};
  const RenderOptions options{.sampling = {.samples = comparison.samples, .seed = seed}};
  const Reference& reference = find_reference(comparison.reference);
  const Model& model = find_model(comparison.model);
  const Table with = render(reference, comparison.values, axes, recipe.grid, options, monitor);
  const Table plain = render(reference, comparison.plain_values, axes, recipe.grid, options, monitor);
  for (std::size_t i = 0; i < comparison.alphas.size(); ++i) {
    const Table with_slice = with.row_slice(i), plain_slice = plain.row_slice(i);
    const std::vector<double> weights = entry_weights(with_slice, recipe.weights, recipe.quantity);
    const auto rms = [&](const Table& table, std::span<const float> values) {
      return rms_difference(table, values, recipe.quantity, weights);
    };
    ParameterValues model_values = comparison.model_values, plain_model_values = comparison.plain_model_values;
    set_alpha(model_values, comparison.alphas[i]);
    set_alpha(plain_model_values, comparison.alphas[i]);
    const std::vector<float> model_with = render_values(model, model_values, with_slice);
    const std::vector<float> model_plain = render_values(model, plain_model_values, plain_slice);
    std::vector<float> carried_over = plain_slice.values;
    for (std::size_t k = 0; k < carried_over.size(); ++k) carried_over[k] += model_with[k] - model_plain[k];
    rows.push_back({.comparison = &comparison,
                    .alpha = comparison.alphas[i],
                    .rms = rms(with_slice, model_with),
                    .rms_plain = rms(plain_slice, model_plain),
                    .rms_effect = rms(with_slice, plain_slice.values),
                    .rms_missed = rms(with_slice, carried_over)});
  }
}

// ---- Conclusion -----------------------------------------------------------------------------------------------

struct Extremes {
  double least = std::numeric_limits<double>::infinity(), most = -std::numeric_limits<double>::infinity();

  void include(double value) {
    least = std::min(least, value);
    most = std::max(most, value);
  }
  std::string text(const char* unit = "") const {
    const std::string low = fmt::format("{:.2f}", least), high = fmt::format("{:.2f}", most);
    return low == high ? low + unit : low + " to " + high + unit;
  }
};

/// The series of these whose contested parameters are free.
std::optional<std::size_t> find_series(const CurveResult& result, const std::string& model,
                                       const CurveReference* reference, double albedo) {
  for (std::size_t s = 0; s < result.series.size(); ++s) {
    const CurveSeries& series = result.series[s];
    if (series.model->model == model && series.reference == reference && series.albedo == albedo &&
        series.contested_free)
      return s;
  }
  return std::nullopt;
}

std::string conclude(const CurveRecipe& recipe, const CurveResult& result) {
  const CurveReference& first_reference = recipe.references.front();
  std::string text =
      fmt::format("What the claim \"{}\" is worth: held at their values rather than freed, the {} ", recipe.claim,
                  recipe.contested_name) +
      fmt::format("parameters multiply the rms against {} (against all references) by", first_reference.name);
  bool matters = false;
  for (const CurveModel& model : recipe.models) {
    Extremes first, all;
    for (std::size_t s = 0; s < result.series.size(); s += 2) {
      const CurveSeries& series = result.series[s];
      if (series.model != &model) continue;
      for (std::size_t i = 0; i < recipe.alphas.size(); ++i) {
        const double ratio = result.row(s + 1, i, recipe).rms / result.row(s, i, recipe).rms;
        if (series.reference == &first_reference) first.include(ratio);
        all.include(ratio);
      }
    }
    const bool lead = &model == &recipe.models.front();
    if (lead) matters = first.most > 1.25;
    text += fmt::format("{} {} ({}) in the {}", lead ? "" : ";", first.text(), all.text(), model.label);
  }
  text += fmt::format(". In the {} {}. ", recipe.models.front().label,
                      matters ? "they matter: the claim does not hold there" : "they matter little: the claim holds");

  for (const CurveModel& model : recipe.models) {
    if (model.rival.empty()) continue;
    for (const CurveReference& reference : recipe.references) {
      Extremes ratios;
      for (const double albedo : reference.albedos) {
        const auto own = find_series(result, model.model, &reference, albedo),
                   rival = find_series(result, model.rival, &reference, albedo);
        for (std::size_t i = 0; own && rival && i < recipe.alphas.size(); ++i) {
          const double a = result.row(*own, i, recipe).rms, b = result.row(*rival, i, recipe).rms;
          ratios.include(a / b);
        }
      }
      text += fmt::format("Against {}, the rms of the {} is {} times that of {}{}. ", reference.name, model.label,
                          ratios.text(), model.rival, ratios.least > 1.0 ? ": " + model.verdict : "");
    }
  }
  for (const CurveComparison& comparison : recipe.comparisons) {
    Extremes share;
    for (const ComparisonRow& row : result.comparisons) {
      if (row.comparison == &comparison) share.include(row.rms_missed / row.rms_effect);
    }
    text += fmt::format(
        "{}: what the parameters do to {} misses what they do to the reference by {} times that effect: {}negligible. ",
        comparison.name, comparison.model, share.text(), share.most < 0.1 ? "" : "not ");
  }
  const CurveSeries& lead = result.series.front();
  for (const std::string& name : lead.free) {
    Extremes alphas, beyond;
    double bound = 0.0, gain = 0.0;
    for (std::size_t i = 0; i < recipe.alphas.size(); ++i) {
      const CurveRow& row = result.row(0, i, recipe);
      const auto p = std::ranges::find(row.fit.parameters, name, &FitParameter::name);
      if (!p->estimate.at_bound) continue;
      bound = p->estimate.value;
      alphas.include(recipe.alphas[i]);
      if (!row.beyond) continue;
      beyond.include(std::ranges::find(row.beyond->parameters, name, &FitParameter::name)->estimate.value);
      gain = std::max(gain, 100.0 * (1.0 - row.rms_beyond / row.rms));
    }
    if (!(alphas.most >= alphas.least)) continue;
    text += fmt::format("{} lies on its bound {:g} for alpha from {}", name, bound, alphas.text());
    if (beyond.most >= beyond.least) {
      text += fmt::format("; without bounds it would be {}, and the rms up to {:.0f} % lower", beyond.text(), gain);
    }
    text += ". ";
  }
  text += fmt::format("The curves of {} against {} lose at most {:.1f} % against the fits alpha by alpha.",
                      lead.model->model, lead.reference->name, 100.0 * lead.worst_loss);
  return text;
}

Json parameters_json(const Fit& fit) {
  Json json = Json::object();
  for (const FitParameter& p : fit.parameters) {
    if (p.free) json[p.name] = estimate_json(p);
  }
  return json;
}

/// 1, "all" or whatever the reference's bounces are: a number where it is one.
Json bounces_json(const CurveReference& reference) {
  if (!reference.values.has("bounces")) return nullptr;
  const std::string text(reference.values.choice("bounces"));
  return text.find_first_not_of("0123456789") == std::string::npos ? Json(std::stoi(text)) : Json(text);
}

}  // namespace

double Curve::at(double alpha) const {
  const double value = coefficients[0] + coefficients[1] * std::sqrt(alpha) + coefficients[2] * alpha;
  return std::clamp(value, lower, upper);
}

CurveRecipe CurveRecipe::read(const std::filesystem::path& path) {
  const Json json = parse_json(read_file(path), path.string());
  const JsonReader reader(json, path.string());
  reader.allow({"recipe", "kind", "title", "description", "alpha", "grid", "metric", "weights", "references", "models",
                "free", "contested", "bounds", "wide_bounds", "usable", "starts", "tolerance", "comparisons"});
  return naming_file(path, [&] {
    CurveRecipe recipe;
    recipe.name = reader.at("recipe").text();
    recipe.title = reader.at("title").text();
    recipe.description = reader.at("description").text();
    recipe.alphas = read_alphas(reader.at("alpha"));
    const JsonReader grid = reader.at("grid");
    recipe.grid_name = grid.value().is_string() ? grid.text() : recipe.name;
    recipe.grid = grid.value().is_string() ? in_file(grid, [&] { return Grid::named_or_file(grid.text()); })
                                           : Grid::from_json(grid);
    recipe.quantity = in_file(reader.at("metric"), [&] { return parse_quantity(reader.at("metric").text()); });
    recipe.weights = in_file(reader.at("weights"), [&] { return parse_weights(reader.at("weights").text()); });
    if (std::ranges::find(recipe.weights, WeightFactor::inverse_variance) != recipe.weights.end()) {
      throw reader.at("weights").error("exact tables have no variance", "leave out inverse_variance");
    }
    std::set<std::string> names;
    const auto require_new = [&](const std::string& name, const JsonReader& place) {
      if (!names.insert(name).second) throw place.error("'" + name + "' comes twice", "change one");
    };
    for (const JsonReader& reference : reader.at("references").elements()) {
      recipe.references.push_back(read_reference(reference));
      require_new(recipe.references.back().name, reference.at("name"));
    }
    if (recipe.references.empty()) throw reader.at("references").error("the list is empty", "give at least one");
    for (const JsonReader& model : reader.at("models").elements()) {
      recipe.models.push_back(read_model(model));
      require_new(recipe.models.back().model, model.at("model"));
    }
    if (recipe.models.empty()) throw reader.at("models").error("the list is empty", "give at least one");
    for (const JsonReader& model : reader.at("models").elements()) {
      if (!model.has("rival")) continue;
      if (std::ranges::find(recipe.models, model.at("rival").text(), &CurveModel::model) == recipe.models.end()) {
        throw model.at("rival").error("'" + model.at("rival").text() + "' is not among $.models", "choose one of them");
      }
    }
    recipe.free = read_names(reader.at("free"), recipe);
    if (recipe.free.empty()) throw reader.at("free").error("the list is empty", "name the parameters to fit");
    const JsonReader contested = reader.at("contested");
    contested.allow({"name", "parameters", "claim"});
    recipe.contested_name = contested.at("name").text();
    recipe.claim = contested.at("claim").text();
    recipe.contested = read_names(contested.at("parameters"), recipe);
    if (recipe.contested.empty())
      throw contested.at("parameters").error("the list is empty", "name the contested ones");
    if (recipe.free.size() + recipe.contested.size() > static_cast<std::size_t>(dual_width)) {
      throw reader.at("free").error("too many parameters", fmt::format("free at most {}", dual_width));
    }
    if (reader.has("bounds")) recipe.bounds = read_bounds(reader.at("bounds"), recipe);
    if (reader.has("wide_bounds")) recipe.wide_bounds = read_bounds(reader.at("wide_bounds"), recipe);
    if (reader.has("usable")) recipe.usable = read_bounds(reader.at("usable"), recipe);
    for (const JsonReader& start : reader.at("starts").elements()) {
      std::vector<std::pair<std::string, double>> values;
      for (const auto& [name, member] : start.members()) {
        require_free(recipe, name, member);
        in_file(member, [&, &name = name, &member = member] {
          ParameterValues(recipe.models.front().values).set(name, member.number());
          return 0;
        });
        values.emplace_back(name, member.number());
      }
      recipe.starts.push_back(std::move(values));
    }
    if (recipe.starts.empty())
      throw reader.at("starts").error("the list is empty", "give at least one start, {} will do");
    recipe.tolerance = reader.at("tolerance").number();
    if (!(recipe.tolerance >= 0.0)) throw reader.at("tolerance").error("out of range", "choose 0 or more");
    if (reader.has("comparisons")) {
      for (const JsonReader& comparison : reader.at("comparisons").elements()) {
        recipe.comparisons.push_back(read_comparison(comparison, recipe));
        require_new(recipe.comparisons.back().name, comparison.at("name"));
      }
    }
    return recipe;
  });
}

CurveResult run_recipe(const CurveRecipe& recipe, std::uint64_t seed, Monitor& monitor) {
  CurveResult result;
  const std::vector<Axis> axes{{"alpha", "", recipe.alphas, false}};
  std::vector<std::vector<Slice>> slices;  // per reference and albedo
  std::vector<std::size_t> slices_of_series;
  for (const CurveReference& reference : recipe.references) {
    Table table = render(find_reference(reference.reference), reference.values, axes, recipe.grid,
                         {.exact = true, .orders = true}, monitor);
    for (const double albedo : reference.albedos) {
      Table coloured = table.with_albedo({albedo, albedo, albedo});
      coloured.orders = 0;  // of no use to fits, and most of the memory
      coloured.order_values.clear();
      coloured.order_stderr.clear();
      slices.emplace_back();
      for (std::size_t i = 0; i < recipe.alphas.size(); ++i) slices.back().push_back(make_slice(coloured, i));
      for (const CurveModel& model : recipe.models) {
        for (const bool contested_free : {true, false}) {
          CurveSeries series{.model = &model,
                             .reference = &reference,
                             .albedo = albedo,
                             .contested_free = contested_free,
                             .free = recipe.free};
          if (contested_free) series.free.insert(series.free.end(), recipe.contested.begin(), recipe.contested.end());
          // A fit takes its variables in the model's order of parameters.
          std::ranges::sort(series.free, {}, [&](const std::string& name) { return model.values.info(name).offset; });
          result.series.push_back(std::move(series));
          slices_of_series.push_back(slices.size() - 1);
        }
      }
    }
    result.tables.push_back({reference.name, std::move(table)});
  }

  QuietMonitor listener(monitor);
  std::vector<std::vector<CurveRow>> rows(result.series.size());
  const auto fit_series = [&](std::size_t s, const std::vector<CurveRow>* held) {
    const std::vector<Slice>& own = slices[slices_of_series[s]];
    rows[s] = SeriesFitter(recipe, result.series[s], own, listener).rows(s, held);
    fit_curves(recipe, own, rows[s], result.series[s], listener);
    monitor.advance(1);
  };
  monitor.begin("fit " + recipe.name, result.series.size());
  // Series come in pairs: free, held.
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, result.series.size() / 2, 1),
      [&](const auto& range) {
        for (std::size_t pair = range.begin(); pair < range.end(); ++pair) {
          fit_series(2 * pair + 1, nullptr);
          fit_series(2 * pair, &rows[2 * pair + 1]);
        }
      },
      tbb::simple_partitioner());
  monitor.end();
  for (std::vector<CurveRow>& part : rows) std::ranges::move(part, std::back_inserter(result.rows));
  for (const CurveComparison& comparison : recipe.comparisons)
    compare(recipe, comparison, seed, monitor, result.comparisons);
  result.conclusion = conclude(recipe, result);
  return result;
}

Table series_table(const CurveRecipe& recipe, const CurveResult& result, const CurveSeries& series) {
  const auto reference = static_cast<std::size_t>(series.reference - recipe.references.data());
  return result.tables[reference].table.with_albedo({series.albedo, series.albedo, series.albedo});
}

std::vector<float> series_values(const CurveRecipe& recipe, const CurveResult& result, std::size_t series) {
  const CurveSeries& line = result.series[series];
  const Table table = series_table(recipe, result, line);
  std::vector<float> values;
  for (std::size_t i = 0; i < recipe.alphas.size(); ++i) {
    const ParameterValues fitted = fitted_values(*line.model, recipe.alphas[i], result.row(series, i, recipe).fit);
    const std::vector<float> part = render_values(find_model(line.model->model), fitted, table.row_slice(i));
    values.insert(values.end(), part.begin(), part.end());
  }
  return values;
}

Json CurveResult::json(const CurveRecipe& recipe, const std::string& command, std::uint64_t seed) const {
  const Json domain{{"views", "all"},
                    {"grid", recipe.grid_name},
                    {"theta_i", recipe.grid.theta_i.values},
                    {"theta_o", recipe.grid.theta_o.values},
                    {"phi", recipe.grid.phi.values},
                    {"metric", quantity_names[static_cast<std::size_t>(recipe.quantity)]},
                    {"weights", weight_names(recipe.weights)}};
  const auto tangent = [](bool contested_free) { return contested_free ? "free" : "fixed"; };
  Json row_list = Json::array(), curve_list = Json::array(), comparison_list = Json::array();
  for (const CurveRow& row : rows) {
    const CurveSeries& own = series[row.series];
    Json reference = reference_json(own.reference->reference, own.reference->values);
    if (reference.contains("bounces")) reference["bounces"] = bounces_json(*own.reference);
    Json fixed = Json::object();
    for (const FitParameter& p : row.fit.parameters) {
      if (!p.free) fixed[p.name] = p.estimate.value;
    }
    Json line{{"model", own.model->model},
              {"table", own.reference->name},
              {"reference", reference},
              {"domain", domain},
              {"method", "exact"},
              {recipe.contested_name, tangent(own.contested_free)},
              {"bounces", bounces_json(*own.reference)},
              {"albedo", own.albedo},
              {"alpha", recipe.alphas[row.alpha]},
              {"free", own.free},
              {"fixed", fixed},
              {"params", parameters_json(row.fit)},
              {"rms", {{"published", row.rms_default}, {"refit", row.rms}, {"curve", own.rms[row.alpha]}}},
              {"at_bound", at_bound(row.fit)},
              {"identifiable", row.fit.solution.identifiable},
              {"correlation", row.fit.solution.correlation},
              {"history", row.fit.solution.history},
              {"converged", row.fit.solution.converged},
              {"remarks", row.fit.solution.remarks}};
    if (row.lowest) {
      line["lowest"] = {{"params", parameters_json(*row.lowest)},
                        {"rms", row.rms_lowest},
                        {"converged", row.lowest->solution.converged}};
    }
    if (row.beyond) {
      line["beyond_bounds"] = {{"params", parameters_json(*row.beyond)},
                               {"rms", row.rms_beyond},
                               {"converged", row.beyond->solution.converged}};
    }
    row_list.push_back(std::move(line));
  }
  for (const CurveSeries& own : series) {
    Json curves = Json::object();
    for (const Curve& curve : own.curves) {
      curves[curve.parameter] = {{"coefficients", curve.coefficients}, {"lower", curve.lower}, {"upper", curve.upper}};
    }
    curve_list.push_back({{"model", own.model->model},
                          {"table", own.reference->name},
                          {recipe.contested_name, tangent(own.contested_free)},
                          {"bounces", bounces_json(*own.reference)},
                          {"albedo", own.albedo},
                          {"form", "clamp(c0 + c1 sqrt(alpha) + c2 alpha, lower, upper)"},
                          {"parameters", curves},
                          {"alpha", recipe.alphas},
                          {"rms", own.rms},
                          {"worst_loss", own.worst_loss},
                          {"within_tolerance", own.worst_loss <= recipe.tolerance}});
  }
  for (const ComparisonRow& row : comparisons) {
    comparison_list.push_back({{"name", row.comparison->name},
                               {"model", row.comparison->model},
                               {"reference", reference_json(row.comparison->reference, row.comparison->values)},
                               {"method", "monte_carlo"},
                               {"samples", row.comparison->samples},
                               {"alpha", row.alpha},
                               {"rms",
                                {{"shipped", row.rms},
                                 {"plain", row.rms_plain},
                                 {"effect", row.rms_effect},
                                 {"missed_effect", row.rms_missed}}}});
  }
  return {{"recipe", recipe.name},
          {"title", recipe.title},
          {"description", recipe.description},
          {"contested", recipe.contested_name},
          {"rows", row_list},
          {"curves", curve_list},
          {"comparisons", comparison_list},
          {"tolerance", recipe.tolerance},
          {"conclusion", conclusion},
          {"provenance", {{"version", LOBEFIT_VERSION}, {"command", command}, {"seed", seed}}}};
}

}  // namespace lobefit
