#include "evaluate/parameter_storage.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

#include "evaluate/gbuffer_error.h"

namespace lobefit {

namespace {

/// Pairs with their weights and the cosines that their values are taken by.
struct WeightedPairs {
  std::vector<Direction> wi, wo;
  std::vector<double> weights, cosines;

  explicit WeightedPairs(const ModelInfo& info) {
    const bool hair = is_hair(info.kind), sphere = hair || info.transmits;
    Table table = gbuffer_directions();
    if (sphere || !info.isotropic) {
      table.grid = Grid::named_or_file("default", sphere);
      table.allocate();
    }
    const std::vector<double> sines =
        entry_weights(table, {WeightFactor::sin_theta_i, WeightFactor::sin_theta_o}, Quantity::log);
    const int turns = info.isotropic || hair ? 1 : 4;
    for (int turn = 0; turn < turns; ++turn) {
      const double angle = radians(45.0 * turn), c = std::cos(angle), s = std::sin(angle);
      const auto turned = [&](const Direction& w) { return Direction{c * w.x - s * w.y, s * w.x + c * w.y, w.z}; };
      for (std::size_t entry = 0; entry < table.entries(); ++entry) {
        if (sines[entry] == 0.0) continue;
        wi.push_back(turned(table.wi(entry)));
        wo.push_back(turned(table.wo(entry)));
        weights.push_back(sines[entry] / turns);
        cosines.push_back(hair ? 1.0 : std::abs(wi.back().z));
      }
    }
  }
};

/// What one parameter set adds.
struct SetErrors {
  QuantityErrors together{};          // squares
  std::vector<QuantityErrors> alone;  // squares, of each parameter
  std::vector<double> largest;
  std::vector<bool> overflows;
  std::uint64_t non_finite = 0;
};

QuantityErrors squares(const WeightedPairs& pairs, const std::vector<Rgb>& truth, const std::vector<Rgb>& found,
                       std::uint64_t& non_finite) {
  QuantityErrors sums{};
  for (std::size_t k = 0; k < truth.size(); ++k) {
    const std::array expected{truth[k].x, truth[k].y, truth[k].z}, values{found[k].x, found[k].y, found[k].z};
    for (std::size_t c = 0; c < 3; ++c) {
      if (!std::isfinite(expected[c]) || !std::isfinite(values[c])) {
        ++non_finite;
        continue;
      }
      if (expected[c] == values[c]) continue;
      for (std::size_t q = 0; q < sums.size(); ++q) {
        const auto quantity = static_cast<Quantity>(q);
        sums[q] += pairs.weights[k] / 3.0 *
                   square(transform(quantity, values[c], pairs.cosines[k]).value -
                          transform(quantity, expected[c], pairs.cosines[k]).value);
      }
    }
  }
  return sums;
}

SetErrors errors_of_set(const Model& model, const ParameterValues& values, const StorageChoice& choice,
                        const WeightedPairs& pairs) {
  const auto render = [&](std::span<const double> flat) {
    std::vector<Rgb> rendered(pairs.wi.size());
    model.evaluate_all(flat, pairs.wi, pairs.wo, rendered);
    return rendered;
  };
  SetErrors errors{.alone = std::vector<QuantityErrors>(choice.size()),
                   .largest = std::vector<double>(choice.size()),
                   .overflows = std::vector<bool>(choice.size())};
  const std::vector<Rgb> truth = render(values.flat());
  const std::vector<double> given(values.flat().begin(), values.flat().end());
  std::vector<double> all = given;
  for (std::size_t k = 0; k < choice.size(); ++k) {
    if (!choice[k]) continue;
    const ParameterInfo& info = model.parameters[k];
    std::vector<double> one = given;
    for (int c = 0; c < info.components; ++c) {
      const auto slot = static_cast<std::size_t>(info.offset + c);
      one[slot] = all[slot] = choice[k]->decoded(given[slot], info, c);
      errors.largest[k] = std::max(errors.largest[k], std::abs(one[slot] - given[slot]));
      if (!choice[k]->encoding && std::abs(given[slot]) > largest_half) errors.overflows[k] = true;
    }
    if (one != given) errors.alone[k] = squares(pairs, truth, render(one), errors.non_finite);
  }
  if (all != given) errors.together = squares(pairs, truth, render(all), errors.non_finite);
  return errors;
}

}  // namespace

StorageChoice choose_codes(const std::vector<ParameterInfo>& parameters, const std::vector<std::string>& texts) {
  const auto stored = [](const ParameterInfo& info) { return info.choices.empty() && !info.file; };
  StorageChoice choice(parameters.size(), nullptr);
  std::vector<std::string> names;
  for (const ParameterInfo& info : parameters) {
    if (stored(info)) names.emplace_back(info.name);
  }
  for (const bool named : {false, true}) {
    for (const std::string& text : texts) {
      const std::size_t equals = text.find('=');
      if ((equals != std::string::npos) != named) continue;
      const ParameterCode& code = find_parameter_code(named ? text.substr(equals + 1) : text);
      const std::string name = named ? text.substr(0, equals) : "";
      if (named && std::ranges::find(names, name) == names.end()) {
        throw Error(ExitCode::usage, "no number of the model is called '" + name + "'", "--storage " + text,
                    names.empty() ? "the model has none" : "did you mean '" + nearest_name(name, names) + "'?");
      }
      for (std::size_t k = 0; k < parameters.size(); ++k) {
        if (stored(parameters[k]) && (!named || parameters[k].name == name)) choice[k] = &code;
      }
    }
  }
  return choice;
}

ParameterStorageError parameter_storage_error(const Model& model, const std::vector<ParameterValues>& parameter_sets,
                                              const StorageChoice& choice) {
  const WeightedPairs pairs(*model.info);
  std::vector<SetErrors> sets(parameter_sets.size());
  tbb::parallel_for(std::size_t{0}, sets.size(),
                    [&](std::size_t s) { sets[s] = errors_of_set(model, parameter_sets[s], choice, pairs); });

  ParameterStorageError error{
      .parameter_sets = sets.size(), .pairs = pairs.wi.size(), .together = {}, .alone = {}, .non_finite = 0};
  // Of squares that pick() takes from each set.
  const auto root_of_mean = [&](const auto& pick) {
    QuantityErrors sums{};
    for (const SetErrors& set : sets) {
      for (std::size_t q = 0; q < sums.size(); ++q) sums[q] += pick(set)[q];
    }
    for (double& sum : sums) sum = std::sqrt(sum / static_cast<double>(sets.size()));
    return sums;
  };
  error.together = root_of_mean([](const SetErrors& set) -> const QuantityErrors& { return set.together; });
  for (const SetErrors& set : sets) error.non_finite += set.non_finite;
  for (std::size_t k = 0; k < choice.size(); ++k) {
    if (!choice[k]) continue;
    const ParameterInfo& info = model.parameters[k];
    StoredParameterError one{
        .name = std::string(info.name),
        .code = choice[k],
        .bits = choice[k]->bit_count(info),
        .largest_error = 0.0,
        .rms = root_of_mean([&](const SetErrors& set) -> const QuantityErrors& { return set.alone[k]; }),
        .overflows = 0};
    for (const SetErrors& set : sets) {
      one.largest_error = std::max(one.largest_error, set.largest[k]);
      one.overflows += set.overflows[k] ? 1 : 0;
    }
    error.alone.push_back(std::move(one));
  }
  std::ranges::stable_sort(error.alone, std::ranges::greater{}, [](const StoredParameterError& one) {
    return one.rms[static_cast<std::size_t>(Quantity::log)];
  });
  return error;
}

}  // namespace lobefit
