// SPDX-License-Identifier: BSD-3-Clause
#include "potential_kernels.hpp"

#include "cairn/runtime/kernel_choice.hpp"

namespace cairn {

namespace portable {
void relax_row(const PotentialRows& rows, std::size_t cell, std::size_t parity, double* largest);
}
#if defined(CAIRN_X86_KERNELS)
namespace avx2 {
void relax_row(const PotentialRows& rows, std::size_t cell, std::size_t parity, double* largest);
}
namespace avx512 {
void relax_row(const PotentialRows& rows, std::size_t cell, std::size_t parity, double* largest);
}
#endif

RelaxRow choose_relax_row(std::string_view limit) {
  static constexpr RelaxRow kPortable = &portable::relax_row;
#if defined(CAIRN_X86_KERNELS)
  static constexpr RelaxRow kAvx2 = &avx2::relax_row, kAvx512 = &avx512::relax_row;
  const RelaxRow* const chosen = choose_kernels<RelaxRow>(limit, &kPortable, &kAvx2, &kAvx512);
#else
  const RelaxRow* const chosen = choose_kernels<RelaxRow>(limit, &kPortable, nullptr, nullptr);
#endif
  return chosen ? *chosen : nullptr;
}

}  // namespace cairn
