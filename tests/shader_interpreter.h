// Two ways to run a shader on the CPU in double: from its graph, and from its printed text.
//
// They share nothing but the meaning of the intrinsics, so text that reads differently than its graph shows up.
#pragma once

#include <algorithm>
#include <cctype>
#include <cmath>
#include <map>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "evaluate/expression.h"

namespace lobefit {

/// One or three components; a boolean is 0 or 1.
using ShaderValue = std::vector<double>;

/// Applies f to each component; a scalar goes with every component of a vector.
template <class F>
ShaderValue by_component(const ShaderValue& a, const ShaderValue& b, F&& f) {
  ShaderValue result(std::max(a.size(), b.size()));
  for (std::size_t k = 0; k < result.size(); ++k) result[k] = f(a[a.size() == 1 ? 0 : k], b[b.size() == 1 ? 0 : k]);
  return result;
}

inline ShaderValue run_intrinsic(std::string_view name, const std::vector<ShaderValue>& x) {
  const auto one = [&](double (*f)(double)) {
    return by_component(x.at(0), {0.0}, [&](double a, double) { return f(a); });
  };
  const auto two = [&](double (*f)(double, double)) { return by_component(x.at(0), x.at(1), f); };
  const auto dot = [](const ShaderValue& a, const ShaderValue& b) {
    return a.at(0) * b.at(0) + a.at(1) * b.at(1) + a.at(2) * b.at(2);
  };
  if (name == "min") return two([](double a, double b) { return a < b ? a : b; });
  if (name == "max") return two([](double a, double b) { return a > b ? a : b; });
  if (name == "floor") return one([](double a) { return std::floor(a); });
  if (name == "abs") return one([](double a) { return std::fabs(a); });
  if (name == "sqrt") return one([](double a) { return std::sqrt(a); });
  if (name == "exp") return one([](double a) { return std::exp(a); });
  if (name == "exp2") return one([](double a) { return std::exp2(a); });
  if (name == "log") return one([](double a) { return std::log(a); });
  if (name == "log2") return one([](double a) { return std::log2(a); });
  if (name == "pow") return two([](double a, double b) { return std::pow(a, b); });
  if (name == "saturate") return one([](double a) { return std::min(std::max(a, 0.0), 1.0); });
  if (name == "clamp") {
    const ShaderValue raised = by_component(x.at(0), x.at(1), [](double a, double b) { return std::max(a, b); });
    return by_component(raised, x.at(2), [](double a, double b) { return std::min(a, b); });
  }
  if (name == "lerp" || name == "mix") {
    const ShaderValue span = by_component(x.at(1), x.at(0), [](double b, double a) { return b - a; });
    const ShaderValue part = by_component(span, x.at(2), [](double a, double b) { return a * b; });
    return by_component(x.at(0), part, [](double a, double b) { return a + b; });
  }
  if (name == "dot") return {dot(x.at(0), x.at(1))};
  if (name == "normalize")
    return by_component(x.at(0), {std::sqrt(dot(x.at(0), x.at(0)))}, [](double a, double b) { return a / b; });
  throw std::runtime_error("no intrinsic " + std::string(name));
}

/// What C texts call the intrinsics and the operations on vectors; none for another name.
inline std::optional<ShaderValue> run_c_function(std::string_view name, const std::vector<ShaderValue>& x) {
  if (name.starts_with("Lobefit_") && (name.ends_with("3") || name == "Lobefit_lerp")) {
    name.remove_prefix(8);
    if (name.ends_with("3")) name.remove_suffix(1);
    if (name == "make") return ShaderValue{x.at(0).at(0), x.at(1).at(0), x.at(2).at(0)};
    if (name == "splat") return ShaderValue{x.at(0).at(0), x.at(0).at(0), x.at(0).at(0)};
    if (name == "add") return by_component(x.at(0), x.at(1), [](double a, double b) { return a + b; });
    if (name == "subtract") return by_component(x.at(0), x.at(1), [](double a, double b) { return a - b; });
    if (name == "multiply" || name == "scale")
      return by_component(x.at(0), x.at(1), [](double a, double b) { return a * b; });
    if (name == "divide") return by_component(x.at(0), x.at(1), [](double a, double b) { return a / b; });
    for (const char* same : {"max", "dot", "normalize", "lerp"}) {
      if (name == same) return run_intrinsic(name, x);
    }
    return {};
  }
  static const std::map<std::string_view, std::string_view> floats{
      {"fminf", "min"}, {"fmaxf", "max"},  {"fabsf", "abs"}, {"floorf", "floor"}, {"sqrtf", "sqrt"},
      {"expf", "exp"},  {"exp2f", "exp2"}, {"logf", "log"},  {"log2f", "log2"},   {"powf", "pow"}};
  const auto found = floats.find(name);
  if (found == floats.end()) return {};
  return run_intrinsic(found->second, x);
}

/// Walks a shader's nodes.
class GraphInterpreter {
 public:
  explicit GraphInterpreter(const Shader& shader) : shader_(shader) {}

  /// `inputs` by name: wi, wo, p.alpha, …
  ShaderValue run(const std::map<std::string, ShaderValue>& inputs) const { return run(shader_.brdf, inputs); }

 private:
  ShaderValue run(const ShaderFunction& function, const std::map<std::string, ShaderValue>& inputs) const {
    std::map<const ShaderNode*, ShaderValue> known;
    return value(*function.result, inputs, known);
  }

  ShaderValue value(const ShaderNode& node, const std::map<std::string, ShaderValue>& inputs,
                    std::map<const ShaderNode*, ShaderValue>& known) const {
    const auto found = known.find(&node);
    if (found != known.end()) return found->second;
    std::vector<ShaderValue> x;
    for (const ShaderNode* operand : node.operands) x.push_back(value(*operand, inputs, known));
    const ShaderValue result = apply(node, x, inputs);
    if (result.size() != (node.type == ShaderType::vector ? 3u : 1u)) throw std::runtime_error("type of a node");
    return known[&node] = result;
  }

  ShaderValue apply(const ShaderNode& node, const std::vector<ShaderValue>& x,
                    const std::map<std::string, ShaderValue>& inputs) const {
    switch (node.operation) {
      case Operation::literal: return {node.literal};
      case Operation::input: return inputs.at(node.name);
      case Operation::component: return {x[0].at(static_cast<std::size_t>(node.name[0] - 'x'))};
      case Operation::let: return x[0];
      case Operation::construct: return {x[0].at(0), x[1].at(0), x[2].at(0)};
      case Operation::add: return by_component(x[0], x[1], [](double a, double b) { return a + b; });
      case Operation::subtract: return by_component(x[0], x[1], [](double a, double b) { return a - b; });
      case Operation::multiply: return by_component(x[0], x[1], [](double a, double b) { return a * b; });
      case Operation::divide: return by_component(x[0], x[1], [](double a, double b) { return a / b; });
      case Operation::negate: return by_component(x[0], {0.0}, [](double a, double) { return -a; });
      case Operation::less: return {x[0][0] < x[1][0] ? 1.0 : 0.0};
      case Operation::greater: return {x[0][0] > x[1][0] ? 1.0 : 0.0};
      case Operation::less_equal: return {x[0][0] <= x[1][0] ? 1.0 : 0.0};
      case Operation::greater_equal: return {x[0][0] >= x[1][0] ? 1.0 : 0.0};
      case Operation::select: return x[0][0] != 0.0 ? x[1] : x[2];
      case Operation::intrinsic: return run_intrinsic(node.name, x);
      case Operation::entry: {
        const auto table = std::find_if(shader_.tables.begin(), shader_.tables.end(),
                                        [&](const ShaderTable& t) { return t.name == node.name; });
        if (table == shader_.tables.end()) throw std::runtime_error("no table " + node.name);
        const auto index = static_cast<std::size_t>(x[0].at(0));
        if (index >= table->entries.size()) throw std::runtime_error("read beyond " + node.name);
        return {table->entries[index]};
      }
      case Operation::call: {
        const auto function = std::find_if(shader_.functions.begin(), shader_.functions.end(),
                                           [&](const ShaderFunction& f) { return f.name == node.name; });
        if (function == shader_.functions.end()) throw std::runtime_error("no function " + node.name);
        std::map<std::string, ShaderValue> arguments;
        for (std::size_t k = 0; k < x.size(); ++k) arguments[function->arguments.at(k).name] = x[k];
        return run(*function, arguments);
      }
    }
    throw std::runtime_error("unknown operation");
  }

  const Shader& shader_;
};

/// Reads the subset of HLSL, GLSL, C and WGSL that lobefit prints, by the grammar of C: ?: comparison sum product unary
/// postfix.
class TextInterpreter {
 public:
  using Variables = std::map<std::string, ShaderValue>;

  explicit TextInterpreter(std::string_view text) {
    split(text);
    while (at_ < tokens_.size()) {
      const bool named_after = accept("typedef");
      if (accept("struct")) {
        while (!accept("}")) ++at_;
        if (named_after) ++at_;
        if (at_ < tokens_.size()) accept(";");
        continue;
      }
      accept("static");
      accept("inline");
      if (accept("const")) {
        read_table();
        continue;
      }
      ++at_;  // the result's type, or fn
      Function& function = functions_[next()];
      expect("(");
      while (!accept(")")) {
        accept(",");
        if (accept("void")) continue;
        const std::string first = next();  // the argument's type, or its name
        function.arguments.push_back(accept(":") ? first : tokens_.at(at_));
        ++at_;
      }
      while (!accept("{")) ++at_;
      function.begin = at_;
      while (!accept("}")) ++at_;
    }
  }

  /// Calls a function; a struct p is passed as its members `p.alpha`, … in `more`.
  ShaderValue call(const std::string& name, const std::vector<ShaderValue>& arguments, const Variables& more = {}) {
    Variables variables = more;
    const Function& function = functions_.at(name);
    for (std::size_t k = 0; k < arguments.size(); ++k) variables[function.arguments.at(k)] = arguments[k];
    return run(function, variables);
  }

  /// The variables of a function that returns a struct p, its members `p.alpha`, … among them. `variables` are its
  /// arguments, those of structs as their members.
  Variables members(const std::string& name, Variables variables = {}) {
    run(functions_.at(name), variables);
    return variables;
  }

 private:
  struct Function {
    std::vector<std::string> arguments;
    std::size_t begin = 0;
  };

  /// float name[size] = {…}; or = float[size](…); or WGSL's name = array<f32, size>(…);
  void read_table() {
    if (!accept("float")) {
      const std::string name = next();
      expect("=");
      if (!accept("array")) {  // a number, which primary() knows
        while (!accept(";")) ++at_;
        return;
      }
      for (const char* part : {"<", "f32", ","}) expect(part);
      read_entries(tables_[name], std::stoul(next()), 2);
      return;
    }
    ShaderValue& entries = tables_[next()];
    expect("[");
    const std::size_t size = std::stoul(next());
    expect("]");
    expect("=");
    if (accept("float")) at_ += 3;
    read_entries(entries, size, 1);
  }

  void read_entries(ShaderValue& entries, std::size_t size, std::size_t before) {
    at_ += before;  // { or ( or >(
    do {
      const double sign = accept("-") ? -1.0 : 1.0;
      entries.push_back(sign * number(next()));
    } while (accept(","));
    ++at_;  // } or )
    expect(";");
    if (entries.size() != size) throw std::runtime_error("a table's size");
  }

  void split(std::string_view text) {
    for (std::size_t i = 0; i < text.size();) {
      const auto is_word = [&](char c) { return std::isalnum(static_cast<unsigned char>(c)) || c == '_'; };
      std::size_t end = i + 1;
      if (std::isspace(static_cast<unsigned char>(text[i]))) {
        i = end;
        continue;
      }
      if (text[i] == '#' || text.substr(i, 2) == "//") {
        i = text.find('\n', i);
        continue;
      }
      if (std::isdigit(static_cast<unsigned char>(text[i]))) {
        while (end < text.size() && (is_word(text[end]) || text[end] == '.' ||
                                     (text[end - 1] == 'e' && (text[end] == '-' || text[end] == '+')))) {
          ++end;
        }
      } else if (is_word(text[i])) {
        while (end < text.size() && is_word(text[end])) ++end;
      } else if (text.substr(i, 2) == "<=" || text.substr(i, 2) == ">=") {
        ++end;
      }
      tokens_.emplace_back(text.substr(i, end - i));
      i = end;
    }
  }

  static double number(const std::string& token) {
    std::size_t length = 0;
    const double value = std::stod(token, &length);
    if (token.substr(length) != "" && token.substr(length) != "f") throw std::runtime_error("not a number: " + token);
    return value;
  }

  std::string next() { return tokens_.at(at_++); }
  bool accept(std::string_view token) {
    if (tokens_.at(at_) != token) return false;
    ++at_;
    return true;
  }
  void expect(std::string_view token) {
    if (!accept(token)) throw std::runtime_error("expected " + std::string(token) + ", found " + tokens_.at(at_));
  }

  ShaderValue run(const Function& function, Variables& variables) {
    const std::size_t caller = at_;
    at_ = function.begin;
    while (!accept("return")) {
      if (accept("(")) {  // (void)name;
        for (const char* part : {"void", ")"}) expect(part);
        ++at_;
        expect(";");
        continue;
      }
      std::string name = next();
      if (accept(".")) {
        name += "." + next();  // p.alpha = …;
      } else {
        name = next();  // type name = …; or type name;
        if (variables.contains(name)) throw std::runtime_error(name + " is defined twice");
        if (accept(":")) ++at_;  // var name: type;
        if (accept(";")) continue;
      }
      expect("=");
      if (functions_.contains(tokens_.at(at_)) && tokens_.at(at_ + 1) == "(" && tokens_.at(at_ + 2) == ")") {
        // A struct, from a function without arguments.
        for (const auto& [member, value] : members(next())) variables[name + member.substr(1)] = value;
        at_ += 2;
      } else {
        variables[name] = ternary(variables);
      }
      expect(";");
    }
    ShaderValue result;
    if (tokens_.at(at_) == "p" && tokens_.at(at_ + 1) == ";") {
      at_ += 2;  // return p;
    } else {
      result = ternary(variables);
      expect(";");
    }
    at_ = caller;
    return result;
  }

  ShaderValue ternary(const Variables& variables) {
    const ShaderValue condition = comparison(variables);
    if (!accept("?")) return condition;
    const ShaderValue yes = ternary(variables);
    expect(":");
    const ShaderValue no = ternary(variables);
    return condition.at(0) != 0.0 ? yes : no;
  }

  ShaderValue comparison(const Variables& variables) {
    ShaderValue value = sum(variables);
    while (true) {
      const double a = value.at(0);
      if (accept("<"))
        value = {a < sum(variables).at(0) ? 1.0 : 0.0};
      else if (accept(">"))
        value = {a > sum(variables).at(0) ? 1.0 : 0.0};
      else if (accept("<="))
        value = {a <= sum(variables).at(0) ? 1.0 : 0.0};
      else if (accept(">="))
        value = {a >= sum(variables).at(0) ? 1.0 : 0.0};
      else
        return value;
    }
  }

  ShaderValue sum(const Variables& variables) {
    ShaderValue value = product(variables);
    while (true) {
      if (accept("+"))
        value = by_component(value, product(variables), [](double a, double b) { return a + b; });
      else if (accept("-"))
        value = by_component(value, product(variables), [](double a, double b) { return a - b; });
      else
        return value;
    }
  }

  ShaderValue product(const Variables& variables) {
    ShaderValue value = unary(variables);
    while (true) {
      if (accept("*"))
        value = by_component(value, unary(variables), [](double a, double b) { return a * b; });
      else if (accept("/"))
        value = by_component(value, unary(variables), [](double a, double b) { return a / b; });
      else
        return value;
    }
  }

  ShaderValue unary(const Variables& variables) {
    if (accept("-")) return by_component(unary(variables), {0.0}, [](double a, double) { return -a; });
    ShaderValue value = primary(variables);
    while (accept(".")) value = {value.at(static_cast<std::size_t>(next()[0] - 'x'))};
    return value;
  }

  ShaderValue primary(const Variables& variables) {
    if (accept("(")) {
      const ShaderValue value = ternary(variables);
      expect(")");
      return value;
    }
    const std::string token = next();
    if (std::isdigit(static_cast<unsigned char>(token[0]))) {
      return {number(token)};
    }
    if (token == "LOBEFIT_PI") return {pi};
    if (tables_.contains(token)) {
      expect("[");
      if (accept("(")) {  // (int)(…)
        for (const char* part : {"int", ")", "("}) expect(part);
      } else {
        if (!accept("i32")) expect("int");
        expect("(");
      }
      const auto index = static_cast<std::size_t>(ternary(variables).at(0));
      for (const char* part : {")", "]"}) expect(part);
      return {tables_.at(token).at(index)};
    }
    if (accept("(")) {
      std::vector<ShaderValue> arguments;
      while (!accept(")")) {
        accept(",");
        arguments.push_back(ternary(variables));
      }
      if (token == "select") return arguments.at(2).at(0) != 0.0 ? arguments[1] : arguments[0];
      if (token == "vec3f" && arguments.size() == 1) return ShaderValue(3, arguments[0].at(0));
      if (token == "float3" || token == "vec3" || token == "vec3f")
        return {arguments.at(0).at(0), arguments.at(1).at(0), arguments.at(2).at(0)};
      if (const auto value = run_c_function(token, arguments)) return *value;
      return functions_.contains(token) ? call(token, arguments) : run_intrinsic(token, arguments);
    }
    if (tokens_.at(at_) == "." && variables.contains(token + "." + tokens_.at(at_ + 1))) {
      ++at_;
      return variables.at(token + "." + next());
    }
    return variables.at(token);
  }

  std::vector<std::string> tokens_;
  std::size_t at_ = 0;
  std::map<std::string, Function> functions_;
  std::map<std::string, ShaderValue> tables_;
};

}  // namespace lobefit
