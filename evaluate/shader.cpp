#include "evaluate/shader.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <map>
#include <set>

namespace lobefit {

namespace {

struct Language {
  std::string_view name;
  std::string_view vector;  // type of three floats
  std::string_view lerp;
  bool has_saturate;
  bool has_initializer_lists;
};

constexpr std::array languages{Language{"hlsl", "float3", "lerp", true, true},
                               Language{"glsl", "vec3", "mix", false, false}};

const Language& find_language(std::string_view name) {
  std::string known;
  for (const Language& language : languages) {
    if (language.name == name) return language;
    known += (known.empty() ? "" : ", ") + std::string(language.name);
  }
  throw Error(ExitCode::usage, "unknown shader language '" + std::string(name) + "'", "--lang",
              "choose one of " + known);
}

std::string literal_text(double value) {
  if (value == pi) return "LOBEFIT_PI";
  std::array<char, 32> buffer;
  const auto [end, code] = std::to_chars(buffer.data(), buffer.data() + buffer.size(), static_cast<float>(value));
  std::string text(buffer.data(), end);
  if (text.find_first_of(".e") == std::string::npos) text += ".0";
  return text;
}

std::string upper_case(std::string text) {
  for (char& c : text) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  return text;
}

/// Names that a local must not take: the parameter struct's, and words that either language reserves or defines.
const std::set<std::string>& reserved_names() {
  static const std::set<std::string> names{
      "p",      "half",      "double", "sample", "smooth",  "flat",  "shared",    "input",   "output",
      "common", "partition", "active", "filter", "texture", "point", "line",      "linear",  "matrix",
      "vector", "min",       "max",    "abs",    "floor",   "clamp", "lerp",      "mix",     "sqrt",
      "exp",    "exp2",      "log",    "log2",   "pow",     "dot",   "normalize", "cross",   "length",
      "step",   "fract",     "sign",   "mod",    "out",     "in",    "inout",     "discard", "saturate"};
  return names;
}

/// A constant array, eight entries a line.
std::string table_text(const Language& language, const ShaderTable& table) {
  const std::string guard = "LOBEFIT_TABLE_" + upper_case(table.name);
  const std::string type = "float[" + std::to_string(table.entries.size()) + "]";
  std::string text = "#ifndef " + guard + "\n#define " + guard + "\n";
  text += (language.has_initializer_lists ? "static const float " : "const float ") + ("Lobefit_" + table.name) +
          "_entries" + type.substr(5) + " = " + (language.has_initializer_lists ? "{" : type + "(");
  for (std::size_t i = 0; i < table.entries.size(); ++i) {
    text += (i == 0 ? "" : ",") + std::string(i % 8 == 0 ? "\n    " : " ") + literal_text(table.entries[i]);
  }
  return text + (language.has_initializer_lists ? "\n};\n#endif\n\n" : "\n);\n#endif\n\n");
}

/// Binding strength, so that parentheses stand just where the graph needs them.
enum Precedence { ternary, comparison, sum, product, unary, primary };

/// Prints the body of one function.
class FunctionPrinter {
 public:
  FunctionPrinter(const Language& language, const ShaderFunction& function) : language_(language) {
    std::vector<const ShaderNode*> reachable;
    collect(function.result, reachable);
    // The order of the model's text; within one statement it is the compiler's order of evaluation.
    std::sort(reachable.begin(), reachable.end(), [](auto* a, auto* b) { return a->order < b->order; });
    taken_ = reserved_names();
    for (const ShaderArgument& argument : function.arguments) taken_.insert(argument.name);
    std::map<const ShaderNode*, const ShaderNode*> let_of;
    for (const ShaderNode* node : reachable) {
      if (node->operation == Operation::let) let_of.emplace(node->operands[0], node);
    }
    for (const ShaderNode* node : reachable) {
      const auto let = let_of.find(node);
      if (let != let_of.end()) {
        // The text's own name for this value, also where the text wrote it out again.
        define(node, let->second->name);
      } else if (node->operation == Operation::let) {
        names_.emplace(node, names_.at(node->operands[0]));
      } else if (uses_[node] > 1 && !is_atom(*node)) {
        define(node, "t" + std::to_string(temporaries_++));
      }
    }
    body_ += "    return " + text(*function.result, ternary) + ";\n";
  }

  const std::string& body() const { return body_; }

 private:
  static bool is_atom(const ShaderNode& node) {
    switch (node.operation) {
      case Operation::literal:
      case Operation::input:
      case Operation::component: return true;
      case Operation::negate: return is_atom(*node.operands[0]);
      default: return false;
    }
  }

  void collect(const ShaderNode* node, std::vector<const ShaderNode*>& reachable) {
    if (uses_[node]++ > 0) return;
    for (const ShaderNode* operand : node->operands) collect(operand, reachable);
    reachable.push_back(node);
  }

  void define(const ShaderNode* node, const std::string& wanted) {
    std::string name = wanted;
    for (int i = 2; !taken_.insert(name).second; ++i) name = wanted + "_" + std::to_string(i);
    body_ += "    " + type(node->type) + " " + name + " = " + text(*node, ternary) + ";\n";
    names_.emplace(node, name);
  }

  std::string type(ShaderType type) const {
    switch (type) {
      case ShaderType::boolean: return "bool";
      case ShaderType::scalar: return "float";
      case ShaderType::vector: return std::string(language_.vector);
    }
    return "";
  }

  std::string text(const ShaderNode& node, Precedence outer) const {
    const auto named = names_.find(&node);
    if (named != names_.end()) return named->second;
    const auto binary = [&](const char* symbol, Precedence own) {
      // The right operand binds one step tighter: the order of rounding in the graph is kept.
      const std::string inner = text(*node.operands[0], own) + symbol + text(*node.operands[1], Precedence(own + 1));
      return own < outer ? "(" + inner + ")" : inner;
    };
    switch (node.operation) {
      case Operation::literal: {
        const std::string digits = literal_text(node.literal);
        return node.literal < 0.0 && outer > sum ? "(" + digits + ")" : digits;
      }
      case Operation::input: return node.name;
      case Operation::component: return text(*node.operands[0], primary) + "." + node.name;
      case Operation::let: return text(*node.operands[0], outer);
      case Operation::construct: return std::string(language_.vector) + "(" + list(node) + ")";
      case Operation::add: return binary(" + ", sum);
      case Operation::subtract: return binary(" - ", sum);
      case Operation::multiply: return binary(" * ", product);
      case Operation::divide: return binary(" / ", product);
      case Operation::less: return binary(" < ", comparison);
      case Operation::greater: return binary(" > ", comparison);
      case Operation::less_equal: return binary(" <= ", comparison);
      case Operation::greater_equal: return binary(" >= ", comparison);
      case Operation::negate: {
        const std::string inner = "-" + text(*node.operands[0], primary);
        return outer > sum ? "(" + inner + ")" : inner;
      }
      case Operation::select: {
        const std::string inner = text(*node.operands[0], comparison) + " ? " + text(*node.operands[1], comparison) +
                                  " : " + text(*node.operands[2], comparison);
        return outer > ternary ? "(" + inner + ")" : inner;
      }
      case Operation::call: return "Lobefit_" + node.name + "(" + list(node) + ")";
      case Operation::entry: return "Lobefit_" + node.name + "_entries[int(" + text(*node.operands[0], ternary) + ")]";
      case Operation::intrinsic:
        if (node.name == "saturate" && !language_.has_saturate) return "clamp(" + list(node) + ", 0.0, 1.0)";
        return (node.name == "lerp" ? std::string(language_.lerp) : node.name) + "(" + list(node) + ")";
    }
    return "";
  }

  std::string list(const ShaderNode& node) const {
    std::string joined;
    for (const ShaderNode* operand : node.operands) joined += (joined.empty() ? "" : ", ") + text(*operand, ternary);
    return joined;
  }

  const Language& language_;
  std::map<const ShaderNode*, int> uses_;
  std::map<const ShaderNode*, std::string> names_;
  std::set<std::string> taken_;
  std::string body_;
  int temporaries_ = 0;
};

}  // namespace

std::vector<std::string> shader_languages() {
  std::vector<std::string> names;
  for (const Language& language : languages) names.emplace_back(language.name);
  return names;
}

std::string print_shader(const Shader& shader, std::string_view language_name, const ModelInfo& model,
                         std::span<const ShaderParameter> parameters, std::span<const std::string> provenance) {
  const Language& language = find_language(language_name);
  const std::string vector(language.vector);
  const std::string name = "Lobefit_" + std::string(model.name);
  std::string text = "// " + std::string(model.title) + ".\n// Source: " + std::string(model.source) + ".\n";
  for (const std::string& line : provenance) text += "// " + line + "\n";
  const std::string_view axis = is_hair(model.kind) ? "the fibre's axis" : "the normal";
  const std::string_view result =
      is_hair(model.kind) && is_term(model.kind) ? "the term, the same in all channels"
      : is_hair(model.kind) ? "S in 1/sr: the radiance that leaves is the integral of S L over all directions, without "
                              "cosine"
      : is_term(model.kind) ? "the term at their half vector, the same in all channels"
                            : "the BRDF in 1/sr, without cosine";
  text += "// wi: to the light, wo: to the viewer; unit vectors of the tangent frame, z " + std::string(axis) +
          ".\n// Returns " + std::string(result) + "." +
          (model.transmits ? "\n// Multiply it by |N.L|: light from behind comes through." : "") +
          "\n\n"
          "#ifndef LOBEFIT_PI\n#define LOBEFIT_PI 3.14159265\n#endif\n\n";

  text += "struct " + name + "_Parameters {\n";
  for (const ShaderParameter& parameter : parameters) {
    const ParameterInfo& info = parameter.info;
    text += "    " + (info.components == 3 ? vector : std::string("float")) + " " + std::string(info.name) + ";  // " +
            std::string(info.doc) + " Range " + number_text(info.lower) + " to " + number_text(info.upper) +
            (info.unit.empty() ? "" : " " + std::string(info.unit)) + ".\n";
  }
  // GLSL has no empty structs.
  if (parameters.empty()) text += "    float unused;\n";
  text += "};\n\n";

  for (const ShaderTable& table : shader.tables) text += table_text(language, table);
  for (const ShaderFunction& function : shader.functions) {
    const std::string guard = "LOBEFIT_FUNCTION_" + upper_case(function.name);
    std::string arguments;
    for (const ShaderArgument& argument : function.arguments) {
      arguments += (arguments.empty() ? "" : ", ") +
                   (argument.type == ShaderType::vector ? vector : std::string("float")) + " " + argument.name;
    }
    text += "#ifndef " + guard + "\n#define " + guard + "\n" +
            (function.result->type == ShaderType::vector ? vector : std::string("float")) + " Lobefit_" +
            function.name + "(" + arguments + ") {\n" + FunctionPrinter(language, function).body() + "}\n#endif\n\n";
  }

  text += vector + " " + name + "(" + vector + " wi, " + vector + " wo, " + name + "_Parameters p) {\n" +
          FunctionPrinter(language, shader.brdf).body() + "}\n\n";

  text += name + "_Parameters " + name + "_Fitted() {\n    " + name + "_Parameters p;\n";
  for (const ShaderParameter& parameter : parameters) {
    std::string value;
    for (const double component : parameter.value) value += (value.empty() ? "" : ", ") + literal_text(component);
    if (parameter.value.size() == 3) value = vector + "(" + value + ")";
    text += "    p." + std::string(parameter.info.name) + " = " + value + ";" +
            (parameter.comment.empty() ? "" : "  // " + parameter.comment) + "\n";
  }
  if (parameters.empty()) text += "    p.unused = 0.0;\n";
  text += "    return p;\n}\n";
  return text;
}

}  // namespace lobefit
