// What judges shader texts: glslangValidator, for C the compilers of C and C++ with their warnings, for WGSL Chromium's
// Tint.
#pragma once

#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <string>
#include <string_view>

#include "reference/json_reader.h"
#include "reference/output_file.h"

namespace lobefit {

inline constexpr const char* no_shader_compiler =
    "no compiler to judge the text: glslangValidator (Debian: glslang-tools), cc, or for WGSL chromium";

inline bool has_shader_compiler(std::string_view language) {
  return std::system(language == "c"      ? "command -v cc > /dev/null"
                     : language == "wgsl" ? "command -v chromium > /dev/null"
                                          : "command -v glslangValidator > /dev/null") == 0;
}

/// A vector of three literals, such as "0.6".
inline std::string vector_text(std::string_view language, const std::string& x, const std::string& y,
                               const std::string& z) {
  if (language == "c") return "Lobefit_make3(" + x + "f, " + y + "f, " + z + "f)";
  return (language == "glsl" ? "vec3(" : language == "wgsl" ? "vec3f(" : "float3(") + x + ", " + y + ", " + z + ")";
}

/// Runs a command; what it printed where it failed, or "".
inline std::string command_complaint(const std::string& command, const std::string& stem) {
  const int status = std::system((command + " > '" + stem + ".log' 2>&1").c_str());
  std::ostringstream log;
  log << std::ifstream(stem + ".log").rdbuf();
  std::remove((stem + ".log").c_str());
  return status == 0 ? "" : command + "\n" + log.str();
}

inline constexpr std::string_view c_warnings =
    "-Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wdouble-promotion -Werror";

/// Compiles a function that returns `expression` after `text`, as C99 and as C++.
inline std::string c_complaint(const std::string& text, const std::string& expression, const std::string& name) {
  const std::string stem = ::testing::TempDir() + "lobefit_" + name + "_c";
  const std::string source =
      text + "Lobefit_float3 result(void);\nLobefit_float3 result(void) { return " + expression + "; }\n";
  std::ofstream(stem + ".c") << source;
  std::string complaint;
  for (const char* compiler : {"cc -std=c99", "c++ -x c++ -std=c++11"}) {
    complaint += command_complaint(
        std::string(compiler) + " " + std::string(c_warnings) + " -c -o /dev/null '" + stem + ".c'", stem);
  }
  std::remove((stem + ".c").c_str());
  return complaint.empty() ? "" : complaint + source;
}

/// What scripts/webgpu makes of `asked` (see there), with files that begin with `stem`.
inline Json webgpu_results(const Json& asked, const std::string& stem) {
  const std::string jobs = stem + "_jobs.json", results = stem + "_results.json";
  std::ofstream(jobs) << asked;
  const std::string complaint =
      command_complaint(LOBEFIT_SCRIPTS "/webgpu '" + jobs + "' '" + results + "'", stem + "_webgpu");
  EXPECT_EQ(complaint, "");
  const Json found = complaint.empty() ? parse_json(read_file(results), results) : Json::object();
  for (const std::string& file : {jobs, results}) std::remove(file.c_str());
  return found;
}

/// Compiles a function that returns `expression` after `text`.
inline std::string wgsl_complaint(const std::string& text, const std::string& expression, const std::string& name) {
  const std::string source = text + "\nfn result() -> vec3f { return " + expression + "; }\n";
  const Json results = webgpu_results({{"jobs", {{{"name", name}, {"text", source}, {"flat", Json::array()}}}}},
                                      ::testing::TempDir() + "lobefit_" + name);
  const Json messages = results.contains(name) ? results.at(name).at("messages") : Json{"no result"};
  return messages.empty() ? "" : messages.dump(2) + source;
}

/// Compiles a compute shader that stores `expression`, of three components, after `text`; or what c_complaint() or
/// wgsl_complaint() take. Returns the compiler's complaint with the source, or "". `name` tells the temporary files of
/// tests apart.
inline std::string shader_complaint(std::string_view language, const std::string& text, const std::string& expression,
                                    const std::string& name) {
  if (language == "c") return c_complaint(text, expression, name);
  if (language == "wgsl") return wgsl_complaint(text, expression, name);
  const bool is_glsl = language == "glsl";
  const std::string source =
      is_glsl ? "#version 450\nlayout(local_size_x = 1) in;\nlayout(std430, binding = 0) buffer Result { vec4 result; "
                "};\n" +
                    text + "void main() { result = vec4(" + expression + ", 1.0); }\n"
              : "RWStructuredBuffer<float3> result : register(u0);\n" + text +
                    "[numthreads(1, 1, 1)]\nvoid main(uint3 id : SV_DispatchThreadID) { result[id.x] = " + expression +
                    "; }\n";
  const std::string stem = ::testing::TempDir() + "lobefit_" + name + "_" + std::string(language);
  std::ofstream(stem + ".comp") << source;
  const std::string flags = is_glsl ? "-V -S comp" : "-D -V -S comp -e main";
  const std::string complaint =
      command_complaint("glslangValidator " + flags + " -o '" + stem + ".spv' '" + stem + ".comp'", stem);
  for (const char* ending : {".comp", ".spv"}) std::remove((stem + ending).c_str());
  return complaint.empty() ? "" : complaint + source;
}

}  // namespace lobefit
