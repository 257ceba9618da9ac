#define STRATA_KERNELS kPlain
#include "core/optimise/star_kernels.inl"

namespace strata::star_kernels {

const Table& table() {
#ifdef STRATA_AVX2
  static const bool fast = __builtin_cpu_supports("avx2") != 0;
  if (fast) return kAvx2;
#endif
  return kPlain;
}

}  // namespace strata::star_kernels
