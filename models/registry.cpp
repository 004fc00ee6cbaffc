#include "models/registry.h"

namespace lobefit {

#define LOBEFIT_MODEL(Type, header) Model make_##Type();
#include "models/list.def"
#undef LOBEFIT_MODEL

std::span<const Model> models() {
  static const std::vector<Model> all{
#define LOBEFIT_MODEL(Type, header) make_##Type(),
#include "models/list.def"
#undef LOBEFIT_MODEL
  };
  return all;
}

const Model& find_model(std::string_view name) {
  std::vector<std::string> names;
  for (const Model& model : models()) {
    if (model.info->name == name) return model;
    names.emplace_back(model.info->name);
  }
  throw Error(ExitCode::usage, "unknown model '" + std::string(name) + "'", "",
              "did you mean '" + nearest_name(name, names) + "'? `lobefit models` lists them all");
}

}  // namespace lobefit
