// The one place that decides which instruction sets the hot loops are compiled for.
#pragma once

/// Before a noinline function: it is compiled once per instruction set and the loader picks, so that one binary runs
/// from SSE2 to AVX-512. Loops whose lanes are never reduced across give the same bits on all of them.
#if defined(LOBEFIT_NO_CLONES)
#define LOBEFIT_CLONES
#else
#define LOBEFIT_CLONES __attribute__((target_clones("avx512f", "avx2", "default")))
#endif
