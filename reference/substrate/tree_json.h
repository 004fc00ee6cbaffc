// Substrate trees as JSON (data/schemas/substrate_tree.json):
//
//   {"vertical": {"top": {"slab": {"name": "lacquer", "diffuse_albedo": 0, "roughness": 0.2, "mean_free_path": [1, 2,
//   3]}},
//                 "bottom": {"slab": {"f0": [0.9, 0.6, 0.3], "diffuse_albedo": 0}}, "thickness": 0.1}}
//
// A slab's members are the parameters of `lobefit models slab`, and in their place those of Substrate's helper nodes:
// ior; base_color, metallic, specular; transmittance; haziness, haze_extent. An operand may also be the name of a node
// in the document's "nodes", or {"unreal": {…}}, one of Unreal's older shading models.
#pragma once

#include <filesystem>
#include <string>

#include "models/substrate/walk.h"
#include "reference/json_reader.h"

namespace lobefit {

/// Throws Error(invalid_input) with the JSON path of what is wrong: cycles, unknown keys, missing operands, numbers out
/// of range, more slabs than most_closures.
SlabTree tree_from_json(const JsonReader& reader);
/// From a file; without a title of its own the tree gets the file's name.
SlabTree read_tree(const std::filesystem::path& path);
/// What tree_from_json() reads back as the same tree; slabs as their parameters, neutral ones left out.
Json tree_json(const SlabTree& tree);
Json slab_json(const SlabValues& slab);

}  // namespace lobefit
