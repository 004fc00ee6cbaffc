// The reference `layered`: a stack of layers or a Substrate tree.
#include "reference/json_reader.h"
#include "reference/output_file.h"
#include "reference/substrate/physical_surface.h"
#include "reference/substrate/tree_json.h"

namespace lobefit {

Reference layered_reference() {
  return {.name = "layered",
          .doc = "Plane-parallel interfaces and media over a diffuse or metallic bottom, all orders of scattering.",
          .source = "Guo, Hašan, Zhao 2018, Position-Free Monte Carlo Simulation for Arbitrary Layered BSDFs",
          .parameters = {{.name = "stack",
                          .doc = "Layer stack (data/schemas/stack.json) or Substrate tree "
                                 "(data/schemas/substrate_tree.json), a JSON file.",
                          .file = true,
                          .components = 0}},
          .make = [](const ParameterValues& values) -> std::unique_ptr<const Integrator> {
            const std::string path = values.path("stack");
            if (path.empty()) {
              throw Error(ExitCode::usage, "no layer stack was given", "layered, parameter stack",
                          "name one: stack=FILE");
            }
            const Json json = parse_json(read_file(path), path);
            if (json.is_object() && !json.contains("layers")) {
              return std::make_unique<PhysicalSurface>(tree_from_json(JsonReader(json, path)));
            }
            return make_layered(LayerStack::from_json(JsonReader(json, path)));
          }};
}

}  // namespace lobefit
