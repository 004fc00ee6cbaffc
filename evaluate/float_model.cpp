#include "evaluate/float_model.h"

namespace lobefit {

#define LOBEFIT_MODEL(Type, header) FloatModel make_float_##Type();
#include "models/list.def"
#undef LOBEFIT_MODEL

std::span<const FloatModel> float_models() {
  static const std::vector<FloatModel> all{
#define LOBEFIT_MODEL(Type, header) make_float_##Type(),
#include "models/list.def"
#undef LOBEFIT_MODEL
  };
  return all;
}

const FloatModel& find_float_model(std::string_view name) {
  const Model& model = find_model(name);
  return float_models()[static_cast<std::size_t>(&model - models().data())];
}

}  // namespace lobefit
