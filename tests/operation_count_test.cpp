// Operation counts of the traced graph against a second count: of opcodes in SPIR-V that glslangValidator and
// spirv-opt -O make of the exported GLSL. scripts/operation_counts writes what is recorded here into
// docs/operation_counts.md.
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <map>
#include <sstream>

#include "evaluate/float_model.h"
#include "evaluate/operation_cost.h"
#include "evaluate/vulkan_evaluator.h"
#include "tests/shader_compiler.h"

namespace lobefit {
namespace {

bool has_tools() {
  return has_shader_compiler("glsl") &&
         std::system("command -v spirv-opt > /dev/null && command -v spirv-dis > /dev/null") == 0;
}

/// The model's function in a compute shader whose every input is memory, so that nothing can be folded.
std::string compute_shader(const Model& model) {
  const std::string name = "Lobefit_" + std::string(model.info->name);
  return "#version 450\nlayout(local_size_x = 64) in;\n" + model_text(model, "glsl") +
         "layout(std430, binding = 0) readonly buffer Inputs { vec3 wi; vec3 wo; " + name +
         "_Parameters p; };\nlayout(std430, binding = 1) writeonly buffer Outputs { vec3 value; };\nvoid main() { "
         "value = " +
         name + "(wi, wo, p); }\n";
}

std::string disassembly(const Model& model) {
  const std::string stem = (std::filesystem::temp_directory_path() / ("lobefit_count_" + std::to_string(getpid())));
  std::ofstream(stem + ".comp") << compute_shader(model);
  const std::string command = "glslangValidator --quiet -V '" + stem + ".comp' -o '" + stem +
                              ".spv' && spirv-opt -O '" + stem + ".spv' -o '" + stem + ".opt' && spirv-dis --raw-id '" +
                              stem + ".opt' -o '" + stem + ".txt'";
  EXPECT_EQ(command_complaint(command, stem), "");
  std::ostringstream text;
  text << std::ifstream(stem + ".txt").rdbuf();
  for (const char* extension : {".comp", ".spv", ".opt", ".txt"}) std::filesystem::remove(stem + extension);
  return text.str();
}

/// What an optimised shader does, and what of it the optimiser brought in.
struct OpcodeCount {
  OperationCount operations;
  int fused = 0;    // multiplications in Fma
  int negated = 0;  // signs, which hardware has for nothing
};

/// By the names of SPIR-V's specification; a vector's instruction counts once per component.
OpcodeCount count_opcodes(const std::string& text) {
  OpcodeCount found;
  OperationCount& count = found.operations;
  std::map<std::string, int> widths;  // of types, by id
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line);
    std::string id, equals, opcode, type, first, second;
    words >> id >> equals >> opcode >> type >> first >> second;
    if (equals != "=") continue;
    if (opcode == "OpTypeFloat" || opcode == "OpTypeBool") widths[id] = 1;
    if (opcode == "OpTypeVector") widths[id] = std::stoi(first);
    if (!widths.contains(type)) continue;
    const int width = widths.at(type);
    if (opcode == "OpFNegate") found.negated += width;
    if (opcode == "OpExtInst" && second == "Fma") found.fused += width;
    if (opcode == "OpFAdd" || opcode == "OpFSub" || opcode == "OpFMul" || opcode == "OpFNegate" ||
        opcode == "OpVectorTimesScalar") {
      count.add_multiply += width;
    } else if (opcode == "OpDot") {
      count.add_multiply += 5;  // of three components
    } else if (opcode == "OpFDiv") {
      count.divide += width;
    } else if (opcode == "OpSelect" || opcode == "OpPhi" || opcode.starts_with("OpFOrd") ||
               opcode.starts_with("OpFUnord") || opcode.starts_with("OpLogical")) {
      // Where two paths meet, one value is chosen, whether by a branch or not.
      count.compare_select += width;
    } else if (opcode == "OpExtInst") {
      if (second == "FMix") {
        count.add_multiply += 3 * width;
      } else if (second == "Fma") {
        count.add_multiply += 2 * width;
      } else if (second == "Normalize") {
        count.add_multiply += 8, count.square_root += 1, count.divide += 1;
      } else if (second == "Sqrt" || second == "InverseSqrt") {
        count.square_root += width;
      } else if (second == "Pow") {
        count.transcendental += 2 * width, count.add_multiply += width;
      } else if (second == "Exp" || second == "Exp2" || second == "Log" || second == "Log2") {
        count.transcendental += width;
      } else if (second == "FMin" || second == "FMax" || second == "FClamp" || second == "FAbs" || second == "Floor") {
        count.compare_select += width;
      } else {
        ADD_FAILURE() << "unknown instruction " << second;
      }
    } else if (opcode.starts_with("OpF") && opcode != "OpFunction" && opcode != "OpFunctionParameter") {
      ADD_FAILURE() << "unknown opcode " << opcode;
    }
  }
  return found;
}

class OpcodesOfModel : public ::testing::TestWithParam<std::string> {};

INSTANTIATE_TEST_SUITE_P(Models, OpcodesOfModel,
                         ::testing::Values("lambert", "proxima", "burley", "eon", "specular_ggx", "callisto",
                                           "hair_unreal"),
                         [](const auto& test) { return test.param; });

TEST_P(OpcodesOfModel, AreTheCountedOperations) {
  if (!has_tools()) GTEST_SKIP() << "needs glslang-tools and spirv-tools";
  const Model& model = find_model(GetParam());
  const OperationCount graph = count_operations(find_float_model(GetParam()).trace());
  const OpcodeCount opcodes = count_opcodes(disassembly(model));
  const OperationCount& spirv = opcodes.operations;
  const auto record = [&](const std::string& name, int OperationCount::*member) {
    RecordProperty("graph_" + name, graph.*member);
    RecordProperty("spirv_" + name, spirv.*member);
  };
  record("add_multiply", &OperationCount::add_multiply);
  record("divide", &OperationCount::divide);
  record("square_root", &OperationCount::square_root);
  record("transcendental", &OperationCount::transcendental);
  record("compare_select", &OperationCount::compare_select);
  RecordProperty("graph_total", graph.total());
  RecordProperty("spirv_total", spirv.total());
  RecordProperty("graph_cycles", alu_cycles(graph));
  RecordProperty("spirv_cycles", alu_cycles(spirv));
  RecordProperty("spirv_fused", opcodes.fused);
  RecordProperty("spirv_negated", opcodes.negated);

  // No algebra of spirv-opt reaches these.
  EXPECT_EQ(spirv.square_root, graph.square_root);
  EXPECT_EQ(spirv.transcendental, graph.transcendental);
  // A division by a constant becomes a product, so only the sum is kept. To it spirv-opt adds what it needs to fuse
  // a ± b c: at most a sign, and a product again that several sums share. It takes away what two calls of a function
  // have in common.
  EXPECT_LE(spirv.divide, graph.divide);
  const int kept = graph.add_multiply + graph.divide, found = spirv.add_multiply + spirv.divide;
  EXPECT_LE(found, kept + opcodes.negated + opcodes.fused);
  EXPECT_GE(found, 0.95 * kept);
  // All of this is a tenth.
  EXPECT_NEAR(spirv.total(), graph.total(), 0.1 * graph.total());
  // So it is of the cycles, once what a product saves over a division is given back.
  const int saved = 4 * (graph.divide - spirv.divide);
  EXPECT_NEAR(alu_cycles(spirv) + saved, alu_cycles(graph), 0.1 * alu_cycles(graph));
}

TEST(OperationCounts, StandInTheDocument) {
  std::ostringstream document;
  document << std::ifstream(LOBEFIT_DOCS "/operation_counts.md").rdbuf();
  for (const char* name : {"lambert", "proxima", "callisto", "specular_ggx", "hair_unreal"}) {
    const OperationCount count = count_operations(find_float_model(name).trace());
    const std::string row = "| `" + std::string(name) + "` | graph | " + std::to_string(count.add_multiply) + " | " +
                            std::to_string(count.divide) + " |";
    EXPECT_NE(document.str().find(row), std::string::npos) << row << ": run scripts/operation_counts";
  }
}

}  // namespace
}  // namespace lobefit
