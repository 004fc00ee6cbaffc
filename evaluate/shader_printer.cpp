#include "evaluate/shader_printer.h"

#include <algorithm>
#include <cctype>
#include <charconv>

namespace lobefit {

namespace {

constexpr std::array languages{ShaderLanguage{"hlsl", "float3", "lerp", true, true},
                               ShaderLanguage{"glsl", "vec3", "mix", false, false}};

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
std::string table_text(const ShaderLanguage& language, const ShaderTable& table) {
  const std::string guard = table_guard(table.name);
  const std::string type = "float[" + std::to_string(table.entries.size()) + "]";
  std::string text = "#ifndef " + guard + "\n#define " + guard + "\n";
  text += (language.has_initializer_lists ? "static const float " : "const float ") + table_array(table.name) +
          type.substr(5) + " = " + (language.has_initializer_lists ? "{" : type + "(");
  for (std::size_t i = 0; i < table.entries.size(); ++i) {
    text += (i == 0 ? "" : ",") + std::string(i % 8 == 0 ? "\n    " : " ") + literal_text(table.entries[i]);
  }
  return text + (language.has_initializer_lists ? "\n};\n#endif\n\n" : "\n);\n#endif\n\n");
}

bool is_atom(const ShaderNode& node) {
  switch (node.operation) {
    case Operation::literal:
    case Operation::input:
    case Operation::component: return true;
    case Operation::negate: return is_atom(*node.operands[0]);
    default: return false;
  }
}

std::string value_type(const ShaderLanguage& language, ShaderType type) {
  return type == ShaderType::vector ? std::string(language.vector) : "float";
}

}  // namespace

std::vector<std::string> shader_languages() {
  std::vector<std::string> names;
  for (const ShaderLanguage& language : languages) names.emplace_back(language.name);
  return names;
}

const ShaderLanguage& find_shader_language(std::string_view name) {
  std::string known;
  for (const ShaderLanguage& language : languages) {
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

std::string shader_prologue() { return "#ifndef LOBEFIT_PI\n#define LOBEFIT_PI 3.14159265\n#endif\n\n"; }

std::string table_array(std::string_view table) { return "Lobefit_" + std::string(table) + "_entries"; }
std::string table_guard(std::string_view table) { return "LOBEFIT_TABLE_" + upper_case(std::string(table)); }

std::string struct_text(const ShaderLanguage& language, const std::string& name,
                        std::span<const ShaderParameter> parameters) {
  const std::string guard = "LOBEFIT_STRUCT_" + upper_case(name);
  std::string text = "#ifndef " + guard + "\n#define " + guard + "\nstruct " + name + " {\n";
  for (const ShaderParameter& parameter : parameters) {
    const ParameterInfo& info = parameter.info;
    text += "    " + (info.components == 3 ? std::string(language.vector) : std::string("float")) + " " +
            std::string(info.name) + ";  // " + std::string(info.doc) + " Range " + number_text(info.lower) + " to " +
            number_text(info.upper) + (info.unit.empty() ? "" : " " + std::string(info.unit)) + ".\n";
  }
  // GLSL has no empty structs.
  if (parameters.empty()) text += "    float unused;\n";
  return text + "};\n#endif\n\n";
}

std::string values_text(const ShaderLanguage& language, const std::string& type, const std::string& function,
                        std::span<const ShaderParameter> parameters) {
  std::string text = type + " " + function + "() {\n    " + type + " p;\n";
  for (const ShaderParameter& parameter : parameters) {
    std::string value;
    for (const double component : parameter.value) value += (value.empty() ? "" : ", ") + literal_text(component);
    if (parameter.value.size() == 3) value = std::string(language.vector) + "(" + value + ")";
    text += "    p." + std::string(parameter.info.name) + " = " + value + ";" +
            (parameter.comment.empty() ? "" : "  // " + parameter.comment) + "\n";
  }
  if (parameters.empty()) text += "    p.unused = 0.0;\n";
  return text + "    return p;\n}\n";
}

std::string definitions_text(const ShaderLanguage& language, const Shader& shader) {
  std::string text;
  for (const ShaderTable& table : shader.tables) text += table_text(language, table);
  for (const ShaderFunction& function : shader.functions) {
    const std::string guard = "LOBEFIT_FUNCTION_" + upper_case(function.name);
    std::string arguments;
    for (const ShaderArgument& argument : function.arguments) {
      arguments += (arguments.empty() ? "" : ", ") + value_type(language, argument.type) + " " + argument.name;
    }
    text += "#ifndef " + guard + "\n#define " + guard + "\n" + value_type(language, function.result->type) +
            " Lobefit_" + function.name + "(" + arguments + ") {\n" + body_text(language, function) + "}\n#endif\n\n";
  }
  return text;
}

std::string body_text(const ShaderLanguage& language, const ShaderFunction& function) {
  std::vector<std::string> taken;
  for (const ShaderArgument& argument : function.arguments) taken.push_back(argument.name);
  const StatementPrinter printer(language, std::span(&function.result, 1), taken);
  return printer.statements() + "    return " + printer.text(*function.result) + ";\n";
}

StatementPrinter::StatementPrinter(const ShaderLanguage& language, std::span<const ShaderNode* const> results,
                                   std::span<const std::string> taken)
    : language_(language) {
  std::vector<const ShaderNode*> reachable;
  for (const ShaderNode* result : results) collect(result, reachable);
  // The order of the model's text; within one statement it is the compiler's order of evaluation.
  std::sort(reachable.begin(), reachable.end(), [](auto* a, auto* b) { return a->order < b->order; });
  taken_ = reserved_names();
  taken_.insert(taken.begin(), taken.end());
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
}

void StatementPrinter::collect(const ShaderNode* node, std::vector<const ShaderNode*>& reachable) {
  if (uses_[node]++ > 0) return;
  for (const ShaderNode* operand : node->operands) collect(operand, reachable);
  reachable.push_back(node);
}

void StatementPrinter::define(const ShaderNode* node, const std::string& wanted) {
  std::string name = wanted;
  for (int i = 2; !taken_.insert(name).second; ++i) name = wanted + "_" + std::to_string(i);
  statements_ += "    " + type(node->type) + " " + name + " = " + text(*node, ternary) + ";\n";
  names_.emplace(node, name);
}

std::string StatementPrinter::type(ShaderType type) const {
  switch (type) {
    case ShaderType::boolean: return "bool";
    case ShaderType::scalar: return "float";
    case ShaderType::vector: return std::string(language_.vector);
  }
  return "";
}

std::string StatementPrinter::text(const ShaderNode& node, Precedence outer) const {
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
    case Operation::entry: return table_array(node.name) + "[int(" + text(*node.operands[0], ternary) + ")]";
    case Operation::intrinsic:
      if (node.name == "saturate" && !language_.has_saturate) return "clamp(" + list(node) + ", 0.0, 1.0)";
      return (node.name == "lerp" ? std::string(language_.lerp) : node.name) + "(" + list(node) + ")";
  }
  return "";
}

std::string StatementPrinter::list(const ShaderNode& node) const {
  std::string joined;
  for (const ShaderNode* operand : node.operands) joined += (joined.empty() ? "" : ", ") + text(*operand, ternary);
  return joined;
}

}  // namespace lobefit
