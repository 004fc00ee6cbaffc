#include "evaluate/gbuffer_error.h"

#include "reference/table_model.h"

namespace lobefit {

GBufferError gbuffer_error(const ParameterValues& fitted, const GBufferMaterial& material, const Table& table,
                           const std::vector<double>& weights, bool directions_only) {
  const auto render = [&](const ParameterValues& values) {
    return TableModel(find_model(values.owner()), values, table).render();
  };
  const Table fit = render(fitted), port = render(material.port), packed = render(material.decoded);
  GBufferError error{.port_from_fit = rms_differences(fit, port.values, weights),
                     .packed_from_port = rms_differences(port, packed.values, weights),
                     .packed_from_fit = rms_differences(fit, packed.values, weights)};
  if (!directions_only) {
    error.against_table = GBufferStages{.fit = rms_differences(table, fit.values, weights),
                                        .port = rms_differences(table, port.values, weights),
                                        .packed = rms_differences(table, packed.values, weights)};
  }
  for (const GBufferParameter& parameter : material.parameters) {
    double rms = 0.0;
    if (parameter.field) {
      ParameterValues one = material.port;
      one.set(parameter.field->parameter,
              material.decoded.components(material.decoded.info(parameter.field->parameter)));
      rms = rms_difference(port, render(one).values, Quantity::log, weights);
    }
    error.alone.push_back(rms);
  }
  return error;
}

Table gbuffer_directions() {
  Table table;
  table.grid = Grid::measured();
  table.channels = 3;
  table.allocate();
  return table;
}

}  // namespace lobefit
