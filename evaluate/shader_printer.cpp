#include "evaluate/shader_printer.h"

#include <algorithm>
#include <cctype>
#include <charconv>

namespace lobefit {

namespace {

constexpr std::array languages{ShaderLanguage{"hlsl", "float3", "float3", "lerp", true, true},
                               ShaderLanguage{"glsl", "vec3", "vec3", "mix", false, false},
                               ShaderLanguage{.name = "c",
                                              .vector = "Lobefit_float3",
                                              .constructor = "Lobefit_make3",
                                              .lerp = "Lobefit_lerp",
                                              .has_saturate = false,
                                              .has_initializer_lists = true,
                                              .is_c = true},
                               ShaderLanguage{.name = "wgsl",
                                              .vector = "vec3f",
                                              .constructor = "vec3f",
                                              .lerp = "mix",
                                              .has_saturate = true,
                                              .has_initializer_lists = false,
                                              .scalar = "f32",
                                              .is_wgsl = true}};

/// What C lacks. Nothing warns where a text leaves one of them unused.
constexpr std::string_view c_vectors = R"(#include <math.h>
#include <stdbool.h>

#ifndef LOBEFIT_FLOAT3
#define LOBEFIT_FLOAT3
typedef struct Lobefit_float3 {
    float x, y, z;
} Lobefit_float3;

static inline Lobefit_float3 Lobefit_make3(float x, float y, float z) {
    Lobefit_float3 v;
    v.x = x;
    v.y = y;
    v.z = z;
    return v;
}
static inline Lobefit_float3 Lobefit_splat3(float s) {
    return Lobefit_make3(s, s, s);
}
static inline Lobefit_float3 Lobefit_add3(Lobefit_float3 a, Lobefit_float3 b) {
    return Lobefit_make3(a.x + b.x, a.y + b.y, a.z + b.z);
}
static inline Lobefit_float3 Lobefit_subtract3(Lobefit_float3 a, Lobefit_float3 b) {
    return Lobefit_make3(a.x - b.x, a.y - b.y, a.z - b.z);
}
static inline Lobefit_float3 Lobefit_multiply3(Lobefit_float3 a, Lobefit_float3 b) {
    return Lobefit_make3(a.x * b.x, a.y * b.y, a.z * b.z);
}
static inline Lobefit_float3 Lobefit_divide3(Lobefit_float3 a, Lobefit_float3 b) {
    return Lobefit_make3(a.x / b.x, a.y / b.y, a.z / b.z);
}
static inline Lobefit_float3 Lobefit_scale3(Lobefit_float3 a, float s) {
    return Lobefit_make3(a.x * s, a.y * s, a.z * s);
}
static inline Lobefit_float3 Lobefit_max3(Lobefit_float3 a, Lobefit_float3 b) {
    return Lobefit_make3(fmaxf(a.x, b.x), fmaxf(a.y, b.y), fmaxf(a.z, b.z));
}
static inline float Lobefit_dot3(Lobefit_float3 a, Lobefit_float3 b) {
    return a.x * b.x + a.y * b.y + a.z * b.z;
}
static inline Lobefit_float3 Lobefit_normalize3(Lobefit_float3 a) {
    return Lobefit_divide3(a, Lobefit_splat3(sqrtf(Lobefit_dot3(a, a))));
}
static inline float Lobefit_lerp(float a, float b, float t) {
    return a + (b - a) * t;
}
static inline Lobefit_float3 Lobefit_lerp3(Lobefit_float3 a, Lobefit_float3 b, Lobefit_float3 t) {
    return Lobefit_make3(Lobefit_lerp(a.x, b.x, t.x), Lobefit_lerp(a.y, b.y, t.y), Lobefit_lerp(a.z, b.z, t.z));
}
#endif

)";

std::string upper_case(std::string text) {
  for (char& c : text) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  return text;
}

/// Names that a local must not take: the parameter struct's, and words that some language reserves or defines; C is
/// also read as C++.
const std::set<std::string>& reserved_names() {
  static const std::set<std::string> names{
      "p",       "half",      "double",   "sample", "smooth",    "flat",     "shared",     "input",   "output",
      "common",  "partition", "active",   "filter", "texture",   "point",    "line",       "linear",  "matrix",
      "vector",  "min",       "max",      "abs",    "floor",     "clamp",    "lerp",       "mix",     "sqrt",
      "exp",     "exp2",      "log",      "log2",   "pow",       "dot",      "normalize",  "cross",   "length",
      "step",    "fract",     "sign",     "mod",    "out",       "in",       "inout",      "discard", "saturate",
      "auto",    "break",     "case",     "char",   "const",     "continue", "default",    "delete",  "do",
      "else",    "enum",      "extern",   "float",  "for",       "goto",     "if",         "inline",  "int",
      "long",    "new",       "register", "return", "short",     "signed",   "sizeof",     "static",  "struct",
      "switch",  "this",      "template", "class",  "typedef",   "union",    "unsigned",   "void",    "volatile",
      "while",   "and",       "or",       "not",    "xor",       "operator", "private",    "public",  "protected",
      "virtual", "friend",    "explicit", "using",  "namespace", "try",      "catch",      "throw",   "typename",
      "let",     "var",       "fn",       "loop",   "override",  "alias",    "diagnostic", "enable",  "requires",
      "target",  "final",     "from",     "get",    "set",       "self",     "ref",        "sampler", "type",
      "use",     "where",     "with",     "select", "array",     "vec3f",    "f32",        "i32",     "bool",
      "true",    "false",     "restrict"};
  return names;
}

/// A definition that may be there already: once where texts are joined.
std::string guarded(const ShaderLanguage& language, const std::string& guard, const std::string& definition) {
  if (language.is_wgsl) return definition + "\n";
  return "#ifndef " + guard + "\n#define " + guard + "\n" + definition + "#endif\n\n";
}

/// A constant array, eight entries a line.
std::string table_text(const ShaderLanguage& language, const ShaderTable& table) {
  const std::string name = table_array(table.name), size = std::to_string(table.entries.size());
  const std::string head = language.is_wgsl ? "const " + name + " = array<f32, " + size + ">("
                           : language.has_initializer_lists
                               ? "static const float " + name + "[" + size + "] = {"
                               : "const float " + name + "[" + size + "] = float[" + size + "](";
  std::string text = head;
  for (std::size_t i = 0; i < table.entries.size(); ++i) {
    text += (i == 0 ? "" : ",") + std::string(i % 8 == 0 ? "\n    " : " ") + literal_text(language, table.entries[i]);
  }
  return guarded(language, table_guard(table.name), text + (language.has_initializer_lists ? "\n};\n" : "\n);\n"));
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
  return std::string(type == ShaderType::vector ? language.vector : language.scalar);
}

/// A traced function's name behind its prefix. Texts that are joined may hold one function on scalars and on vectors:
/// these are told apart by their guards, and in languages that do not overload by their names.
std::string own_name(const std::string& name, ShaderType result) {
  return result == ShaderType::vector ? name + "3" : name;
}

bool overloads(const ShaderLanguage& language) { return !language.is_c && !language.is_wgsl; }

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

std::string literal_text(const ShaderLanguage& language, double value) {
  if (value == pi) return "LOBEFIT_PI";
  std::array<char, 32> buffer;
  const auto [end, code] = std::to_chars(buffer.data(), buffer.data() + buffer.size(), static_cast<float>(value));
  std::string text(buffer.data(), end);
  if (text.find_first_of(".e") == std::string::npos) text += ".0";
  return language.is_c ? text + "f" : text;
}

std::string shader_prologue(const ShaderLanguage& language) {
  if (language.is_wgsl) return "const LOBEFIT_PI = 3.14159265;\n\n";
  return (language.is_c ? std::string(c_vectors) : "") + "#ifndef LOBEFIT_PI\n#define LOBEFIT_PI 3.14159265" +
         (language.is_c ? "f" : "") + "\n#endif\n\n";
}

std::string argument_text(const ShaderLanguage& language, std::string_view type, std::string_view name) {
  return language.is_wgsl ? std::string(name) + ": " + std::string(type) : std::string(type) + " " + std::string(name);
}

std::string variable_text(const ShaderLanguage& language, std::string_view type, std::string_view name) {
  return "    " + std::string(language.is_wgsl ? "var " : "") + argument_text(language, type, name) + ";\n";
}

std::string local_text(const ShaderLanguage& language, std::string_view type, std::string_view name,
                       std::string_view value) {
  return "    " + std::string(language.is_wgsl ? "let" : type) + " " + std::string(name) + " = " + std::string(value) +
         ";\n";
}

std::string function_head(const ShaderLanguage& language, std::string_view result, const std::string& name,
                          const std::string& arguments) {
  if (language.is_wgsl) return "fn " + name + "(" + arguments + ") -> " + std::string(result) + " {\n";
  return (language.is_c ? "static inline " : "") + std::string(result) + " " + name + "(" +
         (language.is_c && arguments.empty() ? "void" : arguments) + ") {\n";
}

std::string table_array(std::string_view table) { return "Lobefit_" + std::string(table) + "_entries"; }
std::string table_guard(std::string_view table) { return "LOBEFIT_TABLE_" + upper_case(std::string(table)); }

std::string struct_text(const ShaderLanguage& language, const std::string& name,
                        std::span<const ShaderParameter> parameters) {
  const std::string_view end = language.is_wgsl ? "," : ";";
  std::string text = (language.is_c ? "typedef struct " : "struct ") + name + " {\n";
  for (const ShaderParameter& parameter : parameters) {
    const ParameterInfo& info = parameter.info;
    text += "    " + argument_text(language, info.components == 3 ? language.vector : language.scalar, info.name) +
            std::string(end) + "  // " + std::string(info.doc) + " Range " + number_text(info.lower) + " to " +
            number_text(info.upper) + (info.unit.empty() ? "" : " " + std::string(info.unit)) + ".\n";
  }
  // GLSL has no empty structs.
  if (parameters.empty()) text += "    " + argument_text(language, language.scalar, "unused") + std::string(end) + "\n";
  return guarded(language, "LOBEFIT_STRUCT_" + upper_case(name),
                 text + (language.is_c ? "} " + name : "}") + (language.is_wgsl ? "\n" : ";\n"));
}

std::string values_text(const ShaderLanguage& language, const std::string& type, const std::string& function,
                        std::span<const ShaderParameter> parameters) {
  std::string text = function_head(language, type, function, "") + variable_text(language, type, "p");
  for (const ShaderParameter& parameter : parameters) {
    std::string value;
    for (const double component : parameter.value)
      value += (value.empty() ? "" : ", ") + literal_text(language, component);
    if (parameter.value.size() == 3) value = std::string(language.constructor) + "(" + value + ")";
    text += "    p." + std::string(parameter.info.name) + " = " + value + ";" +
            (parameter.comment.empty() ? "" : "  // " + parameter.comment) + "\n";
  }
  if (parameters.empty()) text += "    p.unused = " + literal_text(language, 0.0) + ";\n";
  return text + "    return p;\n}\n";
}

std::string definitions_text(const ShaderLanguage& language, const Shader& shader) {
  std::string text;
  for (const ShaderTable& table : shader.tables) text += table_text(language, table);
  for (const ShaderFunction& function : shader.functions) {
    const std::string own = own_name(function.name, function.result->type);
    std::string arguments;
    for (const ShaderArgument& argument : function.arguments) {
      arguments +=
          (arguments.empty() ? "" : ", ") + argument_text(language, value_type(language, argument.type), argument.name);
    }
    text += guarded(language, "LOBEFIT_FUNCTION_" + upper_case(own),
                    function_head(language, value_type(language, function.result->type),
                                  "Lobefit_" + (overloads(language) ? function.name : own), arguments) +
                        body_text(language, function) + "}\n");
  }
  return text;
}

std::string body_text(const ShaderLanguage& language, const ShaderFunction& function, std::vector<std::string> taken) {
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
  if (language.is_c) {
    for (const std::string& name : taken) {
      const auto reads = [&](const ShaderNode* node) {
        return node->operation == Operation::input && (node->name == name || node->name.starts_with(name + "."));
      };
      if (std::none_of(reachable.begin(), reachable.end(), reads)) statements_ += "    (void)" + name + ";\n";
    }
  }
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
  statements_ += local_text(language_, type(node->type), name, text(*node, ternary));
  names_.emplace(node, name);
}

std::string StatementPrinter::type(ShaderType type) const {
  switch (type) {
    case ShaderType::boolean: return "bool";
    case ShaderType::scalar: return std::string(language_.scalar);
    case ShaderType::vector: return std::string(language_.vector);
  }
  return "";
}

std::string StatementPrinter::text(const ShaderNode& node, Precedence outer) const {
  const auto named = names_.find(&node);
  if (named != names_.end()) return named->second;
  const auto binary = [&](const char* symbol, Precedence own) {
    if (language_.is_c && node.type == ShaderType::vector) return vector_call(node);
    // The right operand binds one step tighter: the order of rounding in the graph is kept.
    const std::string inner = text(*node.operands[0], own) + symbol + text(*node.operands[1], Precedence(own + 1));
    return own < outer ? "(" + inner + ")" : inner;
  };
  switch (node.operation) {
    case Operation::literal: {
      const std::string digits = literal_text(language_, node.literal);
      return node.literal < 0.0 && outer > sum ? "(" + digits + ")" : digits;
    }
    case Operation::input: return node.name;
    case Operation::component: return text(*node.operands[0], primary) + "." + node.name;
    case Operation::let: return text(*node.operands[0], outer);
    case Operation::construct: return std::string(language_.constructor) + "(" + list(node) + ")";
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
      if (language_.is_wgsl) {
        return "select(" + text(*node.operands[2], ternary) + ", " + text(*node.operands[1], ternary) + ", " +
               text(*node.operands[0], ternary) + ")";
      }
      const std::string inner = text(*node.operands[0], comparison) + " ? " + text(*node.operands[1], comparison) +
                                " : " + text(*node.operands[2], comparison);
      return outer > ternary ? "(" + inner + ")" : inner;
    }
    case Operation::call:
      return "Lobefit_" + (overloads(language_) ? node.name : own_name(node.name, node.type)) + "(" + list(node) + ")";
    case Operation::entry:
      return table_array(node.name) + "[" +
             (language_.is_c      ? "(int)("
              : language_.is_wgsl ? "i32("
                                  : "int(") +
             text(*node.operands[0], ternary) + ")]";
    case Operation::intrinsic: return intrinsic(node);
  }
  return "";
}

std::string StatementPrinter::intrinsic(const ShaderNode& node) const {
  if (node.name == "lerp" && node.type == ShaderType::scalar)
    return std::string(language_.lerp) + "(" + list(node) + ")";
  if (!language_.is_c) {
    if (node.name == "saturate" && !language_.has_saturate) return "clamp(" + list(node) + ", 0.0, 1.0)";
    // WGSL's functions take operands of one type; mix() also a vector pair and a scalar.
    const bool splats = language_.is_wgsl && node.type == ShaderType::vector;
    return (node.name == "lerp" ? std::string(language_.lerp) : node.name) + "(" +
           (splats ? list(node, std::string(language_.vector)) : list(node)) + ")";
  }
  if (node.type == ShaderType::vector || node.name == "dot") return vector_call(node);
  if (node.name == "saturate") return "fminf(fmaxf(" + list(node) + ", 0.0f), 1.0f)";
  static const std::set<std::string_view> prefixed{"min", "max", "abs"};
  return (prefixed.contains(node.name) ? "f" : "") + node.name + "f(" + list(node) + ")";
}

std::string StatementPrinter::vector_call(const ShaderNode& node) const {
  static const std::map<Operation, std::string> names{{Operation::add, "add"},
                                                      {Operation::subtract, "subtract"},
                                                      {Operation::multiply, "multiply"},
                                                      {Operation::divide, "divide"}};
  const auto operation = names.find(node.operation);
  const std::string name = operation != names.end() ? operation->second : node.name;
  const auto is_vector = [](const ShaderNode* operand) { return operand->type == ShaderType::vector; };
  if (node.operation == Operation::multiply && !(is_vector(node.operands[0]) && is_vector(node.operands[1]))) {
    const std::size_t vector = is_vector(node.operands[0]) ? 0 : 1;
    return "Lobefit_scale3(" + text(*node.operands[vector], ternary) + ", " +
           text(*node.operands[1 - vector], ternary) + ")";
  }
  return "Lobefit_" + name + "3(" + list(node, "Lobefit_splat3") + ")";
}

std::string StatementPrinter::list(const ShaderNode& node, const std::string& splat) const {
  std::string joined;
  for (const ShaderNode* operand : node.operands) {
    const std::string own = text(*operand, ternary);
    const bool as_it_is = splat.empty() || operand->type == ShaderType::vector;
    joined += (joined.empty() ? "" : ", ") + (as_it_is ? own : splat + "(" + own + ")");
  }
  return joined;
}

}  // namespace lobefit
