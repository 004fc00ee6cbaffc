// The loader is opened at run time, by vulkan_raii.hpp: the program starts without one.
#define VK_NO_PROTOTYPES
#include "evaluate/vulkan_device.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <chrono>
#include <cstring>
#include <optional>
#include <vulkan/vulkan_raii.hpp>

#include "models/error.h"

namespace lobefit {

namespace {

using Seconds = std::chrono::duration<double>;

Error no_vulkan(const std::string& what) {
  return {ExitCode::missing_part, what, "--device vulkan",
          "install a GPU's driver, or Debian's libvulkan1 and mesa-vulkan-drivers, which has one for the CPU; or use "
          "--device simd"};
}

/// What the driver could not do, as an Error.
template <class Work>
auto guarded(Work&& work) {
  try {
    return work();
  } catch (const vk::OutOfDeviceMemoryError& error) {
    throw Error(ExitCode::missing_part, "the Vulkan device is out of memory", error.what(),
                "stop what else uses it, or choose another --device");
  } catch (const vk::SystemError& error) {
    throw Error(ExitCode::failure, "the Vulkan device failed", error.what(), "try another --device");
  }
}

struct Instance {
  vk::raii::Context context;
  vk::raii::Instance instance;
};

Instance open_instance() {
  std::optional<vk::raii::Context> context;
  try {
    context.emplace();
  } catch (const std::runtime_error&) {
    throw no_vulkan("there is no Vulkan loader, libvulkan.so.1");
  }
  const vk::ApplicationInfo application("lobefit", 0, nullptr, 0, VK_API_VERSION_1_1);
  try {
    vk::raii::Instance instance(*context, vk::InstanceCreateInfo({}, &application));
    return {std::move(*context), std::move(instance)};
  } catch (const vk::SystemError& error) {
    throw no_vulkan("no Vulkan driver can be used: " + std::string(error.what()));
  }
}

std::optional<std::uint32_t> compute_family(const vk::raii::PhysicalDevice& device) {
  const auto families = device.getQueueFamilyProperties();
  for (std::size_t i = 0; i < families.size(); ++i) {
    if (families[i].queueFlags & vk::QueueFlagBits::eCompute) return static_cast<std::uint32_t>(i);
  }
  return std::nullopt;
}

std::vector<vk::raii::PhysicalDevice> computing_devices(const vk::raii::Instance& instance) {
  std::vector<vk::raii::PhysicalDevice> devices;
  try {
    for (vk::raii::PhysicalDevice& device : vk::raii::PhysicalDevices(instance)) {
      if (compute_family(device)) devices.push_back(std::move(device));
    }
  } catch (const vk::SystemError&) {
    // The loader's way to say that there is none.
  }
  if (devices.empty()) throw no_vulkan("there is no Vulkan device that computes");
  return devices;
}

VulkanDeviceInfo describe(const vk::raii::PhysicalDevice& device, std::size_t index) {
  const vk::PhysicalDeviceProperties properties = device.getProperties();
  VulkanDeviceInfo info{static_cast<int>(index), properties.deviceName, "",
                        properties.deviceType == vk::PhysicalDeviceType::eCpu, properties.limits.maxStorageBufferRange};
  if (properties.apiVersion >= VK_API_VERSION_1_2) {
    const auto chain = device.getProperties2<vk::PhysicalDeviceProperties2, vk::PhysicalDeviceDriverProperties>();
    const auto& driver = chain.get<vk::PhysicalDeviceDriverProperties>();
    info.driver = std::string(driver.driverName.data()) + " " + std::string(driver.driverInfo.data());
  }
  return info;
}

std::vector<VulkanDeviceInfo> describe_all(const std::vector<vk::raii::PhysicalDevice>& devices) {
  std::vector<VulkanDeviceInfo> list;
  for (const vk::raii::PhysicalDevice& device : devices) list.push_back(describe(device, list.size()));
  return list;
}

std::string lower_case(std::string text) {
  for (char& c : text) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return text;
}

const VulkanDeviceInfo& choose_device(const std::vector<VulkanDeviceInfo>& devices, const std::string& which) {
  const bool by_index = !which.empty() && which.find_first_not_of("0123456789") == std::string::npos;
  const auto fits = [&](const VulkanDeviceInfo& device) {
    return by_index ? std::to_string(device.index) == which
                    : lower_case(device.name).find(lower_case(which)) != std::string::npos;
  };
  const auto is_gpu = [&](const VulkanDeviceInfo& device) { return fits(device) && !device.software; };
  auto found = std::ranges::find_if(devices, is_gpu);
  if (found == devices.end()) found = std::ranges::find_if(devices, fits);
  if (found != devices.end()) return *found;
  std::string known;
  for (const VulkanDeviceInfo& device : devices) {
    known += (known.empty() ? "" : ", ") + std::to_string(device.index) + " " + device.name;
  }
  throw Error(ExitCode::missing_part, "there is no Vulkan device '" + which + "'", "--device vulkan:" + which,
              "choose one of " + known);
}

/// Storage on the device, or what is copied to and from there, which the CPU sees.
struct Buffer {
  vk::raii::Buffer buffer;
  vk::raii::DeviceMemory memory;
  std::size_t bytes;
  float* mapped;  // null on the device
};

}  // namespace

std::vector<VulkanDeviceInfo> vulkan_devices() {
  const Instance instance = open_instance();
  return describe_all(computing_devices(instance.instance));
}

struct VulkanDevice::Parts {
  Instance instance;
  vk::raii::PhysicalDevice physical;
  VulkanDeviceInfo info;
  vk::PhysicalDeviceLimits limits;
  std::uint64_t storage_range;
  std::uint32_t timestamp_bits;
  vk::raii::Device device;
  vk::raii::Queue queue;
  vk::raii::CommandPool pool;

  static Parts open(const std::string& which, std::uint64_t storage_range) {
    Instance instance = open_instance();
    std::vector<vk::raii::PhysicalDevice> devices = computing_devices(instance.instance);
    const VulkanDeviceInfo info = choose_device(describe_all(devices), which);
    return guarded([&] {
      vk::raii::PhysicalDevice physical = std::move(devices[static_cast<std::size_t>(info.index)]);
      const std::uint32_t family = *compute_family(physical);
      constexpr float priority = 1.0f;
      const vk::DeviceQueueCreateInfo queue_info({}, family, 1, &priority);
      vk::raii::Device device(physical, vk::DeviceCreateInfo({}, queue_info));
      vk::raii::Queue queue(device, family, 0);
      vk::raii::CommandPool pool(device, vk::CommandPoolCreateInfo(vk::CommandPoolCreateFlagBits::eTransient, family));
      const std::uint32_t timestamp_bits = physical.getQueueFamilyProperties()[family].timestampValidBits;
      const vk::PhysicalDeviceLimits limits = physical.getProperties().limits;
      return Parts{std::move(instance),
                   std::move(physical),
                   info,
                   limits,
                   std::min(storage_range, info.storage_range),
                   timestamp_bits,
                   std::move(device),
                   std::move(queue),
                   std::move(pool)};
    });
  }

  Buffer buffer(std::size_t bytes, vk::BufferUsageFlags usage, vk::MemoryPropertyFlags memory_flags) const {
    vk::raii::Buffer handle(device, vk::BufferCreateInfo({}, bytes, usage));
    const vk::MemoryRequirements needs = handle.getMemoryRequirements();
    const vk::PhysicalDeviceMemoryProperties memories = physical.getMemoryProperties();
    for (std::uint32_t type = 0; type < memories.memoryTypeCount; ++type) {
      const bool allowed = (needs.memoryTypeBits >> type & 1u) != 0;
      if (!allowed || (memories.memoryTypes[type].propertyFlags & memory_flags) != memory_flags) continue;
      vk::raii::DeviceMemory memory(device, vk::MemoryAllocateInfo(needs.size, type));
      handle.bindMemory(*memory, 0);
      float* const mapped = memory_flags & vk::MemoryPropertyFlagBits::eHostVisible
                                ? static_cast<float*>(memory.mapMemory(0, VK_WHOLE_SIZE))
                                : nullptr;
      return {std::move(handle), std::move(memory), bytes, mapped};
    }
    throw Error(ExitCode::missing_part, "the Vulkan device has no memory for buffers", info.name,
                "choose another device");
  }
  Buffer device_buffer(std::size_t bytes) const {
    using enum vk::BufferUsageFlagBits;
    return buffer(bytes, eStorageBuffer | eTransferSrc | eTransferDst, vk::MemoryPropertyFlagBits::eDeviceLocal);
  }
  Buffer host_buffer(std::size_t bytes) const {
    using enum vk::BufferUsageFlagBits;
    return buffer(bytes, eTransferSrc | eTransferDst,
                  vk::MemoryPropertyFlagBits::eHostVisible | vk::MemoryPropertyFlagBits::eHostCoherent);
  }
};

namespace {

/// A buffer on the device and its twin that the CPU sees.
struct Staged {
  Buffer device, host;
};

vk::raii::ShaderModule shader_module(const vk::raii::Device& device, const std::vector<std::uint32_t>& spirv) {
  return {device, vk::ShaderModuleCreateInfo({}, spirv)};
}

vk::raii::DescriptorSetLayout storage_layout(const vk::raii::Device& device) {
  std::array<vk::DescriptorSetLayoutBinding, 3> bindings;
  for (std::uint32_t i = 0; i < bindings.size(); ++i) {
    bindings[i] = {i, vk::DescriptorType::eStorageBuffer, 1, vk::ShaderStageFlagBits::eCompute};
  }
  return {device, vk::DescriptorSetLayoutCreateInfo({}, bindings)};
}

vk::raii::PipelineLayout pipeline_layout(const vk::raii::Device& device, const vk::raii::DescriptorSetLayout& set) {
  const vk::PushConstantRange range(vk::ShaderStageFlagBits::eCompute, 0, vulkan_push_bytes);
  return {device, vk::PipelineLayoutCreateInfo({}, *set, range)};
}

vk::raii::DescriptorPool descriptor_pool(const vk::raii::Device& device) {
  const vk::DescriptorPoolSize size(vk::DescriptorType::eStorageBuffer, 3);
  return {device, vk::DescriptorPoolCreateInfo(vk::DescriptorPoolCreateFlagBits::eFreeDescriptorSet, 1, size)};
}

vk::raii::Pipeline compute_pipeline(const vk::raii::Device& device, const vk::raii::PipelineLayout& layout,
                                    const vk::raii::ShaderModule& module) {
  const vk::PipelineShaderStageCreateInfo stage({}, vk::ShaderStageFlagBits::eCompute, *module, "main");
  return {device, nullptr, vk::ComputePipelineCreateInfo({}, stage, *layout)};
}

/// How many items a chunk holds; 0 if not one.
std::size_t chunk_items(const VulkanProgram& program, std::uint64_t storage_range, std::uint32_t max_groups) {
  const std::uint64_t widest = std::max(program.inputs, program.outputs) * sizeof(float);
  // A GPU's watchdog stops what runs for seconds.
  constexpr std::uint64_t longest = 1u << 20;
  return std::min({storage_range / widest, longest, std::uint64_t{max_groups} * vulkan_group_size});
}

}  // namespace

/// A program with buffers for one chunk.
class VulkanDevice::Job {
 public:
  Job(const Parts& parts, const VulkanProgram& program, std::span<const float> constants, std::size_t items)
      : parts_(parts),
        inputs_(staged(program.inputs * items)),
        constants_(staged(std::max<std::size_t>(constants.size(), 1))),
        outputs_(staged(program.outputs * items)),
        module_(shader_module(parts.device, program.spirv)),
        set_layout_(storage_layout(parts.device)),
        layout_(pipeline_layout(parts.device, set_layout_)),
        pipeline_(compute_pipeline(parts.device, layout_, module_)),
        descriptors_(descriptor_pool(parts.device)),
        set_(std::move(
            vk::raii::DescriptorSets(parts.device, vk::DescriptorSetAllocateInfo(*descriptors_, *set_layout_))[0])),
        stamps_(parts.device, vk::QueryPoolCreateInfo({}, vk::QueryType::eTimestamp, 2)) {
    std::ranges::copy(constants, constants_.host.mapped);
    std::uint32_t binding = 0;
    for (const Staged* buffer : {&inputs_, &constants_, &outputs_}) {
      const vk::DescriptorBufferInfo info(*buffer->device.buffer, 0, VK_WHOLE_SIZE);
      parts.device.updateDescriptorSets(
          vk::WriteDescriptorSet(*set_, binding++, 0, vk::DescriptorType::eStorageBuffer, {}, info), {});
    }
  }

  /// The seconds of items [first, first + count).
  double run(std::size_t first, std::size_t count, std::span<const std::span<const float>> inputs,
             std::span<const std::span<float>> outputs) const {
    for (std::size_t k = 0; k < inputs.size(); ++k) {
      std::ranges::copy(inputs[k].subspan(first, count), inputs_.host.mapped + k * count);
    }
    const double seconds = dispatch(first, count);
    for (std::size_t k = 0; k < outputs.size(); ++k) {
      std::copy_n(outputs_.host.mapped + k * count, count, outputs[k].begin() + static_cast<std::ptrdiff_t>(first));
    }
    return seconds;
  }

 private:
  Staged staged(std::size_t floats) const {
    const std::size_t bytes = floats * sizeof(float);
    return {parts_.device_buffer(bytes), parts_.host_buffer(bytes)};
  }

  double dispatch(std::size_t first, std::size_t count) const {
    using Access = vk::AccessFlagBits;
    using Stage = vk::PipelineStageFlagBits;
    const vk::raii::CommandBuffer commands = std::move(vk::raii::CommandBuffers(
        parts_.device, vk::CommandBufferAllocateInfo(*parts_.pool, vk::CommandBufferLevel::ePrimary, 1))[0]);
    const auto wait = [&](Stage before, Access written, Stage after, Access used) {
      commands.pipelineBarrier(before, after, {}, vk::MemoryBarrier(written, used), {}, {});
    };
    const auto copy = [&](const Buffer& from, const Buffer& to) {
      commands.copyBuffer(*from.buffer, *to.buffer, vk::BufferCopy(0, 0, from.bytes));
    };
    const bool stamped = parts_.timestamp_bits > 0;
    commands.begin(vk::CommandBufferBeginInfo(vk::CommandBufferUsageFlagBits::eOneTimeSubmit));
    copy(inputs_.host, inputs_.device);
    copy(constants_.host, constants_.device);
    wait(Stage::eTransfer, Access::eTransferWrite, Stage::eComputeShader, Access::eShaderRead);
    if (stamped) {
      commands.resetQueryPool(*stamps_, 0, 2);
      commands.writeTimestamp(Stage::eTransfer, *stamps_, 0);
    }
    commands.bindPipeline(vk::PipelineBindPoint::eCompute, *pipeline_);
    commands.bindDescriptorSets(vk::PipelineBindPoint::eCompute, *layout_, 0, *set_, {});
    const std::array chunk{static_cast<std::uint32_t>(first), static_cast<std::uint32_t>(count)};
    static_assert(sizeof(chunk) == vulkan_push_bytes);
    commands.pushConstants<std::uint32_t>(*layout_, vk::ShaderStageFlagBits::eCompute, 0, chunk);
    commands.dispatch((chunk[1] + vulkan_group_size - 1) / vulkan_group_size, 1, 1);
    if (stamped) commands.writeTimestamp(Stage::eComputeShader, *stamps_, 1);
    wait(Stage::eComputeShader, Access::eShaderWrite, Stage::eTransfer, Access::eTransferRead);
    copy(outputs_.device, outputs_.host);
    wait(Stage::eTransfer, Access::eTransferWrite, Stage::eHost, Access::eHostRead);
    commands.end();

    const auto start = std::chrono::steady_clock::now();
    parts_.queue.submit(vk::SubmitInfo({}, {}, *commands), nullptr);
    parts_.queue.waitIdle();
    const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start;
    return stamped ? stamped_seconds() : elapsed.count();
  }

  double stamped_seconds() const {
    const auto [status, ticks] = stamps_.getResults<std::uint64_t>(0, 2, 2 * sizeof(std::uint64_t),
                                                                   sizeof(std::uint64_t), vk::QueryResultFlagBits::e64);
    // Counters of fewer bits wrap around.
    const std::uint64_t mask = ~std::uint64_t{0} >> (64 - parts_.timestamp_bits);
    return static_cast<double>((ticks[1] - ticks[0]) & mask) * parts_.limits.timestampPeriod * 1e-9;
  }

  const Parts& parts_;
  Staged inputs_, constants_, outputs_;
  vk::raii::ShaderModule module_;
  vk::raii::DescriptorSetLayout set_layout_;
  vk::raii::PipelineLayout layout_;
  vk::raii::Pipeline pipeline_;
  vk::raii::DescriptorPool descriptors_;
  vk::raii::DescriptorSet set_;
  vk::raii::QueryPool stamps_;
};

VulkanDevice::VulkanDevice(const std::string& which, std::uint64_t storage_range)
    : parts_(std::make_unique<Parts>(Parts::open(which, storage_range))) {}
VulkanDevice::~VulkanDevice() = default;

const VulkanDeviceInfo& VulkanDevice::info() const { return parts_->info; }

double VulkanDevice::run(const VulkanProgram& program, std::span<const float> constants,
                         std::span<const std::span<const float>> inputs,
                         std::span<const std::span<float>> outputs) const {
  const std::size_t items = outputs[0].size();
  const std::size_t chunk =
      std::min(items, chunk_items(program, parts_->storage_range, parts_->limits.maxComputeWorkGroupCount[0]));
  if (chunk == 0 || constants.size_bytes() > parts_->storage_range) {
    throw Error(ExitCode::missing_part,
                "the storage buffers of " + parts_->info.name + " hold " + std::to_string(parts_->storage_range) +
                    " bytes, too few for this model",
                "--device vulkan", "choose another device");
  }
  return guarded([&] {
    const Job job(*parts_, program, constants, chunk);
    job.run(0, chunk, inputs, outputs);
    double seconds = 0.0;
    for (std::size_t first = 0; first < items; first += chunk) {
      seconds += job.run(first, std::min(chunk, items - first), inputs, outputs);
    }
    return seconds;
  });
}

}  // namespace lobefit
