// SPDX-License-Identifier: BSD-3-Clause
// The life of an estimator: the input decodes to updates of a small graph, in the plane or in
// space, and to questions. A plain graph is kept beside the estimator, and after every update what
// the estimator holds, its estimate, its chi2 and its covariances are compared with a dense
// solution.
#include "fuzz/targets/incremental_life.hpp"
#include "fuzz/targets/target.hpp"

namespace cairn::fuzz {
namespace {

void run(Bytes bytes) { IncrementalLife(bytes).run(); }

/// Bytes of a simple generator of numbers, the same on every machine.
std::string numbers(unsigned seed, std::size_t count) {
  std::string text;
  std::uint64_t state = seed;
  for (std::size_t k = 0; k < count; ++k) {
    state = state * 6364136223846793005U + 1442695040888963407U;
    text += static_cast<char>(state >> 56U);
  }
  return text;
}

std::vector<std::string> seeds() {
  std::vector<std::string> all;
  for (unsigned seed = 0; seed < 64; ++seed) {
    // Every setting of the first byte, then a life at random.
    all.push_back(static_cast<char>(seed * 5) + numbers(seed, 40 + 10 * (seed % 16)));
  }
  return all;
}

std::vector<std::string> words() { return {}; }

}  // namespace

Target incremental() {
  return {"incremental",
          &run,
          &seeds,
          &words,
          {{"types", "slam2d"},
           {"types", "slam3d"},
           {"optimizer", "levenberg_marquardt"},
           {"linear_solver", "block_cholesky"},
           {"estimator", "incremental_cholesky"}},
          512};
}

}  // namespace cairn::fuzz
