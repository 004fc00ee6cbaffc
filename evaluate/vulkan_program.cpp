#include "evaluate/vulkan_program.h"

namespace lobefit {

namespace {

constexpr std::string_view glsl_declarations = R"(#version 450
layout(push_constant) uniform LobefitChunk { uint first_item; uint item_count; };
layout(std430, binding = 0) readonly buffer LobefitInputs { float lobefit_inputs[]; };
layout(std430, binding = 1) readonly buffer LobefitConstants { float lobefit_constants[]; };
layout(std430, binding = 2) writeonly buffer LobefitOutputs { float lobefit_outputs[]; };
)";

constexpr std::string_view hlsl_declarations = R"([[vk::push_constant]] cbuffer LobefitChunk { uint first_item; uint item_count; };
[[vk::binding(0)]] StructuredBuffer<float> lobefit_inputs;
[[vk::binding(1)]] StructuredBuffer<float> lobefit_constants;
[[vk::binding(2)]] RWStructuredBuffer<float> lobefit_outputs;
)";

}  // namespace

std::string vulkan_shader(std::string_view language, const std::string& definitions, const std::string& statements) {
  const bool glsl = language == "glsl";
  const std::string size = std::to_string(vulkan_group_size);
  return std::string(glsl ? glsl_declarations : hlsl_declarations) + definitions +
         (glsl ? "\nlayout(local_size_x = " + size + ") in;\nvoid main() {\n    uint i = gl_GlobalInvocationID.x;\n"
               : "\n[numthreads(" + size +
                     ", 1, 1)]\nvoid main(uint3 id : SV_DispatchThreadID) {\n    uint i = id.x;\n") +
         "    if (i >= item_count) return;\n" + statements + "}\n";
}

}  // namespace lobefit
