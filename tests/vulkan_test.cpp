// Exported shaders on a Vulkan device against the models in double.

#include "evaluate/vulkan_device.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <memory>
#include <spirv-tools/libspirv.hpp>

#include "evaluate/check.h"
#include "evaluate/shader.h"
#include "evaluate/spirv.h"
#include "evaluate/vulkan_evaluator.h"

namespace lobefit {
namespace {

/// The device of all tests; the reason where there is none.
struct Machine {
  std::unique_ptr<const VulkanDevice> device;
  std::string reason;

  static const Machine& instance() {
    static const Machine machine = [] {
      Machine made;
      try {
        made.device = std::make_unique<const VulkanDevice>();
      } catch (const Error& error) {
        if (error.code() != ExitCode::missing_part) throw;
        made.reason = error.what();
      }
      return made;
    }();
    return machine;
  }
};

class Vulkan : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!Machine::instance().device) GTEST_SKIP() << Machine::instance().reason;
  }
  const VulkanDevice& device() const { return *Machine::instance().device; }
};

Error error_of(const std::function<void()>& work) {
  try {
    work();
  } catch (const Error& error) {
    return error;
  }
  throw std::logic_error("no error");
}

bool holds(std::string_view text, std::string_view part) { return text.find(part) != std::string_view::npos; }

CheckOptions few_pairs() {
  CheckOptions options;
  options.pairs = 1 << 16;
  return options;
}

std::vector<ParameterValues> all_varied(const Model& model) {
  std::vector<std::string> names;
  for (const ParameterInfo& info : model.parameters) names.emplace_back(info.name);
  return varied_parameters(model.defaults(), names, 16, 1);
}

// ---- texts ------------------------------------------------------------------------------------------------------

class ShaderOnVulkan : public Vulkan, public ::testing::WithParamInterface<std::string> {
 protected:
  const Model& model_ = find_model(GetParam());
};

std::vector<std::string> model_names() {
  std::vector<std::string> names;
  for (const Model& model : models()) names.emplace_back(model.info->name);
  return names;
}

INSTANTIATE_TEST_SUITE_P(Models, ShaderOnVulkan, ::testing::ValuesIn(model_names()),
                         [](const auto& test) { return test.param; });

TEST_P(ShaderOnVulkan, EqualsTheModel) {
  Monitor silent;
  for (const std::string& language : spirv_languages()) {
    const VulkanEvaluator evaluator(device(), language);
    const CheckResult result = check_model(model_, all_varied(model_), few_pairs(), evaluator, silent);
    EXPECT_TRUE(result.passed) << result.json().dump(2);
    EXPECT_EQ(result.language, language);
    EXPECT_EQ(result.device, device().info().name);
    EXPECT_GT(result.evaluations_per_s, 0.0);
  }
}

/// The one plane that `statements` write for `items` items, with `text` before them.
std::vector<float> plane_of(const VulkanDevice& device, const std::string& language, const std::string& text,
                            const std::string& statements, std::size_t items) {
  const std::string shader = vulkan_shader(language, std::vector<VulkanArray>{{"unused", 1}}, text, statements);
  const std::vector<float> input(items), constants(1);
  std::vector<float> output(items);
  const std::array<std::span<const float>, 1> in{input};
  const std::array<std::span<float>, 1> out{output};
  device.run({compile_shader(language, shader), 1, 1}, constants, in, out);
  return output;
}

// EqualsTheModel has parameters and tables from a buffer; these are what the text itself holds.

TEST_F(Vulkan, FittedReturnsTheParameters) {
  for (const Model& model : models()) {
    const ParameterValues defaults = model.defaults();
    if (defaults.flat().empty()) continue;
    const std::string name = "Lobefit_" + std::string(model.info->name);
    std::string statements = "    " + name + "_Parameters p = " + name + "_Fitted();\n";
    for (const ParameterInfo& info : model.parameters) {
      for (int k = 0; k < info.components; ++k) {
        const std::string member = std::string(info.name) + (info.components == 3 ? std::string{'.', "xyz"[k]} : "");
        statements += "    if (i == " + std::to_string(info.offset + k) + "u) lobefit_outputs[i] = p." + member + ";\n";
      }
    }
    const std::vector<float> rounded(defaults.flat().begin(), defaults.flat().end());
    for (const std::string& language : spirv_languages()) {
      EXPECT_EQ(plane_of(device(), language, model_text(model, language), statements, rounded.size()), rounded) << name;
    }
  }
}

TEST_F(Vulkan, TablesAreInTheText) {
  int tables = 0;
  for (const Model& model : models()) {
    const Shader shader = find_float_model(model.info->name).trace();
    for (const ShaderTable& table : shader.tables) {
      const std::string statement = "    lobefit_outputs[i] = Lobefit_" + table.name + "_entries[i];\n";
      for (const std::string& language : spirv_languages()) {
        const std::vector<float> found =
            plane_of(device(), language, model_text(model, language), statement, table.entries.size());
        EXPECT_TRUE(std::ranges::equal(found, table.entries)) << table.name << " in " << language;
      }
      ++tables;
    }
  }
  EXPECT_GE(tables, 5);
}

/// `text` with its one `from` made `to`.
std::string replaced(std::string text, std::string_view from, std::string_view to) {
  const std::size_t at = text.find(from);
  if (at == std::string::npos || text.find(from, at + 1) != std::string::npos) {
    throw std::logic_error("not there once: " + std::string(from));
  }
  return text.replace(at, from.size(), to);
}

/// A device that evaluates another text than the model's.
class TamperedEvaluator : public FloatDevice {
 public:
  TamperedEvaluator(const VulkanDevice& device, std::string language, std::string text)
      : FloatDevice("tampered", language, true), evaluator_(device, language), text_(std::move(text)) {}
  double evaluate(const Model& model, const ParameterBlocks& parameters, const FloatPairs& pairs,
                  FloatRgb& values) const override {
    return evaluator_.evaluate_text(model, text_, parameters, pairs, values);
  }

 private:
  VulkanEvaluator evaluator_;
  std::string text_;
};

TEST_F(Vulkan, AnotherConstantIsCaught) {
  const Model& model = find_model("burley");
  Monitor silent;
  for (const std::string& language : spirv_languages()) {
    const std::string text = model_text(model, language);
    const TamperedEvaluator same(device(), language, text);
    EXPECT_TRUE(check_model(model, all_varied(model), few_pairs(), same, silent).passed);
    // f90 = 1/2 + 2 V.H² r: five digits are too few.
    const TamperedEvaluator other(device(), language, replaced(text, "0.5 + 2.0", "0.50008 + 2.0"));
    const CheckResult result = check_model(model, all_varied(model), few_pairs(), other, silent);
    EXPECT_FALSE(result.passed);
    EXPECT_GT(result.failures, result.pairs / 100);
    EXPECT_EQ(result.non_finite, 0u);
  }
}

TEST_F(Vulkan, ValuesThatAreNotFiniteAreFailures) {
  const Model& model = find_model("lambert");
  Monitor silent;
  const TamperedEvaluator other(device(), "glsl",
                                replaced(model_text(model, "glsl"), "/ LOBEFIT_PI", "/ max(wi.z - 0.5, 0.0)"));
  const CheckResult result = check_model(model, {model.defaults()}, few_pairs(), other, silent);
  EXPECT_FALSE(result.passed);
  EXPECT_GT(result.non_finite, result.pairs / 4);
}

// ---- devices and buffers ------------------------------------------------------------------------------------------

/// outputs: the sum of an item's two inputs and constants[item % 3], and the item's number.
VulkanProgram adder(std::string_view language) {
  const std::vector<VulkanArray> arrays{{"terms", 3}};
  const std::string text =
      vulkan_shader(language, arrays, "",
                    "    uint item = first_item + i;\n"
                    "    lobefit_outputs[i] = lobefit_inputs[i] + lobefit_inputs[item_count + i] + terms[item % 3u];\n"
                    "    lobefit_outputs[item_count + i] = float(item);\n");
  return {compile_shader(language, text), 2, 2};
}

TEST_F(Vulkan, ItemsKeepTheirNumbersInChunks) {
  const std::vector<float> terms{0.5f, 1000.0f, -7.0f};
  const std::size_t items = 10'007;  // a prime: no chunk and no workgroup is full at the end
  std::vector<float> a(items), b(items), sum(items), number(items);
  for (std::size_t i = 0; i < items; ++i) {
    a[i] = static_cast<float>(i);
    b[i] = static_cast<float>(i) * 0.25f;
  }
  // From one dispatch to chunks of one item and more.
  for (const std::uint64_t range : {std::uint64_t{1} << 30, std::uint64_t{40'000}, std::uint64_t{1000}}) {
    const VulkanDevice small("", range);
    for (const std::string& language : spirv_languages()) {
      std::ranges::fill(sum, -1.0f);
      std::ranges::fill(number, -1.0f);
      const std::array<std::span<const float>, 2> in{a, b};
      const std::array<std::span<float>, 2> out{sum, number};
      EXPECT_GT(small.run(adder(language), terms, in, out), 0.0);
      for (std::size_t i = 0; i < items; ++i) {
        ASSERT_EQ(sum[i], a[i] + b[i] + terms[i % 3]) << i << " of " << range;
        ASSERT_EQ(number[i], static_cast<float>(i));
      }
    }
  }
}

TEST_F(Vulkan, ChunksHaveTheBitsOfOneDispatch) {
  const Model& model = find_model("callisto");
  ParameterBlocks parameters{{}, 1000};
  for (const ParameterValues& set : all_varied(model)) {
    parameters.sets.emplace_back(set.flat().begin(), set.flat().end());
  }
  const std::size_t n = 30'011;
  FloatPairs pairs(n);
  for (std::size_t i = 0; i < n; ++i) {
    const double z = (static_cast<double>(i) + 0.5) / static_cast<double>(n), phi = 0.1 * static_cast<double>(i);
    pairs.set(i, {std::sqrt(1.0 - z * z) * std::cos(phi), std::sqrt(1.0 - z * z) * std::sin(phi), z}, {0.6, 0.0, 0.8});
  }
  FloatRgb whole(n), chunked(n);
  VulkanEvaluator(device(), "glsl").evaluate(model, parameters, pairs, whole);
  const VulkanDevice small("", 100'000);
  VulkanEvaluator(small, "glsl").evaluate(model, parameters, pairs, chunked);
  EXPECT_EQ(whole.r, chunked.r);
  EXPECT_EQ(whole.g, chunked.g);
  EXPECT_EQ(whole.b, chunked.b);
  EXPECT_GT(*std::ranges::max_element(whole.r), 0.0f);
}

TEST_F(Vulkan, TooLittleStorageIsToldApart) {
  const VulkanDevice small("", 4);
  FloatPairs pairs(10);
  FloatRgb values(10);
  const Model& model = find_model("lambert");
  const Error error = error_of([&] {
    VulkanEvaluator(small, "glsl").evaluate(model, {{{1.0f, 1.0f, 1.0f}}, 10}, pairs, values);
  });
  EXPECT_EQ(error.code(), ExitCode::missing_part);
  EXPECT_TRUE(holds(error.what(), "4 bytes")) << error.what();
}

TEST_F(Vulkan, DevicesAreChosenByIndexAndByName) {
  const std::vector<VulkanDeviceInfo> devices = vulkan_devices();
  for (const VulkanDeviceInfo& info : devices) {
    EXPECT_EQ(VulkanDevice(std::to_string(info.index)).info().name, info.name);
    EXPECT_EQ(VulkanDevice(info.name.substr(1, 5)).info().name.find(info.name.substr(1, 5)), 1u);
    EXPECT_GE(info.storage_range, 1u << 27);  // what Vulkan asks of every device
  }
  const bool has_gpu = std::ranges::any_of(devices, [](const VulkanDeviceInfo& info) { return !info.software; });
  EXPECT_NE(device().info().software, has_gpu);
  for (const std::string which : {"99", "no such device"}) {
    const Error error = error_of([&] { const VulkanDevice none(which); });
    EXPECT_EQ(error.code(), ExitCode::missing_part);
    EXPECT_TRUE(holds(error.what(), "'" + which + "'")) << error.what();
    EXPECT_TRUE(holds(error.what(), devices[0].name)) << error.what();
  }
}

// ---- the compiler: without a device -------------------------------------------------------------------------------

TEST(Spirv, EveryShaderIsValid) {
  spvtools::SpirvTools tools(SPV_ENV_VULKAN_1_0);
  std::string complaints;
  tools.SetMessageConsumer([&](spv_message_level_t, const char*, const spv_position_t&, const char* message) {
    complaints += std::string(message) + "\n";
  });
  for (const Model& model : models()) {
    const ParameterBlocks parameters{{std::vector<float>(model.defaults().flat().size())}, 64};
    for (const std::string& language : spirv_languages()) {
      const std::vector<std::uint32_t> spirv =
          compile_shader(language, evaluation_shader(model, language, model_text(model, language), parameters).text);
      EXPECT_TRUE(tools.Validate(spirv)) << model.info->name << " in " << language << ": " << complaints;
    }
  }
}

TEST(Spirv, ComplaintsQuoteTheLine) {
  const std::string body = "    lobefit_outputs[i] = 1.0;\n    lobefit_outputs[i] = wrong_name * 2.0;\n";
  for (const std::string& language : spirv_languages()) {
    const Error error = error_of([&] {
      compile_shader(language, vulkan_shader(language, std::vector<VulkanArray>{{"unused", 1}}, "", body));
    });
    EXPECT_EQ(error.code(), ExitCode::failure);
    const std::string message = error.what();
    EXPECT_TRUE(holds(message, language)) << message;
    EXPECT_TRUE(holds(message, "'wrong_name' : ")) << message;
    EXPECT_TRUE(holds(message, "(lobefit_outputs[i] = wrong_name * 2.0;")) << message;
    EXPECT_EQ(message.find('\n'), std::string::npos) << message;
  }
}

}  // namespace
}  // namespace lobefit
