// SPDX-License-Identifier: BSD-3-Clause
// One target as a program of libFuzzer; CAIRN_FUZZ_TARGET is its name.
#include <cstddef>
#include <cstdint>

#include "cairn/runtime/threads.hpp"
#include "fuzz/targets/target.hpp"

namespace {

const cairn::fuzz::Target& chosen() {
  static const cairn::fuzz::Target& target = cairn::fuzz::target(CAIRN_FUZZ_TARGET);
  return target;
}

}  // namespace

/// Loads the plugins before the first execution: their counters must be known by then.
extern "C" int LLVMFuzzerInitialize(int*, char***) {
  cairn::set_threads(1);
  for (const std::string& seed : chosen().seeds())
    chosen().run({reinterpret_cast<const std::uint8_t*>(seed.data()), seed.size()});
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  chosen().run({data, size});
  return 0;
}
