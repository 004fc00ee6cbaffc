// What lobefit_bench measures.
//
// Every benchmark counts its evaluations with SetItemsProcessed, and names the benchmark it is to be compared with in
// its label.
#pragma once

namespace lobefit {

/// batch/single/MODEL against batch/libm/MODEL, and all models one after the other.
void register_model_batches();

/// batch/SET/callisto for each instruction set that this machine has, against batch/libm/callisto.
void register_instruction_sets();

/// The microfacet-diffuse reference: facets, samples (facet × direction pairs), quadrature.
void register_integrator();

/// A staged fit of a measured material against evaluating the model once at its directions.
void register_material_fit();

}  // namespace lobefit
