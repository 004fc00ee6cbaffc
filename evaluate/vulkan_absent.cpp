// In place of the Vulkan device and the shader compiler, where this was built without them.
#include "evaluate/spirv.h"
#include "evaluate/vulkan_device.h"
#include "models/error.h"

namespace lobefit {

namespace {

[[noreturn]] void absent() {
  throw Error(ExitCode::missing_part, "this build has no Vulkan evaluator", "--device vulkan",
              "install libvulkan-dev, glslang-dev and spirv-tools, and build again; or use --device simd");
}

}  // namespace

struct VulkanDevice::Parts {};

std::vector<VulkanDeviceInfo> vulkan_devices() { absent(); }
VulkanDevice::VulkanDevice(const std::string&, std::uint64_t) { absent(); }
VulkanDevice::~VulkanDevice() = default;
const VulkanDeviceInfo& VulkanDevice::info() const { absent(); }
double VulkanDevice::run(const VulkanProgram&, std::span<const float>, std::span<const std::span<const float>>,
                         std::span<const std::span<float>>) const {
  absent();
}
std::vector<std::uint32_t> compile_shader(std::string_view, const std::string&) { absent(); }

}  // namespace lobefit
