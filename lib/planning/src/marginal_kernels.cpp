// SPDX-License-Identifier: BSD-3-Clause
#include "marginal_kernels.hpp"

#include "cairn/runtime/kernel_choice.hpp"

namespace cairn {

namespace portable {
void update_marginals(const MarginalUpdate& update);
}  // namespace portable
#if defined(CAIRN_X86_KERNELS)
namespace avx2 {
void update_marginals(const MarginalUpdate& update);
}  // namespace avx2
namespace avx512 {
void update_marginals(const MarginalUpdate& update);
}  // namespace avx512
#endif

namespace {

struct Kernels {
  UpdateMarginals update;
};

}  // namespace

UpdateMarginals choose_marginal_kernel() {
  static constexpr Kernels kPortable{&portable::update_marginals};
#if defined(CAIRN_X86_KERNELS)
  static constexpr Kernels kAvx2{&avx2::update_marginals}, kAvx512{&avx512::update_marginals};
  return choose_kernels<Kernels>("auto", &kPortable, &kAvx2, &kAvx512)->update;
#else
  return choose_kernels<Kernels>("auto", &kPortable, nullptr, nullptr)->update;
#endif
}

}  // namespace cairn
