#include "evaluate/float_model.h"

#include <algorithm>

namespace lobefit {

#define LOBEFIT_MODEL(Type, header) FloatModel make_float_##Type();
#include "models/list.def"
#undef LOBEFIT_MODEL

namespace {

std::deque<FloatModel>& all_float_models() {
  static std::deque<FloatModel> all{
#define LOBEFIT_MODEL(Type, header) make_float_##Type(),
#include "models/list.def"
#undef LOBEFIT_MODEL
  };
  return all;
}

}  // namespace

const std::deque<FloatModel>& float_models() { return all_float_models(); }

void add_float_model(const FloatModel& model) { all_float_models().push_back(model); }

const FloatModel& find_float_model(std::string_view name) {
  const auto found = std::ranges::find(float_models(), find_model(name).info->name, &FloatModel::name);
  if (found == float_models().end()) {
    throw Error(ExitCode::usage, "the model '" + std::string(name) + "' has no float form", "find_float_model",
                "add it by add_float_model");
  }
  return *found;
}

}  // namespace lobefit
