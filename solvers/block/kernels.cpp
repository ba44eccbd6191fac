// SPDX-License-Identifier: BSD-3-Clause
#include "kernels.hpp"

#include "cairn/runtime/kernel_choice.hpp"

namespace cairn::block {

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
#if defined(CAIRN_X86_KERNELS)
  return cairn::choose_kernels(limit, &portable::kernels, &avx2::kernels, &avx512::kernels);
#else
  return cairn::choose_kernels<Kernels>(limit, &portable::kernels, nullptr, nullptr);
#endif
}

}  // namespace cairn::block
