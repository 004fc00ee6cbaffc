// The parts that shader texts are made of, in one language.
#pragma once

#include <map>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "evaluate/shader.h"

namespace lobefit {

struct ShaderLanguage {
  std::string_view name;
  std::string_view vector;       // type of three floats
  std::string_view constructor;  // makes one from three
  std::string_view lerp;
  bool has_saturate;
  bool has_initializer_lists;
  std::string_view scalar = "float";
  /// C99: no operators on vectors, functions of floats have names of their own, and headers define nothing twice.
  bool is_c = false;
  /// Types stand behind names, selections are functions, and there is no preprocessor to guard what is there already.
  bool is_wgsl = false;
};

/// Throws Error(usage) for an unknown name.
const ShaderLanguage& find_shader_language(std::string_view name);

/// Shortest decimal that reads back as the same float.
std::string literal_text(const ShaderLanguage& language, double value);

/// The constants and guards before everything else; in C also the vector and its operations.
std::string shader_prologue(const ShaderLanguage& language);

/// `type name`, as an argument stands in a text.
std::string argument_text(const ShaderLanguage& language, std::string_view type, std::string_view name);

/// A local that is assigned later.
std::string variable_text(const ShaderLanguage& language, std::string_view type, std::string_view name);

/// A local that keeps its value.
std::string local_text(const ShaderLanguage& language, std::string_view type, std::string_view name,
                       std::string_view value);

/// Head of a function's definition up to its opening brace.
std::string function_head(const ShaderLanguage& language, std::string_view result, const std::string& name,
                          const std::string& arguments);

/// The name of a table's array, and the macro that keeps its definition out of the text: a shader that has the array
/// from elsewhere, such as a buffer, defines it.
std::string table_array(std::string_view table);
std::string table_guard(std::string_view table);

/// A struct of the parameters; once where several texts are joined.
std::string struct_text(const ShaderLanguage& language, const std::string& name,
                        std::span<const ShaderParameter> parameters);

/// The function of no arguments that returns the struct `type` with these values.
std::string values_text(const ShaderLanguage& language, const std::string& type, const std::string& function,
                        std::span<const ShaderParameter> parameters);

/// The tables and the functions that the shader's results need, callees first.
std::string definitions_text(const ShaderLanguage& language, const Shader& shader);

/// Prints the statements that compute some nodes, each value once.
class StatementPrinter {
 public:
  /// `taken`: arguments and whatever else no local may be called. In C, compilers are told which of them nothing reads.
  StatementPrinter(const ShaderLanguage& language, std::span<const ShaderNode* const> results,
                   std::span<const std::string> taken);

  const std::string& statements() const { return statements_; }
  /// The expression of a result, after the statements.
  std::string text(const ShaderNode& node) const { return text(node, ternary); }

 private:
  /// Binding strength, so that parentheses stand just where the graph needs them.
  enum Precedence { ternary, comparison, sum, product, unary, primary };

  void collect(const ShaderNode* node, std::vector<const ShaderNode*>& reachable);
  void define(const ShaderNode* node, const std::string& wanted);
  std::string type(ShaderType type) const;
  std::string text(const ShaderNode& node, Precedence outer) const;
  std::string intrinsic(const ShaderNode& node) const;
  /// The operands; scalars as vectors by the function `splat`, if there is one.
  std::string list(const ShaderNode& node, const std::string& splat = "") const;
  /// An operation on vectors as a call, in C.
  std::string vector_call(const ShaderNode& node) const;

  const ShaderLanguage& language_;
  std::map<const ShaderNode*, int> uses_;
  std::map<const ShaderNode*, std::string> names_;
  std::set<std::string> taken_;
  std::string statements_;
  int temporaries_ = 0;
};

/// The statements of a function that returns one value. `taken` are further arguments.
std::string body_text(const ShaderLanguage& language, const ShaderFunction& function,
                      std::vector<std::string> taken = {});

}  // namespace lobefit
