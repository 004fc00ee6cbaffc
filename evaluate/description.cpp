#include "evaluate/description.h"

#include "evaluate/float_model.h"
#include "evaluate/operation_cost.h"

namespace lobefit {

namespace {

Json parameter_json(const ParameterInfo& info) {
  Json json{{"name", info.name}, {"symbol", info.symbol}, {"unit", info.unit}, {"components", info.components}};
  if (info.choices.empty()) {
    json["range"] = {info.lower, info.upper};
    json["default"] = info.initial;
  } else {
    json["choices"] = info.choices;
    json["default"] = info.choices[static_cast<std::size_t>(info.initial)];
  }
  json["tier"] = tier_name(info.tier);
  json["doc"] = info.doc;
  return json;
}

Json parameters_json(const std::vector<ParameterInfo>& parameters) {
  Json list = Json::array();
  for (const ParameterInfo& info : parameters) list.push_back(parameter_json(info));
  return list;
}

}  // namespace

Json model_json(const Model& model) {
  const OperationCount operations = count_operations(find_float_model(model.info->name).trace());
  return {{"name", model.info->name},
          {"kind", kind_name(model.info->kind)},
          {"title", model.info->title},
          {"doc", model.info->doc},
          {"params", parameters_json(model.parameters)},
          {"source", model.info->source},
          {"properties",
           {{"reciprocal", model.info->reciprocal},
            {"energy_conserving", is_term(model.info->kind) ? Json() : Json(model.info->energy_conserving)},
            {"isotropic", model.info->isotropic},
            {"non_negative", model.info->non_negative},
            {"transmits", model.info->transmits},
            {"fibre", is_hair(model.info->kind)},
            {"samplable", model.sample != nullptr}}},
          {"operations",
           {{"total", operations.total()},
            {"add_multiply", operations.add_multiply},
            {"divide", operations.divide},
            {"square_root", operations.square_root},
            {"transcendental", operations.transcendental},
            {"compare_select", operations.compare_select},
            {"table_read", operations.table_read},
            {"alu_cycles", alu_cycles(operations)}}}};
}

Json reference_json(const Reference& reference) {
  return {{"name", reference.name},
          {"doc", reference.doc},
          {"source", reference.source},
          {"params", parameters_json(reference.parameters)}};
}

}  // namespace lobefit
