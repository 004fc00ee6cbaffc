// Expression: a tracing scalar. A model text run on it leaves a graph that prints as a shader.
//
//   const Shader shader = trace_shader<Proxima>();
//   std::cout << print_shader(shader, find_language("hlsl"), values);
//
// A Vec3<Expression> is one float3 node. Nodes are shared: two equal subexpressions are one node. let() gives a node
// the name that the shader's local will have; call<F>() becomes a function named after F.
#pragma once

#include <array>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "models/arc_cosine.h"
#include "models/lookup.h"
#include "models/scalar.h"

namespace lobefit {

enum class ShaderType { boolean, scalar, vector };

enum class Operation {
  literal,    // literal
  input,      // name: an argument of the function, or a member of its parameter struct
  component,  // name: x, y or z of operands[0]
  let,        // name: a local that holds operands[0]
  construct,  // a vector from three scalars
  add,
  subtract,
  multiply,
  divide,
  negate,
  less,
  greater,
  less_equal,
  greater_equal,
  select,     // operands[0] ? operands[1] : operands[2]
  intrinsic,  // name: min max abs floor saturate lerp sqrt exp exp2 log log2 pow dot normalize
  call,       // name: a traced function
  entry,      // name: a table; operands[0] is the entry's number
};

struct ShaderNode {
  Operation operation;
  ShaderType type;
  double literal = 0.0;
  std::string name;
  std::vector<const ShaderNode*> operands;
  int order = 0;  // of creation: operands come before their users
};

struct ShaderArgument {
  std::string name;
  ShaderType type;
};

/// A function of the printed shader.
struct ShaderFunction {
  std::string name;
  std::vector<ShaderArgument> arguments;
  const ShaderNode* result = nullptr;
};

/// A constant array of the printed shader.
struct ShaderTable {
  std::string name;
  std::span<const float> entries;
};

/// A traced model: its BRDF as a graph, the functions that it calls, callees first, and the tables that they read.
struct Shader {
  std::vector<std::unique_ptr<const ShaderNode>> nodes;
  std::vector<ShaderTable> tables;
  std::vector<ShaderFunction> functions;
  ShaderFunction brdf;
};

/// Collects what Expressions do while it lives; one at a time in a thread.
class Trace {
 public:
  /// A call of the function `inlined` is traced in place: a term is its own function.
  explicit Trace(std::string_view inlined = "");
  ~Trace();
  Trace(const Trace&) = delete;
  Trace& operator=(const Trace&) = delete;

  static Trace& current();

  /// The shared node of this content.
  const ShaderNode* node(Operation operation, ShaderType type, std::vector<const ShaderNode*> operands,
                         std::string name = "", double literal = 0.0);
  /// Throws std::logic_error if the function is known with other argument types: a shader has one text per function.
  bool has_function(std::string_view name, const std::vector<ShaderType>& types) const;
  void add_function(ShaderFunction function) { shader_.functions.push_back(std::move(function)); }
  /// Once for each table.
  void add_table(std::string_view name, std::span<const float> entries);
  Shader finish(ShaderFunction brdf);
  std::string_view inlined() const { return inlined_; }

 private:
  std::string_view inlined_;
  Shader shader_;
};

class Expression {
 public:
  const ShaderNode* node;

  Expression() : Expression(0.0) {}
  Expression(double literal);
  explicit Expression(const ShaderNode* shared) : node(shared) {}

  friend Expression operator+(Expression a, Expression b);
  friend Expression operator-(Expression a, Expression b);
  friend Expression operator*(Expression a, Expression b);
  friend Expression operator/(Expression a, Expression b);
  friend Expression operator-(Expression a);
  friend Expression operator<(Expression a, Expression b);
  friend Expression operator>(Expression a, Expression b);
  friend Expression operator<=(Expression a, Expression b);
  friend Expression operator>=(Expression a, Expression b);
  friend Expression min(Expression a, Expression b);
  friend Expression max(Expression a, Expression b);
  friend Expression abs(Expression x);
  friend Expression floor(Expression x);
  friend Expression select(Expression condition, Expression a, Expression b);
  friend Expression sqrt(Expression x);
  friend Expression exp(Expression x);
  friend Expression exp2(Expression x);
  friend Expression log(Expression x);
  friend Expression log2(Expression x);
  friend Expression pow(Expression x, Expression y);
  friend Expression saturate(Expression x);
  friend Expression square(Expression x) { return x * x; }
};

template <>
inline constexpr bool is_traced<Expression> = true;

template <>
struct Vec3<Expression> {
  const ShaderNode* node;
  Expression x, y, z;

  Vec3() : Vec3(Expression(), Expression(), Expression()) {}
  Vec3(Expression first, Expression second, Expression third);
  explicit Vec3(const ShaderNode* shared);
};

namespace traced {

/// An operand of any type that texts mix: scalar, vector or literal.
struct Operand {
  const ShaderNode* node;

  Operand(Expression e) : node(e.node) {}
  Operand(double literal) : node(Expression(literal).node) {}
  Operand(const Vec3<Expression>& v) : node(v.node) {}
};

Vec3<Expression> vector_operation(Operation operation, Operand a, Operand b);
const ShaderNode* intrinsic(const char* name, ShaderType type, std::initializer_list<Operand> operands);

template <class T>
T wrap(const ShaderNode* node) {
  return T(node);
}

template <class... T>
using Common = std::conditional_t<(is_vector<T> || ...), Vec3<Expression>, Expression>;

template <class T>
inline constexpr ShaderType type_of = is_vector<T> ? ShaderType::vector : ShaderType::scalar;

template <class A, class B>
concept VectorPair = (is_traced<A> || is_traced<B>)&&(is_vector<A> || is_vector<B>);

}  // namespace traced

#define LOBEFIT_TRACED_OPERATOR(op, operation)       \
  template <class A, class B>                        \
  requires traced::VectorPair<A, B> Vec3<Expression> \
  operator op(const A& a, const B& b) { return traced::vector_operation(Operation::operation, a, b); }
LOBEFIT_TRACED_OPERATOR(+, add)
LOBEFIT_TRACED_OPERATOR(-, subtract)
LOBEFIT_TRACED_OPERATOR(*, multiply)
LOBEFIT_TRACED_OPERATOR(/, divide)
#undef LOBEFIT_TRACED_OPERATOR

Expression dot(const Vec3<Expression>& a, const Vec3<Expression>& b);
Vec3<Expression> normalize(const Vec3<Expression>& v);
Vec3<Expression> max(const Vec3<Expression>& a, double b);
Vec3<Expression> select(Expression condition, const Vec3<Expression>& a, const Vec3<Expression>& b);
Expression let(const char* name, Expression value);
Vec3<Expression> let(const char* name, const Vec3<Expression>& value);

template <class A, class B, class T>
requires(!Numeric<A, B, T>) auto lerp(const A& a, const B& b, const T& t) {
  using R = traced::Common<A, B>;
  return R(traced::intrinsic("lerp", traced::type_of<R>, {a, b, t}));
}

template <class F>
struct TracedCall {
  template <class... A>
  static auto trace(const A&... arguments) {
    Trace& tracer = Trace::current();
    using R = decltype(F::evaluate(placeholder<A>("")...));
    if (tracer.inlined() == F::name) return R(F::evaluate(traced::Common<A>(traced::Operand(arguments).node)...));
    const std::vector<ShaderType> types{traced::type_of<A>...};
    if (!tracer.has_function(F::name, types)) {
      static_assert(sizeof...(A) == std::tuple_size_v<std::remove_cvref_t<decltype(F::arguments)>>);
      define(tracer, std::index_sequence_for<A...>{}, arguments...);
    }
    return R(tracer.node(Operation::call, traced::type_of<R>, {traced::Operand(arguments).node...}, F::name));
  }

 private:
  template <class T>
  static traced::Common<T> placeholder(const char* name) {
    return traced::Common<T>(Trace::current().node(Operation::input, traced::type_of<T>, {}, name));
  }
  template <std::size_t... I, class... A>
  static void define(Trace& tracer, std::index_sequence<I...>, const A&...) {
    const auto result = F::evaluate(placeholder<A>(F::arguments[I])...);
    tracer.add_function({F::name, {ShaderArgument{F::arguments[I], traced::type_of<A>}...}, result.node});
  }
};

template <class Table>
struct TracedEntry {
  static Expression trace(Expression index) {
    Trace& tracer = Trace::current();
    tracer.add_table(Table::name, Table::entries);
    return Expression(tracer.node(Operation::entry, ShaderType::scalar, {index.node}, Table::name));
  }
};

inline Expression pow5(Expression x) { return call<Pow5>(x); }
inline Expression acos(Expression x) { return call<ArcCosine>(x); }

/// Scalar operations of a shader, functions counted once per call; a float3 operation counts three.
struct OperationCount {
  int add_multiply = 0;
  int divide = 0;
  int square_root = 0;
  int transcendental = 0;
  int compare_select = 0;  // min, max, abs, floor, saturate, comparisons, select
  int table_read = 0;

  int total() const { return add_multiply + divide + square_root + transcendental + compare_select + table_read; }
};
OperationCount count_operations(const Shader& shader);

}  // namespace lobefit
