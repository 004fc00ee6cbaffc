// Vulkan devices as number crunchers: one compute program over many items.
#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "evaluate/vulkan_program.h"

namespace lobefit {

struct VulkanDeviceInfo {
  int index;                    // in the loader's order
  std::string name;             // such as "llvmpipe (LLVM 15.0.6, 256 bits)"
  std::string driver;           // its name and version; "" where the device doesn't tell
  bool software;                // VK_PHYSICAL_DEVICE_TYPE_CPU
  std::uint64_t storage_range;  // largest storage buffer, bytes
};

/// Every device that computes. Throws Error(missing_part) if this build, the Vulkan loader or every driver is missing.
std::vector<VulkanDeviceInfo> vulkan_devices();

class VulkanDevice {
 public:
  /// `which`: "" for the first device, a GPU before a CPU; its index; or a part of its name. No buffer will be larger
  /// than `storage_range` bytes, nor than the device allows. Throws Error(missing_part) with a list of the devices that
  /// there are.
  explicit VulkanDevice(const std::string& which = "",
                        std::uint64_t storage_range = std::numeric_limits<std::uint64_t>::max());
  ~VulkanDevice();

  const VulkanDeviceInfo& info() const;

  /// Runs the program over items, in as many chunks as the storage range asks for. `inputs` and `outputs` have one
  /// plane for each float of an item. Returns the seconds in the shader: by the device's timestamps where it has them,
  /// else by the clock; the first chunk runs once more before, to warm up. Throws Error(missing_part) if one item is
  /// too much for the storage range, or for the device's memory; Error(failure) if the device fails.
  double run(const VulkanProgram& program, std::span<const float> constants,
             std::span<const std::span<const float>> inputs, std::span<const std::span<float>> outputs) const;

 private:
  struct Parts;
  class Job;
  std::unique_ptr<Parts> parts_;
};

}  // namespace lobefit
