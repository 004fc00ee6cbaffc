#include "fit/diffuse_errors.h"

#include <tbb/parallel_for.h>

#include "reference/quiet_monitor.h"
#include "reference/render.h"

namespace lobefit {

namespace {

/// A form and its two rivals: for one bounce, and for all.
struct Form {
  std::string note;
  std::array<Rival, 2> rivals;
};

/// The same against both references.
Form same(const Rival& rival, const std::string& note = "") { return {note, {rival, rival}}; }

/// Without its own term for further bounces against one bounce.
Form with_term(const Rival& rival, const std::string& note = "") {
  Form form = same(rival, note);
  form.rivals[0].set.emplace_back("multiple_scattering", std::vector{0.0});
  return form;
}

std::vector<Form> forms() {
  const auto mapped = [](const char* text) { return std::vector{AxisMapping::parse(text)}; };
  return {
      same({.label = "Lambert", .model = "lambert"}),
      same({.label = "Burley", .model = "burley"}),
      with_term({.label = "Hammon", .model = "hammon"}),
      same({.label = "Chan 2018", .model = "chan_2018"}),
      with_term({.label = "Chan 2024", .model = "chan_2024"}),
      with_term({.label = "Oren-Nayar", .model = "oren_nayar", .free_per_row = {"sigma"}}, "sigma fitted per alpha"),
      with_term({.label = "EON, r = .4√α", .model = "eon", .mappings = mapped("roughness=0.4*alpha^0.5")}),
      with_term({.label = "EON, r = .536α^.67", .model = "eon", .mappings = mapped("roughness=0.536*alpha^0.67")}),
      same({.label = "Proxima, published", .model = "proxima"}),
      same({.label = "Proxima, refit", .model = "proxima", .free = {"a", "b"}}, "a and b refitted to each reference"),
      same({.label = "Callisto Full",
            .model = "callisto_lambert",
            .set = {{"f0", {0.0}}, {"specular_fresnel_falloff", {0.0}}, {"terminator", {0.0}}},
            .free_per_row = {"albedo", "diffuse_fresnel", "diffuse_fresnel_falloff", "diffuse_fresnel_tangent_falloff",
                             "retroreflection", "retroreflection_falloff", "retroreflection_tangent_falloff"},
            .starts = {{{"diffuse_fresnel", 0.5}, {"retroreflection", 2.5}, {"retroreflection_falloff", 0.6}}},
            .tolerance = 1e-9},
           "c1 on Lambert; albedo and six numbers fitted per alpha"),
  };
}

}  // namespace

std::vector<DiffuseError> diffuse_errors(const DiffuseErrorOptions& options, Monitor& monitor) {
  const Reference& reference = find_reference("microfacet_diffuse");
  std::array<Table, 2> tables;
  for (const std::size_t which : {std::size_t{0}, std::size_t{1}}) {
    ParameterValues values = reference.defaults();
    if (which == 1) values.set_text("bounces", "all");
    tables[which] =
        render(reference, values, {{"alpha", "", options.alphas, false}}, Grid::named_or_file("default"),
               {.sampling = {.samples = options.samples, .seed = options.seed}, .exact = which == 0}, monitor);
  }
  const std::vector<Form> all = forms();
  std::vector<DiffuseError> errors(all.size());
  monitor.begin("forms", 2 * all.size());
  // The longest fits come last in forms(), and begin first.
  tbb::parallel_for(
      std::size_t{0}, 2 * all.size(),
      [&](std::size_t job) {
        const std::size_t k = all.size() - 1 - job / 2, which = job % 2;
        const Rival& rival = all[k].rivals[which];
        QuietMonitor quiet(monitor);
        errors[k].rms[which] = score(rival, tables[which], Quantity::cosine, {}, quiet).rms;
        monitor.advance(1);
      },
      tbb::simple_partitioner());
  monitor.end();
  for (std::size_t k = 0; k < all.size(); ++k) {
    errors[k].label = all[k].rivals[0].label;
    errors[k].model = all[k].rivals[0].model;
    errors[k].note = all[k].note;
  }
  return errors;
}

}  // namespace lobefit
