// SPDX-License-Identifier: BSD-3-Clause
#include "kernels.hpp"

#include <string_view>

namespace cairn::schur {

namespace portable {
extern const Kernels kernels;
}
#if defined(CAIRN_X86_KERNELS)
namespace avx2 {
extern const Kernels kernels;
}
namespace avx512 {
extern const Kernels kernels;
}
#endif

const Kernels* choose_kernels(const char* limit) {
  const std::string_view name(limit);
  if (name == "portable") return &portable::kernels;
#if defined(CAIRN_X86_KERNELS)
  const bool has_avx2 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
  const bool has_avx512 = has_avx2 && __builtin_cpu_supports("avx512f") &&
                          __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl");
  if (name == "auto")
    return has_avx512 ? &avx512::kernels : has_avx2 ? &avx2::kernels : &portable::kernels;
  if (name == "avx512") return has_avx512 ? &avx512::kernels : nullptr;
  if (name == "avx2") return has_avx2 ? &avx2::kernels : nullptr;
#else
  if (name == "auto") return &portable::kernels;
#endif
  return nullptr;
}

}  // namespace cairn::schur
