#include "reference/targets.h"

#include <algorithm>
#include <cmath>

#include "models/error.h"
#include "models/microfacet/fresnel.h"
#include "models/sheen/charlie.h"
#include "reference/hair/scattering.h"
#include "reference/specular/albedo_table.h"

namespace lobefit {

namespace {

using Arguments = std::span<const double>;

ParameterInfo cosine(std::string_view name) { return {.name = name, .lower = 0.0, .initial = 1.0}; }
ParameterInfo signed_cosine(std::string_view name) { return {.name = name, .lower = -1.0, .initial = 1.0}; }
const ParameterInfo alpha{.name = "alpha", .lower = 1e-4, .initial = 0.5, .doc = "GGX or Beckmann alpha."};
const ParameterInfo ior{.name = "ior", .lower = 1.0, .upper = 10.0, .initial = 1.55, .doc = "Of the fibre."};
const ParameterInfo offset{.name = "h", .lower = 0.0, .initial = 0.0, .doc = "Over the fibre's radius."};

/// cosθ inside the fibre of a ray on the specular cone, whose θ is θ_d.
double cos_theta_t(double cos_theta_d, double index) {
  const double sine2 = (1.0 - cos_theta_d * cos_theta_d) / (index * index);
  return std::sqrt(1.0 - sine2);
}
/// cosγ_t
double cos_gamma_t(double cos_theta_d, double index, double h) {
  const double sine = h / bravais_index(index, cos_theta_d);
  return std::sqrt(1.0 - sine * sine);
}

double smith_beckmann_g1(double cotangent) {
  // 2/(1 + erf c + e^(-c²)/(c √π))
  if (cotangent <= 0.0) return 0.0;
  return 2.0 / (1.0 + std::erf(cotangent) + std::exp(-cotangent * cotangent) / (cotangent * std::sqrt(pi)));
}

double smith_ggx_length(double mu, double a) { return std::sqrt(mu * mu * (1.0 - a * a) + a * a); }

double ggx_albedo(double mu, double a, const std::function<double(double)>& reflectance) {
  return reflected_albedo({Distribution::ggx, a, a}, InterfaceMasking::correlated, mu, reflectance).value;
}
double schlick_power(double c) { return std::pow(1.0 - c, 5.0); }

/// ∫ f μ dω by midpoints in cosine squared and azimuth: D has no peak within the hemisphere.
double charlie_albedo(double mu, double roughness) {
  constexpr int rings = 128, sectors = 64;
  const Direction wo{std::sqrt(1.0 - mu * mu), 0.0, mu};
  const SheenCharlie::Parameters<double> p{{1.0, 1.0, 1.0}, roughness, 2.0};
  double sum = 0.0;
  for (int i = 0; i < rings; ++i) {
    const double mu_i = std::sqrt((i + 0.5) / rings), sine = std::sqrt(1.0 - mu_i * mu_i);
    for (int j = 0; j < sectors; ++j) {
      const double phi = pi * (j + 0.5) / sectors;
      sum +=
          evaluate_brdf<SheenCharlie::Variant<2>, double>(p, {sine * std::cos(phi), sine * std::sin(phi), mu_i}, wo).x;
    }
  }
  return sum * pi / (rings * sectors);
}

std::vector<Target> make_targets() {
  std::vector<Target> list;
  const auto add = [&](Target target) { list.push_back(std::move(target)); };

  // Hair.
  const std::string deon = "d'Eon et al. 2011; Marschner et al. 2003";
  add({"bravais_index",
       "Bravais index of a skew ray",
       deon,
       {cosine("cos_theta_d"), ior},
       [](Arguments x) { return bravais_index(x[1], x[0]); },
       {},
       {}});
  add({"hair_tt_offset",
       "Offset of the TT ray that leaves at an azimuth",
       "S3, exact form",
       {signed_cosine("cos_phi"),
        {.name = "inverse_index", .lower = 0.1, .upper = 1.0, .initial = 0.645, .doc = "1/η'."}},
       [](Arguments x) { return tt_offset(1.0 / x[1], std::acos(x[0])); },
       {},
       {}});
  const ParameterInfo scale{.name = "scale", .lower = 0.01, .upper = 2.0, .initial = 0.35, .doc = "s of the logistic."};
  const ParameterInfo weight{.name = "weight", .lower = 0.0, .upper = 2.0, .initial = 1.0};
  add({"hair_logistic_forward",
       "Logistic density around φ = π",
       "S3: s = .35 for TT",
       {signed_cosine("cos_phi"), scale, weight},
       [](Arguments x) { return x[2] * logistic_density(x[1], pi - std::acos(x[0])); },
       {},
       {}});
  add({"hair_logistic_backward",
       "Logistic density around φ = 0",
       "S3: s = .15, weight ¾ for TRT",
       {signed_cosine("cos_phi"), scale, weight},
       [](Arguments x) { return x[2] * logistic_density(x[1], std::acos(x[0])); },
       {},
       {}});
  add({"hair_tt_exponent",
       "Exponent of the colour on a TT path",
       "S3, reference code: ½ cosγ_t/cosθ_t",
       {cosine("cos_theta_d"), offset, ior},
       [](Arguments x) { return 0.5 * cos_gamma_t(x[0], x[2], x[1]) / cos_theta_t(x[0], x[2]); },
       {},
       {}});
  add({"hair_chord",
       "Length of a traversal over the diameter",
       "cosγ_t/cosθ_t: geometry",
       {cosine("cos_theta_d"), offset, ior},
       [](Arguments x) { return cos_gamma_t(x[0], x[2], x[1]) / cos_theta_t(x[0], x[2]); },
       {},
       {}});
  add({"hair_chord_printed",
       "What S3's text has for that length",
       "cos²γ_t/cosθ_t",
       {cosine("cos_theta_d"), offset, ior},
       [](Arguments x) {
         const double c = cos_gamma_t(x[0], x[2], x[1]);
         return c * c / cos_theta_t(x[0], x[2]);
       },
       {},
       {}});
  add({"hair_trt_exponent",
       "Exponent of the colour on a TRT path at one offset",
       "cosγ_t/cosθ_t, twice one traversal",
       {cosine("cos_theta_d"),
        {.name = "h", .lower = 0.0, .initial = std::sqrt(0.75), .doc = "S3's h_TRT is √3/2."},
        ior},
       [](Arguments x) { return cos_gamma_t(x[0], x[2], x[1]) / cos_theta_t(x[0], x[2]); },
       {},
       {}});
  add({"hair_trt_fresnel",
       "Mean of (1 - F)² F over the fibre's width",
       "S3: A(2, h) without absorption",
       {cosine("cos_theta_d"), ior},
       [](Arguments x) {
         // Over γ_i, in which the integrand is smooth.
         constexpr int steps = 400;
         double sum = 0.0;
         for (int i = 0; i < steps; ++i) {
           const double gamma = 0.5 * pi * (i + 0.5) / steps;
           const double f = hair_fresnel(HairFresnel::schlick, x[1], x[0] * std::cos(gamma));
           sum += (1.0 - f) * (1.0 - f) * f * std::cos(gamma);
         }
         return sum * 0.5 * pi / steps;
       },
       {"f0"},
       [](Arguments x) {
         const double root = (x[1] - 1.0) / (x[1] + 1.0);
         return std::vector{root * root};
       }});
  add({"hair_longitudinal",
       "d'Eon's M",
       "d'Eon et al. 2011",
       {{.name = "sin_theta_l", .lower = -1.0},
        {.name = "sin_theta_v", .lower = -1.0},
        {.name = "width", .lower = 0.01, .upper = 2.0, .initial = 0.1, .doc = "β."}},
       [](Arguments x) { return longitudinal_scattering(x[2] * x[2], x[0], x[1]); },
       {},
       {}});

  // Masking.
  const std::string smith = "Smith 1967; Heitz 2014";
  add({"smith_ggx_g1",
       "Smith's G1 of GGX",
       smith,
       {cosine("cos_theta"), alpha},
       [](Arguments x) { return 2.0 * x[0] / (x[0] + smith_ggx_length(x[0], x[1])); },
       {},
       {}});
  add({"smith_beckmann_g1",
       "Smith's G1 of Beckmann facets",
       smith,
       {cosine("cos_theta"), alpha},
       [](Arguments x) {
         const double sine = std::sqrt(1.0 - x[0] * x[0]);
         return sine > 0.0 ? smith_beckmann_g1(x[0] / (x[1] * sine)) : 1.0;
       },
       {},
       {}});
  add({"smith_beckmann_cotangent",
       "Smith's G1 of Beckmann facets over cotθ/α",
       smith,
       {{.name = "cotangent", .lower = 0.0, .upper = 10.0, .initial = 1.0}},
       [](Arguments x) { return smith_beckmann_g1(x[0]); },
       {},
       {}});
  add({"smith_ggx_visibility",
       "Height-correlated Smith visibility of GGX",
       smith,
       {cosine("cos_theta_i"), cosine("cos_theta_o"), alpha},
       [](Arguments x) { return 0.5 / (x[1] * smith_ggx_length(x[0], x[2]) + x[0] * smith_ggx_length(x[1], x[2])); },
       {},
       {}});

  // Fresnel.
  add({"fresnel_dielectric",
       "Fresnel's equations of a dielectric",
       "Born, Wolf, Principles of Optics",
       {cosine("cosine"), {.name = "ior", .lower = 1.0, .upper = 10.0, .initial = 1.5}},
       [](Arguments x) { return DielectricFresnel::evaluate(x[0], x[1]); },
       {"f0"},
       [](Arguments x) {
         const double root = (x[1] - 1.0) / (x[1] + 1.0);
         return std::vector{root * root};
       }});
  add({"fresnel_conductor",
       "Fresnel's equations of a conductor",
       "Born, Wolf, Principles of Optics",
       {cosine("cosine"),
        {.name = "eta", .lower = 0.01, .upper = 20.0, .initial = 1.0},
        {.name = "k", .lower = 0.0, .upper = 20.0, .initial = 3.0}},
       [](Arguments x) { return ConductorFresnel::evaluate(x[0], x[1], x[2]); },
       {"f0"},
       [](Arguments x) { return std::vector{ConductorFresnel::evaluate(1.0, x[1], x[2])}; }});

  add({"schlick_power",
       "Schlick's term itself",
       "Schlick 1994",
       {cosine("cosine"), {.name = "f0", .lower = 0.0, .initial = 0.0}},
       [](Arguments x) { return x[1] + (1.0 - x[1]) * schlick_power(x[0]); },
       {},
       {}});

  // Directional albedos.
  const std::string integral = "our integral over visible normals (reference/specular/albedo_table.h)";
  add({"ggx_albedo",
       "Directional albedo of GGX with F = 1",
       integral,
       {cosine("cos_theta"), alpha},
       [](Arguments x) { return ggx_albedo(x[0], x[1], [](double) { return 1.0; }); },
       {},
       {}});
  add({"ggx_albedo_uncorrelated",
       "The same, light and view masked independently",
       integral,
       {cosine("cos_theta"), alpha},
       [](Arguments x) {
         return reflected_albedo({Distribution::ggx, x[1], x[1]}, InterfaceMasking::separable, x[0],
                                 [](double) { return 1.0; })
             .value;
       },
       {},
       {}});
  add({"ggx_f0_weight",
       "Weight of f0 in the directional albedo of GGX with Schlick's term",
       integral,
       {cosine("cos_theta"), alpha},
       [](Arguments x) { return ggx_albedo(x[0], x[1], [](double c) { return 1.0 - schlick_power(c); }); },
       {},
       {}});
  add({"ggx_f90_weight",
       "Weight of f90 in the directional albedo of GGX with Schlick's term",
       integral,
       {cosine("cos_theta"), alpha},
       [](Arguments x) { return ggx_albedo(x[0], x[1], schlick_power); },
       {},
       {}});
  add({"ggx_schlick_mean",
       "Mean Schlick weight of the light of a GGX lobe",
       integral,
       {cosine("cos_theta"), alpha},
       [](Arguments x) {
         return ggx_albedo(x[0], x[1], schlick_power) / ggx_albedo(x[0], x[1], [](double) { return 1.0; });
       },
       {},
       {}});
  add({"ggx_average_loss",
       "1 - 2 ∫ E μ dμ of GGX with F = 1",
       integral,
       {alpha},
       [](Arguments x) {
         return 1.0 - average_albedo([&](double mu) {
                        return reflected_albedo({Distribution::ggx, x[0], x[0]}, InterfaceMasking::correlated, mu,
                                                [](double) { return 1.0; });
                      }).value;
       },
       {},
       {}});
  add({"charlie_albedo",
       "Directional albedo of Charlie sheen with cloth's visibility",
       "Estevez, Kulla 2017; our integral",
       {cosine("cos_theta"), {.name = "roughness", .lower = 0.05, .initial = 0.5, .doc = "The authors' r."}},
       [](Arguments x) { return charlie_albedo(x[0], x[1]); },
       {},
       {}});
  return list;
}

}  // namespace

int Target::find(std::string_view argument) const {
  for (std::size_t i = 0; i < arguments.size(); ++i) {
    if (arguments[i].name == argument) return static_cast<int>(i);
  }
  return -1;
}

const std::vector<Target>& targets() {
  static const std::vector<Target> list = make_targets();
  return list;
}

const Target& find_target(const std::string& name) {
  std::vector<std::string> names;
  for (const Target& target : targets()) {
    if (target.name == name) return target;
    names.push_back(target.name);
  }
  throw Error(ExitCode::usage, "no target is called '" + name + "'", "",
              "did you mean '" + nearest_name(name, names) + "'?");
}

}  // namespace lobefit
