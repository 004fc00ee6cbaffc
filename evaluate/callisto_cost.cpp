#include "evaluate/callisto_cost.h"

#include "evaluate/shader.h"
#include "models/callisto/modulation.h"

namespace lobefit {

namespace {

struct CallistoDiffuse {
  static constexpr ModelInfo info{.name = "callisto_diffuse", .title = "c1 on Lambert", .source = ""};

  template <class T>
  struct Parameters {
    Vec3<T> albedo;
    CallistoModulation<T> modulation;
  };

  template <class P, class Visit>
  static constexpr void describe(P& p, Visit&& visit) {
    visit(p.albedo, albedo_parameter);
    describe_callisto_modulation(p.modulation, visit);
  }

  template <class T, class G>
  static Vec3<T> evaluate(const Parameters<T>& p, const Geometry<G>& g) {
    return callisto_modulation(p.modulation,
                               CosinePair<G>{g.cos_theta_d, one_minus_cosine(g.sin2_theta_d, g.cos_theta_d)},
                               CosinePair<G>{g.cos_theta_h, one_minus_cosine(g.sin2_theta_h, g.cos_theta_h)},
                               p.modulation.diffuse_fresnel, p.modulation.retroreflection) *
           (p.albedo / pi);
  }
};

}  // namespace

OperationCount callisto_diffuse_operations() { return count_operations(trace_shader<CallistoDiffuse>()); }

}  // namespace lobefit
