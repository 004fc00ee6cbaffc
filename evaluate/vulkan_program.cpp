#include "evaluate/vulkan_program.h"

namespace lobefit {

namespace {

std::string members(std::span<const VulkanArray> constants, const std::string& prefix) {
  std::string text;
  for (const VulkanArray& array : constants) {
    text += "    float " + prefix + array.name + "[" + std::to_string(array.size) + "];\n";
  }
  return text;
}

std::string glsl_shader(std::span<const VulkanArray> constants, const std::string& definitions,
                        const std::string& statements) {
  return R"(#version 450
layout(push_constant) uniform LobefitChunk { uint first_item; uint item_count; };
layout(std430, binding = 0) readonly buffer LobefitInputs { float lobefit_inputs[]; };
layout(std430, binding = 1) readonly buffer LobefitConstants {
)" + members(constants, "") +
         R"(};
layout(std430, binding = 2) writeonly buffer LobefitOutputs { float lobefit_outputs[]; };
)" + definitions +
         "\nlayout(local_size_x = " + std::to_string(vulkan_group_size) + R"() in;
void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= item_count) return;
)" + statements +
         "}\n";
}

/// A constant array is a member of a buffer's one element: a macro gives it its name back.
std::string hlsl_shader(std::span<const VulkanArray> constants, const std::string& definitions,
                        const std::string& statements) {
  const std::string prefix = "member_";
  std::string text = R"([[vk::push_constant]] cbuffer LobefitChunk { uint first_item; uint item_count; };
struct LobefitConstants {
)" + members(constants, prefix) +
                     R"(};
[[vk::binding(0)]] StructuredBuffer<float> lobefit_inputs;
[[vk::binding(1)]] StructuredBuffer<LobefitConstants> lobefit_constants;
[[vk::binding(2)]] RWStructuredBuffer<float> lobefit_outputs;
)";
  for (const VulkanArray& array : constants) {
    text += "#define " + array.name + " lobefit_constants[0]." + prefix + array.name + "\n";
  }
  return text + definitions + "\n[numthreads(" + std::to_string(vulkan_group_size) + R"(, 1, 1)]
void main(uint3 id : SV_DispatchThreadID) {
    uint i = id.x;
    if (i >= item_count) return;
)" + statements +
         "}\n";
}

}  // namespace

std::string vulkan_shader(std::string_view language, std::span<const VulkanArray> constants,
                          const std::string& definitions, const std::string& statements) {
  return (language == "glsl" ? glsl_shader : hlsl_shader)(constants, definitions, statements);
}

}  // namespace lobefit
