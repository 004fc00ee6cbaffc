#include "evaluate/gbuffer_material.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "evaluate/channels.h"

namespace lobefit {

namespace {

Channels product(const Channels& a, const Channels& b) { return {a[0] * b[0], a[1] * b[1], a[2] * b[2]}; }

double farthest(const Channels& a, const Channels& b) {
  return std::max({std::abs(a[0] - b[0]), std::abs(a[1] - b[1]), std::abs(a[2] - b[2])});
}

Channels grey(double x) { return {x, x, x}; }

std::vector<double> shortest(const Channels& c) {
  return is_grey(c) ? std::vector{c[0]} : std::vector<double>(c.begin(), c.end());
}

/// What the port has in the places of a material's parameters before they are stored.
class Port {
 public:
  explicit Port(const ParameterValues& values) : values_(values), port_(find_model(gbuffer_model).defaults()) {
    if (values.owner() != gbuffer_model && values.owner() != "callisto" && values.owner() != "callisto_lambert") {
      throw Error(ExitCode::usage, "'" + values.owner() + "' has no place in the port's GBuffer", "--gbuffer",
                  "choose callisto, callisto_lambert or callisto_ue427, or a fit of one of them");
    }
    for (const std::string_view name : {"albedo", "diffuse_fresnel_falloff", "retroreflection_falloff",
                                        "terminator_length", "f0", "specular_fresnel_falloff"}) {
      port_.set(name, values.components(values.info(name)));
    }
    port_.set("roughness", values.has("alpha") ? std::sqrt(values.get("alpha")) : values.get("roughness"));
    for (const std::string_view name : {"diffuse_fresnel", "retroreflection"}) port_.set(name, mean(tinted(name)));
    if (mean(terminator()) < 0.5 * terminator_weight()) port_.set("terminator_length", 0.0);
  }

  const ParameterValues& parameters() const { return port_; }
  /// The material's intensity times its tint.
  Channels tinted(std::string_view intensity) const {
    return product(channels_of(values_, intensity), channels_of(values_, std::string(intensity) + "_tint"));
  }
  /// Weight of the material's terminator.
  Channels terminator() const {
    const Channels tint = channels_of(values_, "terminator_tint");
    return values_.has("terminator") ? product(channels_of(values_, "terminator"), tint) : tint;
  }
  /// Weight of the port's.
  double terminator_weight() const { return port_.get("terminator_tint"); }

 private:
  const ParameterValues& values_;
  ParameterValues port_;
};

/// Losses of a parameter that lies in a field of its own; `own` turns what is stored into the parameter's terms.
template <class Own>
void add_losses(GBufferParameter& parameter, const Channels& value, const Own& own) {
  const GBufferField& field = *parameter.field;
  Channels whole = value;
  if (field.components == 1 && !is_grey(value)) {
    whole = grey(mean(value));
    const double off = farthest(value, whole);
    parameter.losses.push_back(
        {GBufferLossKind::grey, off,
         fmt::format("one channel for three: {:.4g} stands for numbers up to {:.2g} off", whole[0], off)});
  }
  double beyond = 0.0, rounded = 0.0, step = 0.0;
  for (std::size_t k = 0; k < field.components; ++k) {
    const std::uint8_t byte = parameter.bytes[k];
    const double inside = own(std::min(whole[k], field.full)), decoded = own(field.decode(byte));
    const double next = own(field.decode(static_cast<std::uint8_t>(byte < 255 ? byte + 1 : byte - 1)));
    beyond = std::max(beyond, own(whole[k]) - inside);
    rounded = std::max(rounded, std::abs(decoded - inside));
    step = std::max(step, std::abs(next - decoded));
  }
  if (beyond > 0.0) {
    parameter.losses.push_back({GBufferLossKind::clamped, beyond,
                                fmt::format("{:.4g} clamped to {:g}, the most that {} holds",
                                            *std::ranges::max_element(whole), field.full, field.engine_name)});
  }
  if (rounded > 0.0) {
    parameter.losses.push_back(
        {GBufferLossKind::quantised, rounded, fmt::format("rounded by {:.2g}, steps of {:.2g}", rounded, step)});
  }
}

void drop(GBufferParameter& parameter, const Channels& value, double port, const std::string& words) {
  parameter.decoded = {port};
  if (const double off = farthest(value, grey(port)); off > 0.0)
    parameter.losses.push_back({GBufferLossKind::dropped, off, "no field: " + words});
}

/// Tells what becomes of each parameter.
class Story {
 public:
  Story(const ParameterValues& values, const Port& port, const GBufferMaterial& material, const GBufferOptions& options)
      : values_(values), port_(port), material_(material), options_(options) {}

  GBufferParameter tell(const std::string& name) const {
    GBufferParameter parameter{.name = name, .value = shortest(channels_of(values_, name))};
    parameter.field = find_gbuffer_field(name == "alpha" ? "roughness" : name, options_);
    if (parameter.field) {
      tell_stored(parameter);
    } else {
      tell_absent(parameter);
    }
    return parameter;
  }

 private:
  void tell_stored(GBufferParameter& parameter) const {
    const GBufferField& field = *parameter.field;
    const std::span<const std::uint8_t> bytes = field.bytes(material_.pixel);
    parameter.bytes.assign(bytes.begin(), bytes.end());
    const Channels value = channels_of(material_.port, field.parameter),
                   decoded = channels_of(material_.decoded, field.parameter);
    parameter.decoded = shortest(decoded);
    const double own = values_.get(parameter.name);
    if (parameter.name == "alpha") {
      const auto squared = [](double root) { return root * root; };
      add_losses(parameter, value, squared);
      parameter.decoded = {squared(decoded[0])};
      parameter.remark = "as roughness, its root";
      return;
    }
    if (is_metallic() && (field.parameter == "albedo" || field.parameter == "f0")) {
      if (const double off = farthest(value, decoded); off > 0.0) {
        parameter.losses.push_back(
            {GBufferLossKind::shared, off,
             fmt::format("up to {:.2g} off: one base colour for albedo and f0, Metallic {}", off, metallic_byte())});
      }
      return;
    }
    add_losses(parameter, value, [](double x) { return x; });
    if (value[0] == own) return;
    if (parameter.name == "terminator_length") {
      parameter.remark = "0 keeps the terminator short that the port can't switch off";
    } else if (parameter.name == "diffuse_fresnel" || parameter.name == "retroreflection") {
      parameter.remark = fmt::format("{:.4g} with its tint, before it is stored", value[0]);
    }
  }

  void tell_absent(GBufferParameter& parameter) const {
    const std::string& name = parameter.name;
    const Channels value = channels_of(values_, name);
    if (name == "retroreflection_falloff") {
      drop(parameter, value, material_.decoded.get(name),
           "GBufferC.a holds baked irradiance, ambient occlusion reads as 1");
    } else if (name.ends_with("_tangent_falloff")) {
      const double constant = material_.decoded.get(name);
      drop(parameter, value, constant, fmt::format("the port's is always {:g}", constant));
    } else if (name == "terminator" || (name == "terminator_tint" && !values_.has("terminator"))) {
      const double weight = port_.terminator_weight();
      drop(parameter, port_.terminator(), weight, fmt::format("the port's terminator always has weight {:g}", weight));
    } else if (name == "terminator_tint") {
      if (value != grey(1.0)) parameter.remark = "part of the terminator's weight";
    } else if (name.ends_with("_tint")) {
      tell_tint(parameter);
    } else if (name == "dual_specular_opacity") {
      drop(parameter, value, 0.0, "the port has the first specular lobe alone");
    }
    // What is left shapes the second lobe, whose loss is its opacity's.
  }

  void tell_tint(GBufferParameter& parameter) const {
    const std::string intensity = parameter.name.substr(0, parameter.name.rfind('_'));
    const Channels tinted = port_.tinted(intensity);
    parameter.decoded = {1.0};
    if (!is_grey(tinted)) {
      const double off = farthest(tinted, grey(mean(tinted)));
      parameter.losses.push_back({GBufferLossKind::dropped, off,
                                  fmt::format("no field: {} is the mean of three up to {:.2g} off", intensity, off)});
    } else if (parameter.value != std::vector{1.0}) {
      parameter.remark = "goes into " + intensity;
    }
  }

  int metallic_byte() const { return find_gbuffer_field("metallic", options_)->bytes(material_.pixel)[0]; }
  bool is_metallic() const { return metallic_byte() > 0; }

  const ParameterValues& values_;
  const Port& port_;
  const GBufferMaterial& material_;
  const GBufferOptions& options_;
};

std::vector<std::string> formula_differences(const std::string& model, double terminator_weight) {
  if (model == gbuffer_model) return {};
  std::vector<std::string> list{
      "c1 takes N·L and N·V in the place of the cosines of theta_d and theta_h",
      fmt::format("c2's mask takes N·V in the place of the cosine of theta_h, and its terminator, of weight {:g}, is "
                  "always on",
                  terminator_weight)};
  if (model == "callisto_lambert") list.emplace_back("Proxima in the place of Lambert");
  return list;
}

}  // namespace

GBufferMaterial gbuffer_material(const ParameterValues& values, const GBufferOptions& options) {
  const Port port(values);
  GBufferMaterial material{.port = port.parameters(), .pixel = pack_gbuffer(port.parameters(), options)};
  material.decoded = unpack_gbuffer(material.pixel, options);
  const Story story(values, port, material, options);
  for (const ParameterInfo& info : values.list()) material.parameters.push_back(story.tell(std::string(info.name)));
  material.formula = formula_differences(values.owner(), port.terminator_weight());
  return material;
}

}  // namespace lobefit
