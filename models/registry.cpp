#include "models/registry.h"

namespace lobefit {

#define LOBEFIT_MODEL(Type, header) Model make_##Type();
#include "models/list.def"
#undef LOBEFIT_MODEL

namespace {

std::deque<Model>& all_models() {
  static std::deque<Model> all{
#define LOBEFIT_MODEL(Type, header) make_##Type(),
#include "models/list.def"
#undef LOBEFIT_MODEL
  };
  return all;
}

}  // namespace

const std::deque<Model>& models() { return all_models(); }

void add_model(const Model& model) {
  for (const Model& known : models()) {
    if (known.info->name == model.info->name)
      throw Error(ExitCode::usage, "a model '" + std::string(model.info->name) + "' exists", "add_model",
                  "give it another name");
  }
  all_models().push_back(model);
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
