// Compiled for AVX2 where the build knows how to (core/CMakeLists.txt); empty elsewhere.
#ifdef STRATA_AVX2
#define STRATA_KERNELS kAvx2
#include "core/optimise/star_kernels.inl"
#endif
