// SPDX-License-Identifier: BSD-3-Clause
// Losses whose numbers are right, and which take what they do not give back, share what they write
// to, or end badly.
#include <fcntl.h>

#include <array>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <memory>
#include <span>
#include <thread>

#include "cairn/plugin/registry.hpp"
#include "cairn/types/loss.hpp"

namespace {

/// ρ(s) = ln(1 + s).
class Logarithm : public cairn::Loss {
 public:
  void evaluate(std::span<const double> s, std::span<double> rho,
                std::span<double> weight) const override {
    for (std::size_t k = 0; k < s.size(); ++k) {
      if (!rho.empty()) rho[k] = std::log1p(s[k]);
      if (!weight.empty()) weight[k] = 1.0 / (1.0 + s[k]);
    }
  }
  double second_derivative(double s) const override { return -1.0 / ((1.0 + s) * (1.0 + s)); }
};

struct Leaks final : Logarithm {
  void evaluate(std::span<const double> s, std::span<double> rho,
                std::span<double> weight) const override {
    double* copy = new double[s.size()];
    for (std::size_t k = 0; k < s.size(); ++k) copy[k] = s[k];
    last = copy;
    Logarithm::evaluate({copy, s.size()}, rho, weight);
  }
  mutable double* volatile last = nullptr;
};

/// What it writes to belongs to all threads.
struct Races final : Logarithm {
  void evaluate(std::span<const double> s, std::span<double> rho,
                std::span<double> weight) const override {
    static std::array<double, 256> scratch;
    for (std::size_t k = 0; k < s.size(); ++k) scratch[k] = 0.0;
    for (std::size_t k = 0; k < s.size(); ++k) scratch[k] += s[k];
    Logarithm::evaluate({scratch.data(), s.size()}, rho, weight);
  }
};

struct OpensFiles final : Logarithm {
  void evaluate(std::span<const double> s, std::span<double> rho,
                std::span<double> weight) const override {
    static_cast<void>(::open("/dev/null", O_RDONLY | O_CLOEXEC));
    Logarithm::evaluate(s, rho, weight);
  }
};

struct LeavesThreads final : Logarithm {
  LeavesThreads() {
    std::thread([] {
      for (;;) std::this_thread::sleep_for(std::chrono::hours(1));
    }).detach();
  }
};

struct CrashesAtItsEnd final : Logarithm {
  ~CrashesAtItsEnd() override { std::abort(); }
};

struct IsMadeSlowly final : Logarithm {
  IsMadeSlowly() { std::this_thread::sleep_for(std::chrono::milliseconds(700)); }
};

template <class Wrong>
void add(cairn::Registrar& registrar, const char* name) {
  registrar.add<cairn::Loss>(
      name, {}, [](const cairn::Options&, cairn::Registry&) { return std::make_unique<Wrong>(); });
}

}  // namespace

void cairn_register(cairn::Registrar& registrar) {
  add<Leaks>(registrar, "leaks");
  add<Races>(registrar, "races");
  add<OpensFiles>(registrar, "opens_files");
  add<LeavesThreads>(registrar, "leaves_threads");
  add<CrashesAtItsEnd>(registrar, "crashes_at_its_end");
  add<IsMadeSlowly>(registrar, "is_made_slowly");
}
