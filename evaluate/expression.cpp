#include "evaluate/expression.h"

#include <algorithm>
#include <map>
#include <set>
#include <stdexcept>

namespace lobefit {

namespace {

thread_local Trace* current_trace = nullptr;

Expression binary(Operation operation, Expression a, Expression b) {
  return Expression(Trace::current().node(operation, ShaderType::scalar, {a.node, b.node}));
}

Expression compare(Operation operation, Expression a, Expression b) {
  return Expression(Trace::current().node(operation, ShaderType::boolean, {a.node, b.node}));
}

Expression function(const char* name, std::initializer_list<traced::Operand> operands) {
  return Expression(traced::intrinsic(name, ShaderType::scalar, operands));
}

bool is_literal(Expression e) { return e.node->operation == Operation::literal; }

/// True where the graph itself shows a value ≥ 0, such as a sum of squares: a guard would be noise in the shader.
bool is_non_negative(const ShaderNode* node) {
  switch (node->operation) {
    case Operation::literal: return node->literal >= 0.0;
    case Operation::let: return is_non_negative(node->operands[0]);
    case Operation::add: return is_non_negative(node->operands[0]) && is_non_negative(node->operands[1]);
    case Operation::multiply:
      return node->operands[0] == node->operands[1] ||
             (is_non_negative(node->operands[0]) && is_non_negative(node->operands[1]));
    case Operation::intrinsic: return node->name == "saturate" || node->name == "abs" || node->name == "sqrt";
    default: return false;
  }
}

}  // namespace

Trace::Trace(std::string_view inlined) : inlined_(inlined) {
  if (current_trace) throw std::logic_error("a Trace is active in this thread already");
  current_trace = this;
}

Trace::~Trace() { current_trace = nullptr; }

Trace& Trace::current() {
  if (!current_trace) throw std::logic_error("an Expression needs an active Trace");
  return *current_trace;
}

const ShaderNode* Trace::node(Operation operation, ShaderType type, std::vector<const ShaderNode*> operands,
                              std::string name, double literal) {
  for (const auto& known : shader_.nodes) {
    if (known->operation == operation && known->type == type && known->literal == literal && known->name == name &&
        known->operands == operands) {
      return known.get();
    }
  }
  const int order = static_cast<int>(shader_.nodes.size());
  shader_.nodes.push_back(std::make_unique<const ShaderNode>(
      ShaderNode{operation, type, literal, std::move(name), std::move(operands), order}));
  return shader_.nodes.back().get();
}

bool Trace::has_function(std::string_view name, const std::vector<ShaderType>& types) const {
  const auto known = std::ranges::find(shader_.functions, name, &ShaderFunction::name);
  if (known == shader_.functions.end()) return false;
  if (!std::ranges::equal(known->arguments, types, {}, &ShaderArgument::type)) {
    throw std::logic_error("function '" + std::string(name) + "' is called with scalars and with vectors");
  }
  return true;
}

void Trace::add_table(std::string_view name, std::span<const float> entries) {
  if (std::ranges::find(shader_.tables, name, &ShaderTable::name) == shader_.tables.end()) {
    shader_.tables.push_back({std::string(name), entries});
  }
}

Shader Trace::finish(ShaderFunction brdf) {
  shader_.brdf = std::move(brdf);
  return std::move(shader_);
}

Expression::Expression(double literal)
    : node(Trace::current().node(Operation::literal, ShaderType::scalar, {}, "", literal)) {}

Expression operator+(Expression a, Expression b) {
  if (is_literal(a) && is_literal(b)) return a.node->literal + b.node->literal;
  return binary(Operation::add, a, b);
}
Expression operator-(Expression a, Expression b) {
  if (is_literal(a) && is_literal(b)) return a.node->literal - b.node->literal;
  return binary(Operation::subtract, a, b);
}
Expression operator*(Expression a, Expression b) {
  if (is_literal(a) && is_literal(b)) return a.node->literal * b.node->literal;
  return binary(Operation::multiply, a, b);
}
Expression operator/(Expression a, Expression b) {
  if (is_literal(a) && is_literal(b)) return a.node->literal / b.node->literal;
  return binary(Operation::divide, a, b);
}
Expression operator-(Expression a) {
  if (is_literal(a)) return -a.node->literal;
  return Expression(Trace::current().node(Operation::negate, ShaderType::scalar, {a.node}));
}
Expression operator<(Expression a, Expression b) { return compare(Operation::less, a, b); }
Expression operator>(Expression a, Expression b) { return compare(Operation::greater, a, b); }
Expression operator<=(Expression a, Expression b) { return compare(Operation::less_equal, a, b); }
Expression operator>=(Expression a, Expression b) { return compare(Operation::greater_equal, a, b); }

Expression min(Expression a, Expression b) { return function("min", {a, b}); }
Expression max(Expression a, Expression b) { return function("max", {a, b}); }
Expression abs(Expression x) { return function("abs", {x}); }
Expression floor(Expression x) { return function("floor", {x}); }
Expression saturate(Expression x) { return function("saturate", {x}); }
Expression select(Expression condition, Expression a, Expression b) {
  return Expression(Trace::current().node(Operation::select, ShaderType::scalar, {condition.node, a.node, b.node}));
}
// The guards are those of scalar.h, spelled out: a shader's own pow(0, y) and sqrt(-0) are undefined.
Expression sqrt(Expression x) { return function("sqrt", {is_non_negative(x.node) ? x : max(x, 0.0)}); }
Expression exp(Expression x) { return function("exp", {x}); }
Expression exp2(Expression x) { return function("exp2", {x}); }
Expression log(Expression x) { return function("log", {max(x, smallest_base)}); }
Expression log2(Expression x) { return function("log2", {max(x, smallest_base)}); }
Expression pow(Expression x, Expression y) { return function("pow", {max(x, smallest_base), y}); }

Vec3<Expression>::Vec3(Expression first, Expression second, Expression third)
    : node(Trace::current().node(Operation::construct, ShaderType::vector, {first.node, second.node, third.node})),
      x(first),
      y(second),
      z(third) {}

Vec3<Expression>::Vec3(const ShaderNode* shared)
    : node(shared),
      x(Trace::current().node(Operation::component, ShaderType::scalar, {node}, "x")),
      y(Trace::current().node(Operation::component, ShaderType::scalar, {node}, "y")),
      z(Trace::current().node(Operation::component, ShaderType::scalar, {node}, "z")) {}

namespace traced {

Vec3<Expression> vector_operation(Operation operation, Operand a, Operand b) {
  return Vec3<Expression>(Trace::current().node(operation, ShaderType::vector, {a.node, b.node}));
}

const ShaderNode* intrinsic(const char* name, ShaderType type, std::initializer_list<Operand> operands) {
  std::vector<const ShaderNode*> nodes;
  for (const Operand& operand : operands) nodes.push_back(operand.node);
  return Trace::current().node(Operation::intrinsic, type, std::move(nodes), name);
}

}  // namespace traced

Expression dot(const Vec3<Expression>& a, const Vec3<Expression>& b) { return function("dot", {a, b}); }
Vec3<Expression> normalize(const Vec3<Expression>& v) {
  return Vec3<Expression>(traced::intrinsic("normalize", ShaderType::vector, {v}));
}
Vec3<Expression> max(const Vec3<Expression>& a, double b) {
  return Vec3<Expression>(traced::intrinsic("max", ShaderType::vector, {a, b}));
}
Vec3<Expression> select(Expression condition, const Vec3<Expression>& a, const Vec3<Expression>& b) {
  return Vec3<Expression>(
      Trace::current().node(Operation::select, ShaderType::vector, {condition.node, a.node, b.node}));
}
Expression let(const char* name, Expression value) {
  return Expression(Trace::current().node(Operation::let, value.node->type, {value.node}, name));
}
Vec3<Expression> let(const char* name, const Vec3<Expression>& value) {
  return Vec3<Expression>(Trace::current().node(Operation::let, ShaderType::vector, {value.node}, name));
}

OperationCount count_operations(const Shader& shader) {
  std::map<std::string, OperationCount> counts;
  const auto add = [](OperationCount& total, const OperationCount& part) {
    total.add_multiply += part.add_multiply;
    total.divide += part.divide;
    total.square_root += part.square_root;
    total.transcendental += part.transcendental;
    total.compare_select += part.compare_select;
    total.table_read += part.table_read;
  };
  const auto count = [&](const ShaderFunction& function) {
    OperationCount total;
    std::set<const ShaderNode*> seen;
    const auto visit = [&](const auto& self, const ShaderNode* node) -> void {
      if (!seen.insert(node).second) return;
      for (const ShaderNode* operand : node->operands) self(self, operand);
      const int width = node->type == ShaderType::vector ? 3 : 1;
      switch (node->operation) {
        case Operation::literal:
        case Operation::input:
        case Operation::component:
        case Operation::let:
        case Operation::construct: break;
        case Operation::add:
        case Operation::subtract:
        case Operation::multiply:
        case Operation::negate: total.add_multiply += width; break;
        case Operation::divide: total.divide += width; break;
        case Operation::less:
        case Operation::greater:
        case Operation::less_equal:
        case Operation::greater_equal:
        case Operation::select: total.compare_select += width; break;
        case Operation::entry: total.table_read += 1; break;
        case Operation::call: add(total, counts.at(node->name)); break;
        case Operation::intrinsic:
          if (node->name == "dot")
            total.add_multiply += 5;
          else if (node->name == "lerp")
            total.add_multiply += 3 * width;
          else if (node->name == "normalize") {
            total.add_multiply += 8;
            total.square_root += 1;
            total.divide += 1;
          } else if (node->name == "sqrt")
            total.square_root += width;
          else if (node->name == "pow") {
            total.transcendental += 2;
            total.add_multiply += 1;
          } else if (node->name == "exp" || node->name == "exp2" || node->name == "log" || node->name == "log2")
            total.transcendental += width;
          else
            total.compare_select += width;  // min max abs floor saturate
          break;
      }
    };
    visit(visit, function.result);
    return total;
  };
  for (const ShaderFunction& function : shader.functions) counts[function.name] = count(function);
  return count(shader.brdf);
}

}  // namespace lobefit
