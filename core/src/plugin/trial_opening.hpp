// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <string>

namespace cairn {

/// Opens a shared object in a child process, which its static constructors may end, and returns
/// what they did to it, as "a static constructor threw an exception: …"; empty where they return,
/// and where it cannot be known (no process can be started, or it takes longer than 10 s).
///
/// There is no way back from an exception in a static constructor: `dlopen` is C, so that it would
/// leave the locks of the dynamic linker held, if `std::terminate` is not called before. What the
/// dynamic linker refuses is no matter of this; who opens the object next has its words. Throws
/// `std::bad_alloc` where the constructors lacked memory.
std::string failure_of_static_constructors(const std::filesystem::path& library);

}  // namespace cairn
