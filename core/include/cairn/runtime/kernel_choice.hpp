// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string_view>

namespace cairn {

/// Of one set of kernels compiled for several instruction sets, the fastest that this machine can
/// run: AVX-512 (F, DQ, VL), AVX2 with FMA, or portable. A set that was not built is null.
/// `limit` (portable, avx2, avx512; "auto": no limit) asks for one by name. Returns null for a name
/// that is not known, and for a set that was not built or that the machine cannot run.
template <class Kernels>
const Kernels* choose_kernels(std::string_view limit, const Kernels* portable, const Kernels* avx2,
                              const Kernels* avx512) {
#if defined(__x86_64__)
  const bool has_avx2 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
  const bool has_avx512 = has_avx2 && __builtin_cpu_supports("avx512f") &&
                          __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl");
#else
  const bool has_avx2 = false, has_avx512 = false;
#endif
  if (!has_avx2) avx2 = nullptr;
  if (!has_avx512) avx512 = nullptr;
  if (limit == "auto") return avx512 ? avx512 : avx2 ? avx2 : portable;
  if (limit == "avx512") return avx512;
  if (limit == "avx2") return avx2;
  return limit == "portable" ? portable : nullptr;
}

}  // namespace cairn
