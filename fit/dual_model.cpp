#include "fit/dual_model.h"

namespace lobefit {

#define LOBEFIT_MODEL(Type, header) DualModel make_dual_##Type();
#include "models/list.def"
#undef LOBEFIT_MODEL

const DualModel& dual_model(const Model& model) {
  static const std::vector<DualModel> all{
#define LOBEFIT_MODEL(Type, header) make_dual_##Type(),
#include "models/list.def"
#undef LOBEFIT_MODEL
  };
  return all[static_cast<std::size_t>(&model - models().data())];
}

}  // namespace lobefit
