// SPDX-License-Identifier: BSD-3-Clause
// What the machine can do with one thread, the roofs over every factorisation: prints
// {"dgemm": flops per second, "bandwidth": bytes per second}.
#include <dlfcn.h>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <optional>
#include <vector>

#include <fmt/core.h>

namespace {

constexpr int kPasses = 5;

/// Fortran's dgemm: everything by address.
using Dgemm = void (*)(const char*, const char*, const int*, const int*, const int*, const double*,
                       const double*, const int*, const double*, const int*, const double*, double*,
                       const int*);

/// Opened when asked for: only this comparison needs it, and it may be missing.
Dgemm open_dgemm() {
  for (const char* file : {"libopenblas.so.0", "libopenblas.so"}) {
    void* library = ::dlopen(file, RTLD_NOW | RTLD_LOCAL);
    if (!library) continue;
    using SetThreads = void (*)(int);
    if (auto set = reinterpret_cast<SetThreads>(::dlsym(library, "openblas_set_num_threads")))
      set(1);
    return reinterpret_cast<Dgemm>(::dlsym(library, "dgemm_"));
  }
  return nullptr;
}

template <class Work>
double fastest(const Work& work) {
  using Clock = std::chrono::steady_clock;
  double best = 0.0;
  for (int pass = 0; pass < kPasses; ++pass) {
    const Clock::time_point begin = Clock::now();
    work();
    const double seconds = std::chrono::duration<double>(Clock::now() - begin).count();
    best = pass == 0 ? seconds : std::min(best, seconds);
  }
  return best;
}

/// Rate of OpenBLAS' dgemm on square matrices of `size`, the best of a few calls; empty where there
/// is no OpenBLAS to open.
std::optional<double> dgemm_rate(int size = 1024) {
  const Dgemm dgemm = open_dgemm();
  if (!dgemm) return std::nullopt;
  const std::size_t entries = static_cast<std::size_t>(size) * static_cast<std::size_t>(size);
  std::vector<double> a(entries, 0.5), b(entries, 0.25), c(entries, 0.0);
  const double one = 1.0, zero = 0.0;
  const double seconds = fastest([&] {
    dgemm("N", "N", &size, &size, &size, &one, a.data(), &size, b.data(), &size, &zero, c.data(),
          &size);
  });
  return 2.0 * static_cast<double>(entries) * size / seconds;
}

/// Bytes per second of a[i] = b[i] + s c[i] over arrays far larger than the caches, three transfers
/// a step, the best of a few passes (McCalpin's STREAM triad).
double triad_bandwidth() {
  constexpr std::size_t kEntries = std::size_t{1} << 24;  // 128 MiB an array
  std::vector<double> a(kEntries, 0.0), b(kEntries, 1.0), c(kEntries, 2.0);
  double factor = 0.5;
  const double seconds = fastest([&] {
    for (std::size_t k = 0; k < kEntries; ++k) a[k] = b[k] + factor * c[k];
    factor = a[kEntries / 2];  // so that no pass can be left out
  });
  return 3.0 * sizeof(double) * kEntries / seconds;
}

}  // namespace

int main() {
  const std::optional<double> rate = dgemm_rate();
  fmt::print("{{\"dgemm\": {}, \"bandwidth\": {}}}\n", rate ? fmt::format("{}", *rate) : "null",
             triad_bandwidth());
}
