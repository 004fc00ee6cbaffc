// Shader texts as the SPIR-V that Vulkan takes.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace lobefit {

/// Of shader_languages(), those that compile_shader() takes.
inline std::vector<std::string> spirv_languages() { return {"hlsl", "glsl"}; }

/// Compiles a compute shader, "glsl" or "hlsl", with the entry point main, for Vulkan 1.0. Throws Error(failure) with
/// the compiler's first complaint and the line that it is about.
std::vector<std::uint32_t> compile_shader(std::string_view language, const std::string& text);

}  // namespace lobefit
