#include "fit/dual_model.h"

#include <algorithm>
#include <deque>

namespace lobefit {

#define LOBEFIT_MODEL(Type, header) DualModel make_dual_##Type();
#include "models/list.def"
#undef LOBEFIT_MODEL

namespace {

std::deque<DualModel>& all_dual_models() {
  static std::deque<DualModel> all{
#define LOBEFIT_MODEL(Type, header) make_dual_##Type(),
#include "models/list.def"
#undef LOBEFIT_MODEL
  };
  return all;
}

}  // namespace

void add_dual_model(const DualModel& model) { all_dual_models().push_back(model); }

const DualModel& dual_model(const Model& model) {
  const auto found = std::ranges::find(all_dual_models(), model.info->name, &DualModel::name);
  if (found == all_dual_models().end()) {
    throw Error(ExitCode::usage, "the model '" + std::string(model.info->name) + "' has no derivatives", "dual_model",
                "add them by add_dual_model");
  }
  return *found;
}

}  // namespace lobefit
