// Compute programs for vulkan_device.h: what the buffers hold, as texts around the statements for one item.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace lobefit {

struct VulkanProgram {
  std::vector<std::uint32_t> spirv;
  std::size_t inputs, outputs;  // floats of an item
};

/// Items of a workgroup.
inline constexpr std::uint32_t vulkan_group_size = 64;

/// Bytes of the push constants first_item and item_count.
inline constexpr std::uint32_t vulkan_push_bytes = 8;

/// A named part of the constants.
struct VulkanArray {
  std::string name;
  std::size_t size;  // floats, at least 1
};

/// A whole compute shader, "glsl" or "hlsl": `definitions`, and `statements` for each item. They read input k of the
/// item at lobefit_inputs[k * item_count + i] and the arrays of `constants`, which lie one after another, and write
/// lobefit_outputs like inputs; i counts the items of a chunk, first_item + i all items.
std::string vulkan_shader(std::string_view language, std::span<const VulkanArray> constants,
                          const std::string& definitions, const std::string& statements);

}  // namespace lobefit
