// SPDX-License-Identifier: BSD-3-Clause
#include "factor_pool_checks.hpp"

#include <algorithm>
#include <bit>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "factor_samples.hpp"

namespace cairn::conformance {
namespace {

using Eigen::Map;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kRounding = 1e-10;  // of sums of a few products, relative to their size

/// Several factors as a graph stores them: one array of states per type of variable.
class Pool {
 public:
  Pool(const FactorSamples& type, const std::vector<FactorSample>& factors) {
    std::map<const VariableType*, std::vector<double>> arrays;
    for (const FactorSample& s : factors) {
      for (std::size_t v = 0; v < s.x.size(); ++v) {
        std::vector<double>& array = arrays[type.variables()[v]];
        slots_.push_back(static_cast<std::int32_t>(array.size() / s.x[v].size()));
        array.insert(array.end(), s.x[v].begin(), s.x[v].end());
      }
      measurements_.insert(measurements_.end(), s.z.begin(), s.z.end());
      // In another order than the factors.
      whitening_.insert(whitening_.begin(), s.U.begin(), s.U.end());
      noises_.insert(noises_.begin(), static_cast<std::int32_t>(noises_.size()));
    }
    std::map<const VariableType*, std::size_t> places;
    for (const auto& [variable, array] : arrays) {
      places[variable] = states_.size();
      states_.emplace_back("states", array);
    }
    for (const VariableType* variable : type.variables())
      pointers_.push_back(states_[places[variable]].data());
    view_ = {factors.size(),    slots_.data(),  measurements_.data(),
             whitening_.data(), noises_.data(), pointers_.data()};
  }
  const FactorView& view() const { return view_; }

 private:
  std::vector<std::int32_t> slots_, noises_;
  std::vector<double> measurements_, whitening_;
  std::vector<Guarded> states_;
  std::vector<const double*> pointers_;
  FactorView view_;
};

/// Where the blocks of the factors of a pool go: each to a place of its own, by turns in H and in
/// the scratch.
struct Places {
  std::vector<LinearizeTarget> blocks, gradients;
  std::size_t H = 0, scratch = 0;

  Places(const FactorSamples& type, std::size_t factors) {
    for (std::size_t f = 0; f < factors; ++f) {
      for (std::size_t a = 0; a < type.arity(); ++a) {
        for (std::size_t b = a; b < type.arity(); ++b) {
          const bool adds = blocks.size() % 2 == 1;
          std::size_t& used = adds ? scratch : H;
          const bool transposed = a != b && (blocks.size() + 1) % 3 == 0;
          blocks.push_back(adds ? summand(used, transposed)
                                : LinearizeTarget(LinearizeTarget::Array::H,
                                                  static_cast<std::int64_t>(used),
                                                  LinearizeTarget::How::write, transposed));
          used += type.tangent(a) * type.tangent(b);
        }
        gradients.push_back(summand(scratch, false));
        scratch += type.tangent(a);
      }
    }
  }
  LinearizeSink sink(double* of_H, double* of_scratch) const {
    return {{of_H, nullptr, of_scratch}, blocks.data(), gradients.data()};
  }

 private:
  static LinearizeTarget summand(std::size_t at, bool transposed) {
    return {LinearizeTarget::Array::scratch, static_cast<std::int64_t>(at),
            LinearizeTarget::How::add, transposed};
  }
};

/// `squared_norms` and `linearize` of factors 1 … 3 of five, against `evaluate` of each.
void check_pool(FactorSamples& type, const std::vector<FactorSample>& factors, bool weighted,
                Checker& check) {
  const Pool pool(type, factors);
  const std::size_t begin = 1, end = factors.size() - 1, count = end - begin;
  const std::vector<double> weights{0.3, 1.0, 0.7};
  const Places places(type, factors.size());
  Guarded norms("out", count), norms_too("out_squared_norms", count), H("H", places.H),
      scratch = Guarded::sum("scratch", places.scratch);
  check.call("squared_norms", {&norms},
             [&] { type.type().squared_norms(pool.view(), begin, end, norms.data()); });
  const LinearizeSink sink = places.sink(H.data(), scratch.data());
  check.call("linearize", {&norms_too, &H, &scratch}, [&] {
    type.type().linearize(pool.view(), begin, end, weighted ? weights.data() : nullptr, sink,
                          norms_too.data());
  });

  const State H_before = Guarded("", places.H).values();
  const State H_found = H.values(), scratch_found = scratch.values(), found = norms.values(),
              found_too = norms_too.values();
  std::size_t pair = begin * (places.blocks.size() / factors.size());
  double worst_block = 0.0, worst_gradient = 0.0;
  for (std::size_t f = begin; f < end; ++f) {
    const Evaluation e = type.evaluate(factors[f]);
    const Map<const VectorXd> r(e.r.data(), std::ssize(e.r));
    const double w = weighted ? weights[f - begin] : 1.0, s = r.squaredNorm();
    check.within(std::abs(found[f - begin] - s), kRounding * (1.0 + s),
                 "squared_norms is ‖r‖² of evaluate");
    check.within(std::abs(found_too[f - begin] - s), kRounding * (1.0 + s),
                 "linearize gives ‖r‖² of evaluate");
    for (std::size_t a = 0; a < type.arity(); ++a) {
      for (std::size_t b = a; b < type.arity(); ++b, ++pair) {
        MatrixXd block = w * e.J[a].transpose() * e.J[b];
        const LinearizeTarget at = places.blocks[pair];
        if (at.transposed()) block.transposeInPlace();
        const double* data = (at.adds() ? scratch_found : H_found).data() + at.offset();
        const double off = (Map<const MatrixXd>(data, block.rows(), block.cols()) - block).norm() /
                           (1.0 + block.norm());
        if (!(off <= worst_block)) worst_block = off;
      }
      const VectorXd gradient = -w * e.J[a].transpose() * r;
      const double off = (Map<const VectorXd>(scratch_found.data() +
                                                  places.gradients[f * type.arity() + a].offset(),
                                              gradient.size()) -
                          gradient)
                             .norm() /
                         (1.0 + gradient.norm());
      if (!(off <= worst_gradient)) worst_gradient = off;
    }
  }
  check.within(worst_block, kRounding, "linearize adds w JᵀJ of evaluate");
  check.within(worst_gradient, kRounding, "linearize adds −w Jᵀr of evaluate");
  // Blocks of factors outside of the range.
  const std::size_t per_factor = places.blocks.size() / factors.size();
  bool outside = false;
  for (const std::size_t f : {std::size_t{0}, factors.size() - 1}) {
    for (std::size_t k = f * per_factor; k < (f + 1) * per_factor; ++k) {
      const LinearizeTarget at = places.blocks[k];
      const auto offset = static_cast<std::size_t>(at.offset());
      const double now = (at.adds() ? scratch_found : H_found)[offset];
      const double before = at.adds() ? 0.0 : H_before[offset];
      outside =
          outside || std::bit_cast<std::uint64_t>(now) != std::bit_cast<std::uint64_t>(before);
    }
  }
  check.expect(!outside, "linearize writes for factors [begin, end) alone",
               [] { return std::string("a block of another factor changed"); });

  // All variables constant: a write would go to a null pointer.
  const std::vector<LinearizeTarget> nowhere(places.blocks.size());
  const LinearizeSink none{.blocks = nowhere.data(), .gradients = nowhere.data()};
  check.call("linearize", {}, [&] {
    type.type().linearize(pool.view(), begin, end, nullptr, none, norms_too.data());
  });
}

/// Seconds per factor of `linearize`, the least of several runs over a pool.
double seconds_per_factor(FactorSamples& samples, Checker& check) {
  const std::vector<FactorSample> some = some_factors(samples, 20);
  if (some.empty()) return std::numeric_limits<double>::quiet_NaN();
  std::vector<FactorSample> factors;
  for (std::size_t k = 0; k < 1000; ++k) factors.push_back(some[k % some.size()]);
  const Pool pool(samples, factors);
  const Places places(samples, factors.size());
  std::vector<double> H(places.H), scratch(places.scratch), norms(factors.size());
  const LinearizeSink sink = places.sink(H.data(), scratch.data());
  double least = std::numeric_limits<double>::infinity();
  check.call("linearize", [&] {
    for (int round = 0; round < 10; ++round) {
      const auto begin = std::chrono::steady_clock::now();
      samples.type().linearize(pool.view(), 0, factors.size(), nullptr, sink, norms.data());
      const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - begin;
      least = std::min(least, taken.count());
    }
  });
  return least / static_cast<double>(factors.size());
}

}  // namespace

void check_pools(const Subject& subject, Checker& check) {
  FactorSamples samples(subject, check);
  if (!samples.fits()) return check.note("its sizes do not fit its variables (see sizes)");
  for (int k = 0; k < check.options().samples; ++k) {
    check.sample("", [&] {
      const std::vector<FactorSample> factors = some_factors(samples, 5);
      check.expect(factors.size() == 5, "normalize accepts some measurement within ±2",
                   [&] { return "it says: " + samples.refusal(); });
      if (factors.size() < 5) return;
      for (const FactorSample& s : factors) {
        if (!is_finite(samples.residual(s))) return;  // a finding of the residual
      }
      check.describe("five factors, the second: " + factors[1].text());
      check_pool(samples, factors, k % 2 == 1, check);
    });
  }
}

void note_time(const Subject& subject, Checker& check) {
  static const std::string reference = "EDGE_SE2";
  check.without_counting([&] {
    check.sample("", [&] {
      FactorSamples samples(subject, check);
      if (!samples.fits()) return check.note("its sizes do not fit its variables (see sizes)");
      const double own = seconds_per_factor(samples, check);
      std::string text = fmt::format("{:.3g} ns per factor to linearise", 1e9 * own);
      if (subject.name != reference && subject.registry.has("factor", reference)) {
        FactorSamples others({subject.registry, reference}, check);
        text +=
            fmt::format("; {} takes {:.3g} ns", reference, 1e9 * seconds_per_factor(others, check));
      }
      check.note(text);
    });
  });
}

}  // namespace cairn::conformance
