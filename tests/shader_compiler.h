// glslangValidator, which judges shader texts.
#pragma once

#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <string>
#include <string_view>

namespace lobefit {

inline bool has_shader_compiler() { return std::system("command -v glslangValidator > /dev/null") == 0; }

/// Compiles a compute shader that stores `expression`, of three components, after `text`. Returns the compiler's
/// complaint with the source, or "". `name` tells the temporary files of tests apart.
inline std::string shader_complaint(std::string_view language, const std::string& text, const std::string& expression,
                                    const std::string& name) {
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
  const std::string command =
      "glslangValidator " + flags + " -o '" + stem + ".spv' '" + stem + ".comp' > '" + stem + ".log' 2>&1";
  const int status = std::system(command.c_str());
  std::ostringstream log;
  log << std::ifstream(stem + ".log").rdbuf();
  for (const char* ending : {".comp", ".spv", ".log"}) std::remove((stem + ending).c_str());
  return status == 0 ? "" : log.str() + source;
}

}  // namespace lobefit
