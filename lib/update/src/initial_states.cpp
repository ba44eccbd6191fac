// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/update/initial_states.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <queue>
#include <span>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "cairn/graph/packed.hpp"
#include "cairn/runtime/plugin_call.hpp"
#include "cairn/types/factor_call.hpp"
#include "cairn/types/loss_by_size.hpp"
#include "cairn/update/placement.hpp"

namespace cairn {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
/// A measurement contradicts a state that leaves so many times the chi2 of another state: three
/// times the residuals.
constexpr double kContradicted = 9.0;
/// So many of the measurements that put a variable somewhere are tried, so that the time is linear
/// in their number.
constexpr int kTried = 16;
/// chi2 per row of the residuals that is nothing.
constexpr double kRounding = 1e-9;

std::string described(const Factor& factor) {
  std::string text(factor.type->tag());
  for (const Id id : factor.variables) text += " " + std::to_string(id);
  return text;
}

class InitialStates {
 public:
  InitialStates(GraphUpdate& update, const std::function<std::span<const double>(Id)>& state_of,
                Deciding deciding)
      : update_(update), state_of_(state_of), deciding_(deciding), new_(update.variables.size()) {
    for (std::size_t k = 0; k < new_.size(); ++k) {
      index_.emplace(update.variables[k].id, k);
      new_[k].settled = update.variables[k].fixed;
    }
  }

  int run() {
    for (const Factor& factor : update_.factors) {
      for (const Id id : factor.variables) {
        if (const auto it = index_.find(id); it != index_.end())
          new_[it->second].factors.push_back(&factor);
      }
      look_at(factor);
    }
    while (!next_.empty()) {
      const auto [agreeing, k] = next_.top();
      next_.pop();
      if (new_[k].settled) continue;
      settle(k);
      for (const Factor* factor : new_[k].factors) look_at(*factor);
    }
    return replaced_;
  }

 private:
  /// A factor as its type takes it, all of whose variables but one have their states.
  struct Measured {
    const Factor* factor;
    std::size_t place;  // of the one among the factor's variables
    std::vector<const double*> x;
    std::vector<double> z, root;
  };
  struct New {
    bool settled = false;
    std::vector<const Factor*> factors;
    std::vector<Measured> measured;
    /// The least chi2 that one of them which can put the variable somewhere leaves at its state.
    double agreeing = kInfinity;
  };

  void look_at(const Factor& factor);
  void measure(std::size_t k, Measured one);
  void settle(std::size_t k);
  static double chi2(Measured& one, const std::vector<double>& state);
  static bool place(Measured& by, const Variable& variable, std::vector<double>& placed);

  GraphUpdate& update_;
  const std::function<std::span<const double>(Id)>& state_of_;
  Deciding deciding_;
  std::vector<New> new_;
  std::unordered_map<Id, std::size_t> index_;  // in `new_`
  /// New variables by the chi2 that agrees best with their states: those that agree come first, and
  /// what hangs on them after them.
  using Next = std::pair<double, std::size_t>;
  std::priority_queue<Next, std::vector<Next>, std::greater<>> next_;
  int replaced_ = 0;
};

/// Takes the factor for a measurement of a new variable if it is the only one without its state.
void InitialStates::look_at(const Factor& factor) {
  std::size_t left = new_.size();  // none
  Measured one{.factor = &factor, .place = 0, .x = {}, .z = factor.measurement, .root = {}};
  for (std::size_t a = 0; a < factor.variables.size(); ++a) {
    const auto it = index_.find(factor.variables[a]);
    if (it == index_.end()) {
      one.x.push_back(state_of_(factor.variables[a]).data());
      continue;
    }
    one.x.push_back(update_.variables[it->second].state.data());
    if (new_[it->second].settled) continue;
    if (left < new_.size()) return;
    left = it->second;
    one.place = a;
  }
  if (left == new_.size()) return;
  one.root = factor.information;
  if (square_root(factor.information, factor.type->residual_size(), one.root) &&
      factor.type->normalize(one.z.data()).empty())
    measure(left, std::move(one));
}

void InitialStates::measure(std::size_t k, Measured one) {
  New& variable = new_[k];
  std::vector<double> placed(update_.variables[k].state.size());
  if (place(one, update_.variables[k], placed)) {
    variable.agreeing = std::min(variable.agreeing, chi2(one, update_.variables[k].state));
    // A factor on it alone does not join it with anything.
    if (one.x.size() > 1) next_.emplace(variable.agreeing, k);
  }
  variable.measured.push_back(std::move(one));
}

/// ‖r‖², infinite where it is not finite.
double InitialStates::chi2(Measured& one, const std::vector<double>& state) {
  std::vector<double> residual(static_cast<std::size_t>(one.factor->type->residual_size()));
  one.x[one.place] = state.data();
  const Factor& factor = *one.factor;
  call_factor(
      *factor.type, [&] { return described(factor); },
      [&] {
        factor.type->evaluate(one.x.data(), one.z.data(), one.root.data(), residual.data(),
                              nullptr);
      });
  double square = 0.0;
  for (const double r : residual) square += r * r;
  return std::isfinite(square) ? square : kInfinity;
}

/// Where a factor puts the variable. False if it does not determine that.
bool InitialStates::place(Measured& by, const Variable& variable, std::vector<double>& placed) {
  by.x[by.place] = variable.state.data();
  const bool determined = call_factor(
      *by.factor->type, [&] { return described(*by.factor); },
      [&] {
        return place_wholly(*by.factor->type, by.root, static_cast<int>(by.place), by.x.data(),
                            by.z.data(), placed.data());
      });
  return determined && std::ranges::all_of(placed, [](double v) { return std::isfinite(v); }) &&
         variable.type->normalize(placed.data()).empty();
}

void InitialStates::settle(std::size_t k) {
  new_[k].settled = true;
  Variable& variable = update_.variables[k];
  std::span<Measured> measured = new_[k].measured;
  std::vector<double> placed(variable.state.size());
  double agreeing = new_[k].agreeing;
  if (deciding_ == Deciding::first) {
    const auto first =
        std::ranges::find_if(measured, [&](Measured& by) { return place(by, variable, placed); });
    measured = measured.subspan(static_cast<std::size_t>(first - measured.begin()), 1);
    agreeing = chi2(measured.front(), variable.state);
  }
  int rows = 0;
  for (const Measured& one : measured) rows += one.factor->type->residual_size();
  if (agreeing <= kRounding * rows) return;
  const auto cost = [&](const std::vector<double>& state) {
    double sum = 0.0;
    for (Measured& one : measured) {
      double square = chi2(one, state);
      const int size = one.factor->type->residual_size();
      if (const auto loss = for_size(one.factor->loss, size))
        call_plugin(
            [&] { return "the loss of factor '" + std::string(one.factor->type->tag()) + "'"; },
            [&] { loss->evaluate(std::span(&square, 1), std::span(&square, 1), {}); });
      sum += square;
    }
    return sum;
  };
  double least = kInfinity;
  std::vector<double> best;
  int tried = 0;
  for (Measured& by : measured) {
    if (tried == kTried) break;
    if (!place(by, variable, placed)) continue;
    ++tried;
    if (const double of_placed = cost(placed); of_placed < least) {
      least = of_placed;
      best = placed;
    }
  }
  if (agreeing <= kContradicted * least) return;
  variable.state = std::move(best);
  ++replaced_;
}

}  // namespace

int replace_poor_states(GraphUpdate& update,
                        const std::function<std::span<const double>(Id)>& state_of,
                        Deciding deciding) {
  if (update.variables.empty() || update.factors.empty()) return 0;
  return InitialStates(update, state_of, deciding).run();
}

}  // namespace cairn
