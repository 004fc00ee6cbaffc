// Exported C text, compiled by the system's compiler and run: what it computes is what the models compute.
#include <dlfcn.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstring>
#include <filesystem>

#include "tests/shader_agreement.h"
#include "tests/shader_compiler.h"

namespace lobefit {
namespace {

namespace fs = std::filesystem;

/// C text of a model, and evaluate_NAME(), which runs it over pairs: `flat` are its parameters, `pairs` holds wi and
/// wo, `values` takes three numbers for each.
std::string batch_text(const Model& model) {
  const std::string name(model.info->name), function = "Lobefit_" + name;
  return model_text(model, "c") + "void evaluate_" + name +
         "(const float* flat, const float* pairs, long count, float* values);\nvoid evaluate_" + name +
         "(const float* flat, const float* pairs, long count, float* values) {\n  " + function +
         "_Parameters p = " + function + "_Fitted();\n" + read_parameters(model, "Lobefit_make3") +
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
