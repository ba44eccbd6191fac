// SPDX-License-Identifier: BSD-3-Clause
#include "marginal_kernels.hpp"

#include "cairn/runtime/kernel_choice.hpp"

namespace cairn {

namespace portable {
void update_marginals(const MarginalUpdate* updates, int count);
void update_partners(const PartnerUpdate& update);
void update_stretches(const StretchUpdate& update);
}  // namespace portable
#if defined(CAIRN_X86_KERNELS)
namespace avx2 {
void update_marginals(const MarginalUpdate* updates, int count);
void update_partners(const PartnerUpdate& update);
void update_stretches(const StretchUpdate& update);
}  // namespace avx2
namespace avx512 {
void update_marginals(const MarginalUpdate* updates, int count);
void update_partners(const PartnerUpdate& update);
void update_stretches(const StretchUpdate& update);
}  // namespace avx512
#endif

namespace {

struct Kernels {
  UpdateMarginals marginals;
  UpdatePartners partners;
  UpdateStretches stretches;
};

const Kernels& choose() {
  static constexpr Kernels kPortable{&portable::update_marginals, &portable::update_partners,
                                     &portable::update_stretches};
#if defined(CAIRN_X86_KERNELS)
  static constexpr Kernels kAvx2{&avx2::update_marginals, &avx2::update_partners,
                                 &avx2::update_stretches},
      kAvx512{&avx512::update_marginals, &avx512::update_partners, &avx512::update_stretches};
  return *choose_kernels<Kernels>("auto", &kPortable, &kAvx2, &kAvx512);
#else
  return *choose_kernels<Kernels>("auto", &kPortable, nullptr, nullptr);
#endif
}

}  // namespace

UpdateMarginals choose_marginal_kernel() { return choose().marginals; }
UpdatePartners choose_partner_kernel() { return choose().partners; }
UpdateStretches choose_stretch_kernel() { return choose().stretches; }

}  // namespace cairn
