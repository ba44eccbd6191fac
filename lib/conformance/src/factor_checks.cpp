// SPDX-License-Identifier: BSD-3-Clause
// Laws of factor types.
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <utility>

#include <Eigen/Core>

#include "cairn/evaluation/check_factor.hpp"
#include "repetition.hpp"
#include "samples.hpp"

namespace cairn::conformance {
namespace {

using Eigen::Index;
using Eigen::Map;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kRounding = 1e-10;    // of sums of a few products, relative to their size
constexpr double kDifferences = 1e-6;  // of differences, relative to the largest entry

std::vector<double> unit_whitening(int size) {
  std::vector<double> packed;
  for (int row = 0; row < size; ++row) {
    packed.push_back(1.0);
    packed.insert(packed.end(), static_cast<std::size_t>(size - row - 1), 0.0);
  }
  return packed;
}

MatrixXd whole(const std::vector<double>& packed, int size) {
  MatrixXd U = MatrixXd::Zero(size, size);
  auto entry = packed.begin();
  for (int row = 0; row < size; ++row) {
    for (int column = row; column < size; ++column) U(row, column) = *entry++;
  }
  return U;
}

bool is_finite(const State& v) {
  return std::ranges::all_of(v, [](double x) { return std::isfinite(x); });
}

/// What one call of `evaluate` gives.
struct Evaluation {
  State r;
  std::vector<MatrixXd> J;
};

/// A factor type with the types of its variables, samples of both, and guarded calls.
class FactorSamples {
 public:
  FactorSamples(const Subject& subject, Checker& check)
      : type_(subject.registry.factor_type(subject.name)),
        check_(check),
        random_(RandomNumbers::mixed(check.options().seed + 17)) {
    for (const std::string_view tag : type_->variable_tags()) {
      owners_.push_back(subject.registry.variable_type(tag));
      variables_.push_back(owners_.back().get());
      states_.emplace_back(*owners_.back(), check, check.options().seed + owners_.size());
    }
  }

  const FactorType& type() const { return *type_; }
  std::span<const VariableType* const> variables() const { return variables_; }
  std::size_t arity() const { return variables_.size(); }
  std::size_t residual_size() const { return static_cast<std::size_t>(type_->residual_size()); }
  std::size_t tangent(std::size_t v) const { return states_[v].tangent(); }

  /// Whether the declared sizes fit the variables; nothing else can be checked where they don't.
  bool fits() const {
    if (type_->arity() != static_cast<int>(arity()) || arity() == 0) return false;
    for (std::size_t v = 0; v < arity(); ++v) {
      const int k = static_cast<int>(v);
      if (type_->tangent_size(k) != variables_[v]->tangent_size() ||
          type_->ambient_size(k) != variables_[v]->ambient_size())
        return false;
    }
    return type_->residual_size() > 0 && type_->measurement_size() >= 0;
  }

  /// A measurement that `normalize` accepts; none if it refuses a thousand of them.
  std::optional<State> measurement() {
    const auto size = static_cast<std::size_t>(type_->measurement_size());
    for (int attempt = 0; attempt < 1000; ++attempt) {
      State z(size);
      for (double& number : z) number = random_.uniform(attempt % 2 == 0 ? -2.0 : 0.1, 2.0);
      Guarded in = Guarded::in_place("measurement", z);
      refusal_ = check_.call("normalize", {&in}, [&] { return type_->normalize(in.data()); });
      if (refusal_.empty()) return in.values();
    }
    return {};
  }
  /// The last reason for which `normalize` refused one.
  const std::string& refusal() const { return refusal_; }

  /// Random states, measurement and information. `close`: a variable that the measurement
  /// determines is near where the error is zero, as in an optimised graph.
  std::optional<FactorSample> sample(bool close) {
    FactorSample s;
    for (VariableSamples& samples : states_) s.x.push_back(samples.state());
    std::optional<State> z = measurement();
    if (!z) return {};
    s.z = std::move(*z);
    for (int row = 0; row < type_->residual_size(); ++row) {
      s.U.push_back(random_.uniform(0.5, 3.0));
      for (int column = row + 1; column < type_->residual_size(); ++column)
        s.U.push_back(random_.uniform(-1.0, 1.0));
    }
    for (std::size_t v = arity(); close && v-- > 0;) {
      const std::optional<State> at = propagate(s, v);
      if (!at) continue;
      s.x[v] = states_[v].retract(*at, states_[v].step(0.01));
      break;
    }
    return s;
  }

  std::optional<State> propagate(const FactorSample& s, std::size_t target) const {
    std::vector<Guarded> in = guarded(s);
    Guarded z("measurement", s.z), out("out", states_[target].ambient());
    std::vector<const double*> x = pointers(in);
    x[target] = nullptr;  // it must not read what it computes
    const bool done = check_.call("propagate", {&z, &out}, [&] {
      return type_->propagate(static_cast<int>(target), x.data(), z.data(), out.data());
    });
    if (!done) return {};
    return out.values();
  }

  State residual(const FactorSample& s) const { return evaluate(s, false).r; }

  Evaluation evaluate(const FactorSample& s, bool with_jacobians = true) const {
    std::vector<Guarded> in = guarded(s);
    Guarded z("measurement", s.z), U("sqrt_information", s.U), r("residual", residual_size());
    std::vector<Guarded> J;
    std::vector<double*> J_pointers;
    for (std::size_t v = 0; v < arity(); ++v)
      J.emplace_back(fmt::format("jacobians[{}]", v), residual_size() * tangent(v));
    for (Guarded& one : J) J_pointers.push_back(one.data());
    const std::vector<const double*> x = pointers(in);
    check_.call("evaluate", {&z, &U, &r}, [&] {
      type_->evaluate(x.data(), z.data(), U.data(), r.data(),
                      with_jacobians ? J_pointers.data() : nullptr);
    });
    examine("evaluate", in);
    examine("evaluate", J);
    Evaluation result{r.values(), {}};
    for (std::size_t v = 0; v < arity() && with_jacobians; ++v) {
      const State values = J[v].values();
      result.J.emplace_back(Map<const MatrixXd>(values.data(), static_cast<Index>(residual_size()),
                                                static_cast<Index>(tangent(v))));
    }
    return result;
  }

 private:
  std::vector<Guarded> guarded(const FactorSample& s) const {
    std::vector<Guarded> all;
    for (std::size_t v = 0; v < s.x.size(); ++v) all.emplace_back(fmt::format("x[{}]", v), s.x[v]);
    return all;
  }
  static std::vector<const double*> pointers(std::vector<Guarded>& arrays) {
    std::vector<const double*> all;
    for (Guarded& array : arrays) all.push_back(array.data());
    return all;
  }
  void examine(std::string_view callback, const std::vector<Guarded>& arrays) const {
    for (const Guarded& array : arrays) {
      const std::string damage = array.damage();
      check_.expect(damage.empty(), fmt::format("{} writes to its output alone", callback),
                    [&] { return damage; });
    }
  }

  std::shared_ptr<const FactorType> type_;
  Checker& check_;
  RandomNumbers random_;
  std::vector<std::shared_ptr<const VariableType>> owners_;
  std::vector<const VariableType*> variables_;
  std::vector<VariableSamples> states_;
  std::string refusal_;
};

/// Calls body(samples, sample) for random factors, half of them close to a zero error.
template <class Body>
void for_factors(const Subject& subject, Checker& check, const Body& body) {
  FactorSamples samples(subject, check);
  if (!samples.fits()) return check.note("its sizes do not fit its variables (see sizes)");
  for (int k = 0; k < 2 * check.options().samples; ++k) {
    check.sample("", [&] {
      const std::optional<FactorSample> sample = samples.sample(k % 2 == 1);
      check.expect(sample.has_value(), "normalize accepts some measurement within ±2", [&] {
        return fmt::format("it refused 1000 of them, the last because: {}", samples.refusal());
      });
      if (!sample) return;
      check.describe(sample->text());
      body(samples, *sample);
    });
  }
}

void check_sizes(const Subject& subject, Checker& check) {
  const FactorSamples samples(subject, check);
  const FactorType& type = samples.type();
  check.expect(type.arity() == static_cast<int>(samples.arity()) && type.arity() > 0,
               "arity is the number of variable_tags",
               [&] { return fmt::format("{} and {}", type.arity(), samples.arity()); });
  for (std::size_t v = 0; v < samples.arity(); ++v) {
    const int k = static_cast<int>(v);
    if (k >= type.arity()) break;
    const VariableType& variable = *samples.variables()[v];
    const auto compare = [&](std::string_view what, int here, int there) {
      check.expect(here == there, fmt::format("{} is that of the variable", what), [&] {
        return fmt::format("{} of variable {}: {}, but {} has {}", what, v, here, variable.tag(),
                           there);
      });
    };
    compare("tangent_size", type.tangent_size(k), variable.tangent_size());
    compare("ambient_size", type.ambient_size(k), variable.ambient_size());
  }
  check.expect(type.residual_size() > 0, "residual_size is positive",
               [&] { return fmt::format("it is {}", type.residual_size()); });
  check.expect(type.tag() == subject.name, "tag is the name on offer",
               [&] { return fmt::format("it is '{}'", type.tag()); });
  if (!type.is_relative()) return;
  const bool related = samples.arity() == 2 && samples.variables()[0] == samples.variables()[1] &&
                       samples.variables()[0]->lie_group() != nullptr;
  check.expect(related, "a relative factor has two variables of one Lie group",
               [] { return std::string("is_relative is true, and this does not hold"); });
}

void check_residual(const Subject& subject, Checker& check) {
  for_factors(subject, check, [&](const FactorSamples& type, const FactorSample& s) {
    const State r = type.residual(s);
    const bool finite =
        check.expect(is_finite(r), "the residual is finite", [&] { return "it is " + text_of(r); });
    if (!finite) return;
    FactorSample plain = s;
    plain.U = unit_whitening(type.type().residual_size());
    const State e = type.residual(plain);
    const VectorXd expected =
        whole(s.U, type.type().residual_size()) * Map<const VectorXd>(e.data(), std::ssize(e));
    check.within((Map<const VectorXd>(r.data(), std::ssize(r)) - expected).norm(),
                 kRounding * (1.0 + expected.norm()), "the residual is whitened: r = U e");
  });
}

void check_measurements(const Subject& subject, Checker& check) {
  for_factors(subject, check, [&](const FactorSamples& type, const FactorSample& s) {
    const auto normalize = [&](State& z) {
      Guarded in = Guarded::in_place("measurement", z);
      std::string problem =
          check.call("normalize", {&in}, [&] { return type.type().normalize(in.data()); });
      z = in.values();
      return problem;
    };
    State again = s.z;
    const std::string problem = normalize(again);
    check.expect(problem.empty(), "normalize accepts what it has accepted",
                 [&] { return "it says: " + problem; });
    check.within(norm(difference(again, s.z)), 1e-14 * (1.0 + norm(s.z)),
                 "normalize changes nothing when it is repeated");
    // A graph refuses what is not finite in any case; normalize need not, but must return.
    for (std::size_t k = 0; k < s.z.size(); ++k) {
      State broken = s.z;
      broken[k] = std::numeric_limits<double>::quiet_NaN();
      normalize(broken);
    }
  });
}

/// How `check_factor` judges one sample. Differences show nothing near a kink or a pole of the
/// residual: there, those of different steps differ from each other.
enum class Verdict { right, wrong, unclear };
Verdict judge(const std::array<FactorCheck, 3>& checks) {
  for (const FactorCheck& check : checks) {
    if (check.largest_deviation <= kDifferences) return Verdict::right;
    if (!std::isfinite(check.claimed)) return Verdict::wrong;
  }
  for (std::size_t a = 0; a < checks.size(); ++a) {
    for (std::size_t b = 0; b < a; ++b) {
      const FactorCheck &one = checks[a], &other = checks[b];
      if (one.variable == other.variable && one.row == other.row && one.column == other.column &&
          std::abs(one.numeric - other.numeric) <= 0.1 * std::abs(one.claimed - one.numeric))
        return Verdict::wrong;
    }
  }
  return Verdict::unclear;
}

void check_jacobians(const Subject& subject, Checker& check) {
  int judged = 0, unclear = 0;
  for_factors(subject, check, [&](const FactorSamples& type, const FactorSample& s) {
    if (!is_finite(type.evaluate(s).r)) return;  // a finding of the residual
    std::vector<const double*> x;
    for (const State& state : s.x) x.push_back(state.data());
    std::array<FactorCheck, 3> checks;
    double step = 1e-3;
    for (FactorCheck& one : checks) {
      step *= 0.1;
      one = check.call("evaluate", [&] {
        return check_factor(type.type(), type.variables(), x, s.z, s.U, step);
      });
    }
    const Verdict verdict = judge(checks);
    ++judged;
    if (verdict == Verdict::unclear) ++unclear;
    const FactorCheck& shown = checks[1];
    if (shown.column < 0) {
      check.expect(verdict != Verdict::wrong,
                   "evaluate gives one residual, with Jacobians and without", [&] {
                     return fmt::format("row {}: {} with, {} without", shown.row, shown.claimed,
                                        shown.numeric);
                   });
      return;
    }
    check.expect(verdict != Verdict::wrong, "Jacobians are the derivatives of the residual", [&] {
      return fmt::format("variable {}, entry ({}, {}): {} where differences give {}",
                         shown.variable, shown.row, shown.column, shown.claimed, shown.numeric);
    });
  });
  check.describe("");
  check.expect(2 * unclear <= judged, "the residual is smooth at most states", [&] {
    return fmt::format("at {} of {} random states its differences depend on the step", unclear,
                       judged);
  });
}

// Pools
// ---------------------------------------------------------------------------------------------

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
      whitening_.insert(whitening_.end(), s.U.begin(), s.U.end());
    }
    std::map<const VariableType*, std::size_t> places;
    for (const auto& [variable, array] : arrays) {
      places[variable] = states_.size();
      states_.emplace_back("states", array);
    }
    for (const VariableType* variable : type.variables())
      pointers_.push_back(states_[places[variable]].data());
    view_ = {factors.size(), slots_.data(), measurements_.data(), whitening_.data(),
             pointers_.data()};
  }
  const FactorView& view() const { return view_; }

 private:
  std::vector<std::int32_t> slots_;
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

std::vector<FactorSample> some_factors(FactorSamples& samples, std::size_t count) {
  std::vector<FactorSample> factors;
  while (factors.size() < count) {
    std::optional<FactorSample> one = samples.sample(factors.size() % 2 == 1);
    if (!one) break;
    factors.push_back(std::move(*one));
  }
  return factors;
}

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

void check_propagate(const Subject& subject, Checker& check) {
  bool some = false;
  for_factors(subject, check, [&](const FactorSamples& type, const FactorSample& s) {
    FactorSample plain = s;
    plain.U = unit_whitening(type.type().residual_size());
    for (std::size_t target = 0; target < type.arity(); ++target) {
      const std::optional<State> at = type.propagate(plain, target);
      if (!at) continue;
      some = true;
      FactorSample moved = plain;
      moved.x[target] = *at;
      check.within(norm(type.residual(moved)), 1e-9 * (1.0 + norm(s.z)),
                   fmt::format("propagate to variable {} makes the error zero", target));
    }
    const LieGroup* group = type.variables()[0]->lie_group();
    if (!type.type().is_relative() || !group) return;
    some = true;
    FactorSample composed = plain;
    Guarded a("a", s.x[0]), b("b", s.z), ab("ab", s.x[0].size());
    check.call("compose", {&a, &b, &ab}, [&] { group->compose(a.data(), b.data(), ab.data()); });
    composed.x[1] = ab.values();
    check.within(norm(type.residual(composed)), 1e-9 * (1.0 + norm(s.z)),
                 "a relative factor has no error at x1 = x0 · z");
  });
  if (!some) check.note("it determines no variable from the others");
}

/// Residual and Jacobians of every factor, as they come.
State evaluate_all(const FactorSamples& samples, const std::vector<FactorSample>& factors) {
  State all;
  for (const FactorSample& s : factors) {
    std::vector<const double*> x;
    State r(samples.residual_size());
    std::vector<State> J;
    std::vector<double*> J_pointers;
    for (const State& state : s.x) x.push_back(state.data());
    for (std::size_t v = 0; v < samples.arity(); ++v)
      J.emplace_back(samples.residual_size() * samples.tangent(v));
    for (State& one : J) J_pointers.push_back(one.data());
    samples.type().evaluate(x.data(), s.z.data(), s.U.data(), r.data(), J_pointers.data());
    all.insert(all.end(), r.begin(), r.end());
    for (const State& one : J) all.insert(all.end(), one.begin(), one.end());
  }
  return all;
}

Repetition factor_uses(const Subject& subject, Checker& check) {
  const auto samples = std::make_shared<FactorSamples>(subject, check);
  if (!samples->fits() || !samples->sample(false)) return {};
  // All threads use the type's one object, each with factors of its own.
  return {"evaluate", 100, [samples, &check](std::uint64_t) {
            return [samples, factors = some_factors(
                                 *samples, static_cast<std::size_t>(check.options().samples))] {
              return evaluate_all(*samples, factors);
            };
          }};
}

// Time
// ----------------------------------------------------------------------------------------------

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

/// A note, never a finding: times depend on the machine and on what else it does.
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

}  // namespace

std::span<const Group> factor_groups() {
  static constexpr std::array<Group, 9> groups{{{"sizes", check_sizes},
                                                {"measurement", check_measurements},
                                                {"residual", check_residual},
                                                {"Jacobians", check_jacobians},
                                                {"pool", check_pools},
                                                {"propagate", check_propagate},
                                                {"memory", memory_group<factor_uses>, true},
                                                {"threads", threads_group<factor_uses>, true},
                                                {"time", note_time}}};
  return groups;
}

}  // namespace cairn::conformance
