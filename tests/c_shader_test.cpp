// Exported C text, compiled by the system's compiler and run: what it computes is what the models compute.
#include <dlfcn.h>
#include <gtest/gtest.h>
#include <tbb/parallel_for.h>
#include <unistd.h>

#include <cstring>
#include <filesystem>

#include "evaluate/check.h"
#include "evaluate/conditioning.h"
#include "evaluate/shader.h"
#include "tests/directions.h"
#include "tests/shader_compiler.h"

namespace lobefit {
namespace {

namespace fs = std::filesystem;

/// C text of a model, and evaluate_NAME(), which runs it over pairs: `flat` are its parameters, `pairs` holds wi and
/// wo, `values` takes three numbers for each.
std::string batch_text(const Model& model) {
  const std::string name(model.info->name), function = "Lobefit_" + name;
  std::vector<ShaderParameter> parameters;
  std::string members;
  for (const ParameterInfo& info : model.parameters) {
    parameters.push_back({info, std::vector<double>(static_cast<std::size_t>(info.components), info.initial), ""});
    const auto component = [&](int k) {
      return "flat[" + std::to_string(info.offset + static_cast<std::size_t>(k)) + "]";
    };
    members += "  p." + std::string(info.name) + " = " +
               (info.components == 3 ? "Lobefit_make3(" + component(0) + ", " + component(1) + ", " + component(2) + ")"
                                     : component(0)) +
               ";\n";
  }
  return print_shader(find_float_model(name).trace(), "c", *model.info, parameters, {}) + "void evaluate_" + name +
         "(const float* flat, const float* pairs, long count, float* values);\nvoid evaluate_" + name +
         "(const float* flat, const float* pairs, long count, float* values) {\n  " + function +
         "_Parameters p = " + function + "_Fitted();\n" + members +
         "  for (long i = 0; i < count; ++i, pairs += 6, values += 3) {\n"
         "    Lobefit_float3 f = " +
         function +
         "(Lobefit_make3(pairs[0], pairs[1], pairs[2]), "
         "Lobefit_make3(pairs[3], pairs[4], pairs[5]), p);\n"
         "    values[0] = f.x, values[1] = f.y, values[2] = f.z;\n  }\n  (void)flat;\n}\n\n";
}

using Evaluate = void (*)(const float* flat, const float* pairs, long count, float* values);

/// A text as a shared library, while it lives.
class Library {
 public:
  Library(const std::string& text, const std::string& name)
      : stem_(::testing::TempDir() + "lobefit_c_" + name + "_" + std::to_string(getpid())) {
    std::ofstream(stem_ + ".c") << text;
    complaint_ = command_complaint(
        "cc -std=c99 -O2 -shared -fPIC " + std::string(c_warnings) + " -o '" + stem_ + ".so' '" + stem_ + ".c' -lm",
        stem_);
    if (complaint_.empty()) handle_ = dlopen((stem_ + ".so").c_str(), RTLD_NOW | RTLD_LOCAL);
    if (complaint_.empty() && !handle_) complaint_ = dlerror();
  }
  ~Library() {
    if (handle_) dlclose(handle_);
    for (const char* ending : {".c", ".so"}) fs::remove(stem_ + ending);
  }
  Library(const Library&) = delete;
  Library& operator=(const Library&) = delete;

  const std::string& complaint() const { return complaint_; }
  Evaluate evaluate(const std::string& model) const {
    return reinterpret_cast<Evaluate>(dlsym(handle_, ("evaluate_" + model).c_str()));
  }

 private:
  std::string stem_, complaint_;
  void* handle_ = nullptr;
};

/// Random pairs and hostile ones, rounded to float; those of fibres point everywhere.
std::vector<float> float_pairs(std::size_t count, bool sphere) {
  std::vector<DirectionPair> pairs = hostile_pairs();
  // What check's own pairs go down to: below, 1/cos leaves the range of floats.
  std::erase_if(pairs, [](const DirectionPair& pair) { return std::min(pair.wi.z, pair.wo.z) < 9e-7; });
  const std::vector<DirectionPair> random = random_pairs(count - pairs.size(), 91);
  pairs.insert(pairs.end(), random.begin(), random.end());
  std::vector<float> result;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    if (sphere && (i + i / 64) % 2 == 1) pairs[i].wi.z = -pairs[i].wi.z;
    for (const Direction& w : {pairs[i].wi, pairs[i].wo}) {
      for (const double x : {w.x, w.y, w.z}) result.push_back(static_cast<float>(x));
    }
  }
  return result;
}

struct Agreement {
  std::size_t failures = 0, conditioned = 0;
  double worst = 0.0;  // error over bound
  std::string where;
};

/// Holds a compiled text against the model in double, by the bounds of `lobefit check`: both see the same floats.
Agreement agreement(const Model& model, Evaluate evaluate, std::span<const ParameterValues> sets,
                    std::span<const float> pairs) {
  const CheckOptions bounds;
  const std::size_t count = pairs.size() / 6;
  const bool hair = is_hair(model.info->kind);
  Agreement result;
  for (const ParameterValues& set : sets) {
    std::vector<float> flat;
    for (const double value : set.flat()) flat.push_back(static_cast<float>(value));
    const std::vector<double> wide(flat.begin(), flat.end());
    std::vector<float> values(3 * count);
    evaluate(flat.data(), pairs.data(), static_cast<long>(count), values.data());
    std::vector<double> excess(count);
    std::vector<std::uint8_t> conditioned(count);
    tbb::parallel_for(std::size_t{0}, count, [&](std::size_t i) {
      const float* x = pairs.data() + 6 * i;
      const Direction wi{x[0], x[1], x[2]}, wo{x[3], x[4], x[5]};
      const Rgb f = model.evaluate(wide, wi, wo);
      const std::array<double, 3> truth{f.x, f.y, f.z};
      for (std::size_t c = 0; c < 3; ++c) {
        const double error = std::abs(values[3 * i + c] - truth[c]);
        double bound =
            bounds.relative_bound * std::abs(truth[c]) + bounds.absolute_bound / (hair ? 1.0 : std::abs(wi.z));
        if (!(error <= bound)) {
          bound += float_conditioning(model, wide, wi, wo)[c];
          conditioned[i] = 1;
        }
        excess[i] = std::max(excess[i], std::isfinite(error) ? error / bound : INFINITY);
      }
    });
    for (std::size_t i = 0; i < count; ++i) {
      if (excess[i] > 1.0) ++result.failures;
      if (conditioned[i] != 0 && excess[i] <= 1.0) ++result.conditioned;
      if (excess[i] <= result.worst) continue;
      result.worst = excess[i];
      result.where = "wi";
      for (std::size_t k = 0; k < 6; ++k) result.where += " " + std::to_string(pairs[6 * i + k]);
      for (const ParameterInfo& info : model.parameters) {
        result.where += ", " + std::string(info.name) + " " + set.text(info);
      }
    }
  }
  return result;
}

std::vector<ParameterValues> parameter_sets(const Model& model, int count) {
  std::vector<std::string> names;
  for (const ParameterInfo& info : model.parameters) names.emplace_back(info.name);
  return varied_parameters(model.defaults(), names, count, 92);
}

void expect_agreement(const Model& model, const Library& library, std::size_t pairs, int sets) {
  const std::string name(model.info->name);
  ASSERT_EQ(library.complaint(), "");
  const Evaluate evaluate = library.evaluate(name);
  ASSERT_TRUE(evaluate) << name;
  const bool sphere = is_hair(model.info->kind) || model.info->transmits;
  const Agreement found = agreement(model, evaluate, parameter_sets(model, sets), float_pairs(pairs, sphere));
  EXPECT_EQ(found.failures, 0u) << name << ": error " << found.worst << " bounds at " << found.where;
}

TEST(CShader, AllModelsInOneTextComputeWhatTheyAre) {
  if (!has_shader_compiler("c")) GTEST_SKIP() << "no C compiler: cc";
  std::string text;
  for (const Model& model : models()) text += is_term(model.info->kind) ? "" : batch_text(model);
  const Library library(text, "models");
  for (const Model& model : models()) {
    if (!is_term(model.info->kind)) expect_agreement(model, library, std::size_t{1} << 14, 4);
  }
}

// A term has the name of the function that models call: in C they don't stand in one text.
TEST(CShader, TermsComputeWhatTheyAre) {
  if (!has_shader_compiler("c")) GTEST_SKIP() << "no C compiler: cc";
  for (const Model& model : models()) {
    if (!is_term(model.info->kind)) continue;
    const Library library(batch_text(model), std::string(model.info->name));
    expect_agreement(model, library, std::size_t{1} << 14, 4);
  }
}

TEST(CShader, AMillionPairsOfWhatIsExportedMost) {
  if (!has_shader_compiler("c")) GTEST_SKIP() << "no C compiler: cc";
  for (const char* name : {"proxima", "callisto", "eon"}) {
    const Library library(batch_text(find_model(name)), name);
    expect_agreement(find_model(name), library, std::size_t{1} << 17, 8);
  }
}

TEST(CShader, AWrongConstantIsCaught) {
  if (!has_shader_compiler("c")) GTEST_SKIP() << "no C compiler: cc";
  // One constant of each text, off by a thousandth.
  const std::vector<std::array<std::string, 3>> changes{
      {"oren_nayar", "0.33f", "0.33033f"}, {"burley", "0.5f", "0.5005f"}, {"hammon", "0.1159f", "0.1160159f"}};
  for (const auto& [name, right, wrong] : changes) {
    const Model& model = find_model(name);
    std::string text = batch_text(model);
    const std::size_t function = text.find("Lobefit_" + name + "(Lobefit_float3 wi"), at = text.find(right, function);
    ASSERT_NE(at, std::string::npos) << text;
    text.replace(at, right.size(), wrong);
    const Library library(text, name);
    ASSERT_EQ(library.complaint(), "");
    const Agreement found =
        agreement(model, library.evaluate(name), parameter_sets(model, 4), float_pairs(std::size_t{1} << 12, false));
    EXPECT_GT(found.failures, 100u) << name;
  }
}

}  // namespace
}  // namespace lobefit
