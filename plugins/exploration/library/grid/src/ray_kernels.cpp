// SPDX-License-Identifier: BSD-3-Clause
#include "ray_kernels.hpp"

#include "cairn/runtime/kernel_choice.hpp"

namespace cairn {

namespace portable {
void follow_rays(const RayFan& fan, RayEnds& ends);
}
#if defined(CAIRN_X86_KERNELS)
namespace avx2 {
void follow_rays(const RayFan& fan, RayEnds& ends);
}
namespace avx512 {
void follow_rays(const RayFan& fan, RayEnds& ends);
}
#endif

FollowRays choose_ray_kernel(std::string_view limit) {
  static constexpr FollowRays kPortable = &portable::follow_rays;
#if defined(CAIRN_X86_KERNELS)
  static constexpr FollowRays kAvx2 = &avx2::follow_rays, kAvx512 = &avx512::follow_rays;
  const FollowRays* const chosen = choose_kernels(limit, &kPortable, &kAvx2, &kAvx512);
#else
  const FollowRays* const chosen = choose_kernels<FollowRays>(limit, &kPortable, nullptr, nullptr);
#endif
  return chosen ? *chosen : nullptr;
}

}  // namespace cairn
