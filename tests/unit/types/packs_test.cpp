// SPDX-License-Identifier: BSD-3-Clause
#include "packs.hpp"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>

#include "cairn/lie/point.hpp"
#include "cairn/lie/se2.hpp"
#include "cairn/lie/se3.hpp"
#include "support/sampling.hpp"

namespace cairn::test {
namespace {

std::vector<int> widths() {
#if CAIRN_PACKS
  std::vector<int> all{1};
  for (const int width : {4, 8}) {
    if (width <= lanes::width()) all.push_back(width);
  }
  return all;
#else
  return {1};
#endif
}

/// Packs of this width for as long as it lives; 1: none.
class Width {
 public:
#if CAIRN_PACKS
  explicit Width(int width) : before_(std::exchange(lanes::width(), width)) {}
  ~Width() { lanes::width() = before_; }
#else
  explicit Width(int) {}
#endif
  Width(const Width&) = delete;
  Width& operator=(const Width&) = delete;

 private:
  [[maybe_unused]] int before_ = 1;
};

/// A pool of factors, each on states of its own, and targets for all they contribute.
struct Pool {
  const FactorType& type;
  std::size_t size = 0;
  std::vector<std::vector<double>> states;
  std::vector<double> measurements, sqrt_information, weights;
  std::vector<std::int32_t> slots, noises;
  std::vector<LinearizeTarget> blocks, gradients;
  std::int64_t numbers = 0;

  Pool(const FactorType& of, const std::vector<const VariableType*>& variables, std::size_t count,
       Sampler& sampler)
      : type(of), size(count), states(variables.size()) {
    std::int32_t noise = -1;
    for (std::size_t f = 0; f < size; ++f) {
      add_states(variables, sampler);
      add_targets(sampler);
      // About half of the groups of eight have one in all lanes.
      if (f == 0 || sampler.uniform(0.0, 1.0) < 0.1) {
        const auto U = sampler.sqrt_information(type.residual_size());
        sqrt_information.insert(sqrt_information.end(), U.begin(), U.end());
        ++noise;
      }
      noises.push_back(noise);
      weights.push_back(sampler.uniform(0.0, 1.0));
    }
  }

  /// Norms by themselves, norms, blocks and gradients.
  std::vector<double> linearized(bool weighted, std::size_t split = 0) const {
    std::vector<const double*> of_variables;
    for (const auto& x : states) of_variables.push_back(x.data());
    const FactorView view{
        size,          slots.data(),       measurements.data(), sqrt_information.data(),
        noises.data(), of_variables.data()};
    std::vector<double> norms(2 * size), H(numbers, 0.25), g(numbers, 0.75), scratch(numbers, 0.5);
    const LinearizeSink sink{{H.data(), g.data(), scratch.data()}, blocks.data(), gradients.data()};
    for (const auto& [begin, end] : {std::pair(std::size_t{0}, split), std::pair(split, size)}) {
      if (begin == end) continue;
      type.squared_norms(view, begin, end, norms.data() + begin);
      type.linearize(view, begin, end, weighted ? weights.data() + begin : nullptr, sink,
                     norms.data() + size + begin);
    }
    for (const auto* array : {&H, &g, &scratch})
      norms.insert(norms.end(), array->begin(), array->end());
    return norms;
  }

 private:
  void add_states(const std::vector<const VariableType*>& variables, Sampler& sampler) {
    std::vector<Regime> all = regimes();
    all.push_back({"half a turn", std::numbers::pi});
    all.push_back({"huge", -1.0, 1e12});
    std::vector<std::vector<double>> x;
    for (std::size_t v = 0; v < variables.size(); ++v) {
      const double which = sampler.uniform(0.0, static_cast<double>(all.size()));
      x.push_back(sampler.state(*variables[v], all[static_cast<std::size_t>(which)]));
    }
    std::vector<double> z = sampler.measurement(type);
    // Every other factor fits nearly, where its type says how.
    if (sampler.uniform(0.0, 1.0) < 0.5) {
      std::vector<const double*> pointers;
      for (const auto& state : x) pointers.push_back(state.data());
      std::vector<double> fits = x.back();
      const int target = static_cast<int>(x.size()) - 1;
      if (type.propagate(target, pointers.data(), z.data(), fits.data())) {
        const Regime off{"off", std::pow(10.0, sampler.uniform(-12.0, 0.0)), 0.01};
        x.back() =
            Sampler::retracted(*variables.back(), fits, sampler.tangent(*variables.back(), off));
      }
    }
    const double odd = sampler.uniform(0.0, 20.0);
    double& one = x.front()[static_cast<std::size_t>(
        sampler.uniform(0.0, static_cast<double>(x.front().size())))];
    if (odd < 1.0) one = std::numeric_limits<double>::quiet_NaN();
    if (odd > 1.0 && odd < 2.0) one = 1e5;  // for an angle many turns
    if (odd > 2.0 && odd < 3.0) one = -0.0;
    if (odd > 3.0 && odd < 4.0)
      x.back() = x.front().size() == x.back().size() ? x.front() : x.back();
    for (std::size_t v = 0; v < x.size(); ++v) {
      slots.push_back(static_cast<std::int32_t>(states[v].size() / x[v].size()));
      states[v].insert(states[v].end(), x[v].begin(), x[v].end());
    }
    measurements.insert(measurements.end(), z.begin(), z.end());
  }
  void add_targets(Sampler& sampler) {
    // Anywhere, written or added, or nowhere.
    const auto target = [&](int count, bool may_turn) {
      const double kind = sampler.uniform(0.0, 10.0);
      numbers += count;
      if (kind < 1.0) return LinearizeTarget();
      const auto array = static_cast<LinearizeTarget::Array>(static_cast<int>(kind) % 3);
      return LinearizeTarget(
          array, numbers - count,
          sampler.uniform(0.0, 1.0) < 0.5 ? LinearizeTarget::How::write : LinearizeTarget::How::add,
          may_turn && sampler.uniform(0.0, 1.0) < 0.5);
    };
    for (int a = 0; a < type.arity(); ++a) {
      for (int b = a; b < type.arity(); ++b)
        blocks.push_back(target(type.tangent_size(a) * type.tangent_size(b), a != b));
    }
    for (int a = 0; a < type.arity(); ++a) gradients.push_back(target(type.tangent_size(a), false));
  }
};

/// Of NaN only that it is one: which of two operands passes its bits on is the compiler's choice.
std::size_t different(const std::vector<double>& a, const std::vector<double>& b) {
  std::size_t count = 0;
  for (std::size_t k = 0; k < a.size(); ++k) {
    const bool both = std::isnan(a[k]) && std::isnan(b[k]);
    count += !both && std::bit_cast<std::uint64_t>(a[k]) != std::bit_cast<std::uint64_t>(b[k]);
  }
  return count;
}

/// How often a factor was evaluated, one at a time and several at a time.
struct Calls {
  int single = 0, packed = 0;
  template <class S>
  void count() {
    ++(lanes::kWidth<ValueOf<S>> == 1 ? single : packed);
  }
};
Calls calls;

/// Range from a pose to a point, as in docs/plugins.md.
struct Range {
  static constexpr std::string_view kTag = "RANGE";
  static constexpr int kResidual = 1, kMeasurement = 1;
  using Variables = std::tuple<Se2, PointXY>;
  template <class S>
  static Vector<S, 1> residual(const Vector<S, 3>& pose, const Vector<S, 2>& beacon,
                               const Measured<S, 1>& z) {
    using std::sqrt;
    calls.count<S>();
    const S dx = beacon[0] - pose[0], dy = beacon[1] - pose[1];
    return Vector<S, 1>(sqrt(dx * dx + dy * dy) - z[0]);
  }
};
/// The same for one factor at a time.
struct SingleRange : Range {
  template <class S>
  static Vector<S, 1> residual(const Vector<S, 3>& pose, const Vector<S, 2>& beacon,
                               const Vector<double, 1>& z) {
    return Range::residual<S>(pose, beacon, z);
  }
};
/// Branches, loops and functions on data that say something else for every factor.
struct Branching {
  static constexpr std::string_view kTag = "BRANCHING";
  static constexpr int kResidual = 2, kMeasurement = 1;
  using Variables = std::tuple<Se2, PointXYZ>;
  template <class S>
  static Vector<S, 2> residual(const Vector<S, 3>& pose, const Vector<S, 3>& x,
                               const Measured<S, 1>& z) {
    using std::abs, std::atan2, std::cos, std::exp, std::hypot, std::pow, std::sin, std::sqrt;
    calls.count<S>();
    S sum = pose[0] * x[0] + 1.0;
    for (int k = 0; k < 20 && sum > z[0]; ++k) sum = sum * 0.5 - 0.1;
    const S angle =
        x[1] < pose[1] ? atan2(x[1], pose[2]) : cos(pose[2]) * pow(abs(x[2]) + 1.0, 0.7);
    if (x[2] == pose[0] || !(angle >= -3.0)) return {sum / angle, hypot(sum, angle)};
    return {Se2::exp<S>({x[0], x[1], pose[2]})[1] + sin(sum), exp(-sqrt(abs(angle))) - z[0]};
  }
};
/// Through the exponentials and logarithms of both groups, differentiated automatically.
template <class V>
struct Between {
  static constexpr std::string_view kTag = "BETWEEN";
  static constexpr int kResidual = V::kTangent, kMeasurement = V::kAmbient;
  using Variables = std::tuple<V, V>;
  template <class S>
  static Vector<S, kResidual> residual(const Vector<S, V::kAmbient>& a,
                                       const Vector<S, V::kAmbient>& b,
                                       const Measured<S, V::kAmbient>& z) {
    const Vector<S, V::kAmbient> known = z.template cast<S>();
    return V::template local<S>(known, V::template between<S>(a, b));
  }
  static std::string normalize(Vector<double, kMeasurement>& z) { return V::normalize(z); }
};

TEST(Packs, GiveTheSameAsOneFactorAtATimeForFactorsOfOthers) {
  expect_equal_bits<Range>();
  expect_equal_bits<SingleRange>();
  expect_equal_bits<Branching>();
  expect_equal_bits<Between<Se2>>();
  expect_equal_bits<Between<Se3>>();
}

/// A pose whose retraction branches on the step.
struct Stepping : Se2 {
  static constexpr std::string_view kTag = "STEPPING";
  template <class S>
  static Vector<S, 3> retract(const Vector<S, 3>& x, const Vector<S, 3>& delta) {
    using std::sin;
    Vector<S, 3> y = x + delta;
    if (delta[0] > 0.5) y[1] = sin(y[1]);
    return y;
  }
};

template <class V>
void expect_equal_bits_of_retraction() {
  static_assert(V::kPacks);
  const auto type = define_variable<V>();
  Sampler sampler(9);
  for (std::size_t count = 1; count < 40; ++count) {
    std::vector<double> x, deltas;
    std::vector<std::int64_t> offsets;
    for (std::size_t s = 0; s < count; ++s) {
      const auto state = sampler.state(*type, {"any", -1.0});
      x.insert(x.end(), state.begin(), state.end());
      offsets.push_back(sampler.uniform(0.0, 1.0) < 0.2 ? -1 : std::ssize(deltas));
      // Small, large and huge steps beside each other.
      const auto step = sampler.vector(type->tangent_size(), 1.0);
      const double size = std::pow(10.0, sampler.uniform(-9.0, count % 3 == 0 ? 6.0 : -4.0));
      for (const double number : step) deltas.push_back(size * number);
      if (sampler.uniform(0.0, 1.0) < 0.05)
        deltas.back() = std::numeric_limits<double>::quiet_NaN();
    }
    std::vector<double> expected(x.size());
    for (std::size_t s = 0; s < count; ++s) {
      const std::size_t k = s * V::kAmbient;
      std::vector<double> y(x.begin() + k, x.begin() + k + V::kAmbient);
      if (offsets[s] >= 0) {
        const auto moved = V::template retract<double>(
            detail::load<V::kAmbient>(&x[k]), detail::load<V::kTangent>(&deltas[offsets[s]]));
        std::copy_n(moved.data(), V::kAmbient, y.begin());
      }
      std::copy(y.begin(), y.end(), expected.begin() + k);
    }
    for (const int width : widths()) {
      const Width set(width);
      std::vector<double> moved = x;
      type->retract(count, moved.data(), offsets.data(), deltas.data(), moved.data());
      EXPECT_EQ(different(moved, expected), 0U) << count << " states, width " << width;
    }
  }
}

TEST(Packs, MoveStatesAsOneAtATime) {
  expect_equal_bits_of_retraction<Se2>();
  expect_equal_bits_of_retraction<Stepping>();
}

template <class F>
Calls calls_of(int width, std::size_t count) {
  const Width set(width);
  const auto type = define_factor<F>();
  const auto first = define_variable<std::tuple_element_t<0, typename F::Variables>>(),
             second = define_variable<std::tuple_element_t<1, typename F::Variables>>();
  Sampler sampler(5);
  const Pool pool(*type, {first.get(), second.get()}, count, sampler);
  calls = {};
  pool.linearized(false);
  return calls;
}

TEST(Packs, TakeAsManyFactorsAsTheMachineCanUnlessTheMeasurementIsOfDoubles) {
  for (const int width : widths()) {
    if (width == 1) continue;
    const Calls all = calls_of<Range>(width, 16), single = calls_of<SingleRange>(width, 16);
    EXPECT_EQ(all.single, 0) << width;
    EXPECT_EQ(all.packed, 2 * 16 / width) << width;  // norms, then the system
    EXPECT_EQ(single.single, 2 * 16) << width;
    EXPECT_EQ(single.packed, 0) << width;
  }
  EXPECT_EQ(calls_of<Range>(1, 16).single, 2 * 16);
}

TEST(Packs, AreDoneAgainLaneByLaneWhereABranchTellsThemApart) {
  for (const int width : widths()) {
    if (width == 1) continue;
    const Calls all = calls_of<Branching>(width, 16);
    EXPECT_EQ(all.single, 0) << width;
    EXPECT_GT(all.packed, 2 * 16 / width) << width;
    EXPECT_LE(all.packed, 2 * 16 / width * (1 + width)) << width;
  }
}

}  // namespace

void expect_equal_bits(const FactorType& type, const std::vector<const VariableType*>& variables) {
  Sampler sampler(29);
  for (std::size_t size = 1; size <= 35; ++size) {
    const Pool pool(type, variables, size, sampler);
    for (const bool weighted : {false, true}) {
      const std::vector<double> expected = [&] {
        const Width set(1);
        return pool.linearized(weighted);
      }();
      for (const int width : widths()) {
        const Width set(width);
        for (const std::size_t split : {std::size_t{0}, size / 3, size / 2}) {
          EXPECT_EQ(different(pool.linearized(weighted, split), expected), 0U)
              << type.tag() << " " << type.metric() << ": " << size << " factors, " << width
              << " at a time, first " << split << (weighted ? ", weighted" : "");
        }
      }
    }
  }
}

}  // namespace cairn::test
