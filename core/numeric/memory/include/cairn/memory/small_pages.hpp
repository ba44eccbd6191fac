// SPDX-License-Identifier: BSD-3-Clause
#pragma once

namespace cairn::memory {

/// While one of these exists, the arrays of its thread ask for no further huge pages: for work with
/// a limit of time. The first touch of a huge page clears 2 MB, which takes 0.1 ms, and
/// several where the system has to make room for it first, or a virtual machine has to get it from
/// its host.
class __attribute__((visibility("default"))) SmallPages {
 public:
  SmallPages() noexcept;
  ~SmallPages();
  SmallPages(const SmallPages&) = delete;
  SmallPages& operator=(const SmallPages&) = delete;
};

}  // namespace cairn::memory
