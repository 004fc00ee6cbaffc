#include "evaluate/spirv.h"

#include <glslang/Public/ResourceLimits.h>
#include <glslang/Public/ShaderLang.h>
#include <glslang/SPIRV/GlslangToSpv.h>

#include <algorithm>
#include <cstdio>
#include <sstream>

#include "models/error.h"

namespace lobefit {

namespace {

/// glslang's tables, once for the process.
struct Compiler {
  Compiler() { glslang::InitializeProcess(); }
  ~Compiler() { glslang::FinalizeProcess(); }
};

std::string line_of(const std::string& text, int number) {
  std::istringstream lines(text);
  std::string line;
  for (int i = 0; i < number && std::getline(lines, line);) ++i;
  return line.substr(std::min(line.find_first_not_of(' '), line.size()));
}

/// From a log that starts as "ERROR: 0:12: 'x' : undeclared identifier".
Error complaint(std::string_view language, const std::string& text, const std::string& log) {
  std::string first = log.substr(0, log.find('\n'));
  first.erase(first.find_last_not_of(' ') + 1);
  int line = 0;
  std::sscanf(first.c_str(), "ERROR: 0:%d:", &line);
  return {ExitCode::failure, "glslang refuses the " + std::string(language) + " text: " + first,
          line > 0 ? line_of(text, line) : "", "please report it with the command line"};
}

}  // namespace

std::vector<std::uint32_t> compile_shader(std::string_view language, const std::string& text) {
  static const Compiler compiler;
  const bool hlsl = language == "hlsl";
  const auto messages =
      static_cast<EShMessages>(EShMsgSpvRules | EShMsgVulkanRules | (hlsl ? EShMsgReadHlsl : EShMsgDefault));
  const char* source = text.c_str();
  glslang::TShader shader(EShLangCompute);
  shader.setStrings(&source, 1);
  shader.setEntryPoint("main");
  shader.setEnvInput(hlsl ? glslang::EShSourceHlsl : glslang::EShSourceGlsl, EShLangCompute, glslang::EShClientVulkan,
                     100);
  shader.setEnvClient(glslang::EShClientVulkan, glslang::EShTargetVulkan_1_0);
  shader.setEnvTarget(glslang::EShTargetSpv, glslang::EShTargetSpv_1_0);
  constexpr int default_version = 450;
  if (!shader.parse(GetDefaultResources(), default_version, false, messages)) {
    throw complaint(language, text, shader.getInfoLog());
  }
  glslang::TProgram program;
  program.addShader(&shader);
  if (!program.link(messages)) throw complaint(language, text, program.getInfoLog());
  std::vector<unsigned int> words;
  glslang::GlslangToSpv(*program.getIntermediate(EShLangCompute), words);
  return {words.begin(), words.end()};
}

}  // namespace lobefit
