// Exported WGSL, compiled by Chromium's Tint and run by WebGPU on its software device.
#include <gtest/gtest.h>

#include <cstring>
#include <filesystem>
#include <fstream>

#include "tests/base64.h"
#include "tests/shader_agreement.h"
#include "tests/shader_compiler.h"

namespace lobefit {
namespace {

namespace fs = std::filesystem;

std::string job_text(const Model& model) {
  const std::string function = "Lobefit_" + std::string(model.info->name);
  return model_text(model, "wgsl") +
         "@group(0) @binding(0) var<storage, read> flat: array<f32>;\n"
         "@group(0) @binding(1) var<storage, read> pairs: array<f32>;\n"
         "@group(0) @binding(2) var<storage, read_write> values: array<f32>;\n"
         "@compute @workgroup_size(64) fn run(@builtin(global_invocation_id) id: vec3u) {\n"
         "  let i = id.x;\n"
         "  if (6u * i >= arrayLength(&pairs)) { return; }\n"
         "  var p = " +
         function + "_Fitted();\n" + read_parameters(model, "vec3f") +
         "  let wi = vec3f(pairs[6u * i], pairs[6u * i + 1u], pairs[6u * i + 2u]);\n"
         "  let wo = vec3f(pairs[6u * i + 3u], pairs[6u * i + 4u], pairs[6u * i + 5u]);\n"
         "  let f = " +
         function +
         "(wi, wo, p);\n"
         "  values[3u * i] = f.x;\n  values[3u * i + 1u] = f.y;\n  values[3u * i + 2u] = f.z;\n"
         "  if (arrayLength(&flat) == 0u) { values[0] = 0.0; }\n}\n";
}

std::vector<float> flat_of(const ParameterValues& set) {
  std::vector<float> flat;
  for (const double value : set.flat()) flat.push_back(static_cast<float>(value));
  if (flat.empty()) flat.push_back(0.0f);  // a buffer can't be empty
  return flat;
}

std::vector<float> floats_of_base64(const std::string& text) {
  const std::string bytes = bytes_of_base64(text);
  std::vector<float> floats(bytes.size() / sizeof(float));
  std::memcpy(floats.data(), bytes.data(), floats.size() * sizeof(float));
  return floats;
}

class WgslRun : public ::testing::Test {
 protected:
  WgslRun()
      : folder_(fs::path(::testing::TempDir()) /
                ("lobefit_wgsl_" + std::string(::testing::UnitTest::GetInstance()->current_test_info()->name()))) {
    fs::create_directories(folder_);
  }
  ~WgslRun() override { fs::remove_all(folder_); }

  Json run(const Json& jobs, std::span<const float> pairs) {
    const fs::path data = folder_ / "pairs.bin";
    std::ofstream(data, std::ios::binary)
        .write(reinterpret_cast<const char*>(pairs.data()), static_cast<std::streamsize>(pairs.size_bytes()));
    return webgpu_results({{"pairs", data.string()}, {"jobs", jobs}}, (folder_ / "run").string());
  }

  fs::path folder_;
};

TEST_F(WgslRun, EveryModelComputesWhatItIs) {
  if (!has_shader_compiler("wgsl")) GTEST_SKIP() << no_shader_compiler;
  const std::vector<float> pairs = float_pairs(std::size_t{1} << 12, false);
  Json jobs = Json::array();
  for (const Model& model : models()) {
    Json flat = Json::array();
    for (const ParameterValues& set : parameter_sets(model, 2)) flat.push_back(flat_of(set));
    jobs.push_back({{"name", model.info->name}, {"text", job_text(model)}, {"flat", std::move(flat)}});
  }
  const Json results = run(jobs, pairs);
  ASSERT_EQ(results.size(), models().size());
  for (const Model& model : models()) {
    const std::string name(model.info->name);
    const Json& result = results.at(name);
    EXPECT_EQ(result.at("messages"), Json::array()) << name;
    const std::vector<ParameterValues> sets = parameter_sets(model, 2);
    ASSERT_EQ(result.at("values").size(), sets.size()) << name;
    std::size_t set = 0;
    const Agreement found = agreement(
        model,
        [&](const float*, const float*, long count, float* values) {
          const std::vector<float> floats = floats_of_base64(result.at("values").at(set++).get<std::string>());
          ASSERT_EQ(floats.size(), static_cast<std::size_t>(3 * count));
          std::copy(floats.begin(), floats.end(), values);
        },
        sets, pairs);
    EXPECT_EQ(found.failures, 0u) << name << ": error " << found.worst << " bounds at " << found.where;
  }
}

TEST_F(WgslRun, WrongTextsAreCaught) {
  if (!has_shader_compiler("wgsl")) GTEST_SKIP() << no_shader_compiler;
  const Model& model = find_model("burley");
  const std::vector<float> pairs = float_pairs(std::size_t{1} << 10, false);
  const std::vector<ParameterValues> sets = parameter_sets(model, 1);
  std::string constant = job_text(model), syntax = constant;
  const std::size_t at = constant.find("0.5", constant.find("fn Lobefit_burley("));
  ASSERT_NE(at, std::string::npos) << constant;
  constant.replace(at, 3, "0.5005");
  syntax.insert(syntax.find("return"), "let x: f32 = vec3f(1.0);\n");
  const Json results = run({{{"name", "constant"}, {"text", constant}, {"flat", {flat_of(sets[0])}}},
                            {{"name", "syntax"}, {"text", syntax}, {"flat", {flat_of(sets[0])}}}},
                           pairs);
  EXPECT_NE(results.at("syntax").at("messages").dump().find("error"), std::string::npos) << results.at("syntax");
  const std::vector<float> floats = floats_of_base64(results.at("constant").at("values").at(0).get<std::string>());
  const Agreement found = agreement(
      model, [&](const float*, const float*, long, float* values) { std::copy(floats.begin(), floats.end(), values); },
      sets, pairs);
  EXPECT_GT(found.failures, 100u);
}

}  // namespace
}  // namespace lobefit
