// SPDX-License-Identifier: BSD-3-Clause
#include "engine.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <numeric>
#include <utility>

#include <Eigen/Core>

#include "cairn/error.hpp"

namespace cairn::incremental {
namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point begin) {
  return std::chrono::duration<double>(Clock::now() - begin).count();
}

/// Adds the time from here to the end of the scope.
class Timed {
 public:
  explicit Timed(double& seconds) : seconds_(seconds), begin_(Clock::now()) {}
  Timed(const Timed&) = delete;
  Timed& operator=(const Timed&) = delete;
  ~Timed() { seconds_ += seconds_since(begin_); }

 private:
  double& seconds_;
  Clock::time_point begin_;
};

/// What a factor's chi2 may be off by rounding.
constexpr double kRounding = 1e-18;

// How the accuracy that is asked for, a fraction of chi2, is shared out. Found by trying on the
// published graphs: what is left at the end stays well within it.
constexpr double kEnough = 0.2;     ///< of it all: by how much more solving could lower chi2
constexpr double kStepShare = 0.1;  ///< of a factor's: steps that are not followed down the tree
/// So much may be left of the steps since the factors were evaluated, before they are again.
constexpr double kLook = 0.1;
/// A step that has gained so many times what may be left is looked at in any case.
constexpr double kFar = 4.0;
/// What is left is guessed from what was: a share of what the steps have gained, at least …
constexpr double kLeastShare = 5e-3;
constexpr double kOthersShare = 0.01;  ///< … where factors are not of poses alone, …
constexpr double kForget = 0.5;        ///< … and not less than so much of the guess before
/// What can still be gained is at most so many times what steps have fallen short of.
constexpr double kCaution = 6.0;
/// Gradients that promise up to so many times as much say that H is right.
constexpr double kTrusted = 3.0;
/// Where some factors are none of poses alone: while a solution leaves less than this fraction of
/// what it has gained, H does as it is.
constexpr double kFast = 0.2;
/// Jacobians of such factors that are off by more than this part are renewed.
constexpr double kMismatch = 0.05;
/// In graphs of no more factors all are evaluated after each step.
constexpr int kFew = 200;
/// If more than this part of the factors were to be renewed, all are.
constexpr double kMost = 0.2;

const block::Kernels* kernels_named(const std::string& name) {
  const block::Kernels* kernels = block::choose_kernels(name.c_str());
  if (kernels) return kernels;
  throw Error(ErrorCode::usage, "this machine cannot run the kernels '" + name + "'; use auto");
}

}  // namespace

Engine::Engine(const Settings& settings, std::shared_ptr<Rescuer> rescuer)
    : settings_(settings),
      rescuer_(std::move(rescuer)),
      kernels_(kernels_named(settings.kernels)),
      tree_(system_, states_, bound_, *kernels_) {}

Engine::Engine(const Engine& other)
    : settings_(other.settings_),
      rescuer_(other.rescuer_),
      kernels_(other.kernels_),
      graph_(other.graph_.clone()),
      system_(other.system_),
      states_(other.states_),
      models_(other.models_),
      tree_(other.tree_, system_, states_, bound_),
      gauge_(other.gauge_),
      covariances_(other.covariances_),
      held_(other.held_),
      live_variable_(other.live_variable_),
      live_factor_(other.live_factor_),
      factors_of_(other.factors_of_),
      bound_(other.bound_),
      moved_at_(other.moved_at_),
      touched_at_(other.touched_at_),
      touched_(other.touched_),
      sources_(other.sources_),
      steps_(other.steps_),
      moving_(other.moving_),
      retiring_(other.retiring_),
      checked_at_(other.checked_at_),
      check_(other.check_),
      time_(other.time_),
      structure_changed_(other.structure_changed_),
      broken_(other.broken_),
      gauge_is_old_(other.gauge_is_old_),
      dead_(other.dead_),
      live_factors_(other.live_factors_),
      cost_(other.cost_),
      gained_(other.gained_),
      must_look_(other.must_look_),
      others_(other.others_),
      left_share_(other.left_share_),
      decrease_(other.decrease_),
      ids_(other.ids_),
      place_of_id_(other.place_of_id_),
      under_loss_(other.under_loss_),
      is_source_(other.is_source_) {}

// --- what changes ---

/// Starts from a whole graph, at its states.
void Engine::load(Graph graph, std::vector<FactorId> ids) {
  std::vector<std::int32_t> now;
  for (int v = 0; v < graph_.variable_count(); ++v) {
    const auto found = graph.find(graph_.id(v));
    now.push_back(found && live_variable_[v] ? static_cast<std::int32_t>(*found) : -1);
  }
  covariances_.renumber(now);
  graph_ = std::move(graph);
  ids_ = std::move(ids);
  for (std::size_t f = 0; f < ids_.size(); ++f)
    place_of_id_[static_cast<std::size_t>(ids_[f])] = static_cast<std::int32_t>(f);
  system_ = System();
  states_ = States();
  models_.clear();
  tree_ = Tree(system_, states_, bound_, *kernels_);
  gauge_ = GaugeWatch();
  held_.clear();
  live_variable_.clear();
  live_factor_.clear();
  factors_of_.clear();
  bound_.clear();
  moved_at_.clear();
  touched_.clear();
  sources_.clear();
  is_source_.clear();
  steps_.clear();
  moving_.clear();
  retiring_.clear();
  checked_at_.clear();
  broken_ = gauge_is_old_ = false;
  dead_ = live_factors_ = 0;
  cost_ = decrease_ = gained_ = 0.0;
  others_ = 0;
  left_share_ = 1.0;
  touched_at_.clear();
  under_loss_ = under_loss(graph_);
  const int variables = graph_.variable_count(), factors = graph_.factor_count();
  while (states_.size() < variables) added_variable();
  while (models_.size() < factors) added_factor();
  settle_gauge();
}

void Engine::added_variable() {
  const int v = states_.size();
  const VariableType& type = graph_.type(v);
  system_.add_variable(type.tangent_size());
  states_.add(graph_.variable_pools()[graph_.pool(v)].type, graph_.state(v));
  steps_.resize(static_cast<std::size_t>(system_.scalars()), 0.0);
  gauge_.add_variable(type.tangent_size(), type.lie_group() != nullptr, graph_.fixed(v));
  held_.push_back(1);  // until it has a factor
  covariances_.note_variable(v);
  live_variable_.push_back(1);
  factors_of_.emplace_back();
  touched_at_.push_back(time_);
  bound_.push_back(0);
  moved_at_.push_back(-1);
  is_source_.push_back(0);
}

void Engine::added_factor() {
  const int f = models_.size();
  if (f == std::ssize(ids_)) {
    ids_.push_back(next_id());
    place_of_id_.push_back(f);
  }
  const FactorType& type = *graph_.factor_pools()[graph_.factor(f).pool].type;
  models_.add(graph_, f, loss_applies(f));
  live_factor_.push_back(1);
  checked_at_.push_back(-1);
  const auto variables = graph_.factor_variables(f);
  gauge_.add_factor(variables.data(), static_cast<int>(variables.size()), type.absolute_size());
  settle_gauge();
  for (const std::int32_t v : variables) follow(v);
  for (const std::int32_t v : variables) factors_of_[v].push_back(f);
  ++live_factors_;
  models_.linearize(f, graph_, states_);
  cost_ += models_.cost(f);
  put_in(f);
}

void Engine::changed_factor(int f) {
  must_look_ = true;
  relinearize(f);
}

void Engine::remove_factor(int f) {
  for (const std::int32_t v : models_.variables(f)) follow(v);
  take_out(f);
  live_factor_[f] = 0;
  place_of_id_[static_cast<std::size_t>(ids_[f])] = -1;
  cost_ -= models_.cost(f);
  for (const std::int32_t v : models_.variables(f)) std::erase(factors_of_[v], f);
  for (const std::int32_t v : models_.variables(f)) sum_anew(v);
  --live_factors_;
  ++dead_;
  gauge_is_old_ = true;
}

void Engine::remove_variable(int v) {
  live_variable_[v] = 0;
  if (!held_[v]) {
    covariances_.note_variable(v);  // to be eliminated from what its factors have said
    touch(v);
    retiring_.push_back(v);
    held_[v] = 1;
  }
  ++dead_;
}

void Engine::settle_gauge() {
  if (gauge_is_old_) watch_gauge_anew();
  gauge_.settle([&](std::int32_t v, bool held) { hold(v, held); });
}

/// Components may have come apart: whom to hold is found out from what is left.
void Engine::watch_gauge_anew() {
  gauge_is_old_ = false;
  gauge_ = GaugeWatch();
  for (int v = 0; v < states_.size(); ++v) {
    const VariableType& type = graph_.type(v);
    gauge_.add_variable(live_variable_[v] ? type.tangent_size() : 0, type.lie_group() != nullptr,
                        graph_.fixed(v));
  }
  for (int f = 0; f < models_.size(); ++f) {
    if (!live_factor_[f]) continue;
    const auto variables = models_.variables(f);
    gauge_.add_factor(variables.data(), static_cast<int>(variables.size()),
                      graph_.factor_pools()[graph_.factor(f).pool].type->absolute_size());
  }
}

void Engine::hold(std::int32_t v, bool held) {
  if (held && gauge_.anchored(v)) anchored_.push_back(v);
  if (!live_variable_[v] || (held_[v] != 0) == held) return;
  const auto factors = factors_of_[v];
  if (!factors.empty()) covariances_.note_everything();
  for (const std::int32_t f : factors) {
    for (const std::int32_t other : models_.variables(f)) follow(other);
  }
  for (const std::int32_t f : factors) take_out(f);
  if (held) {
    touch(v);
    retiring_.push_back(v);
  } else {
    std::erase(retiring_, v);
  }
  held_[v] = held;
  covariances_.note_variable(v);
  for (const std::int32_t f : factors) put_in(f);
}

void Engine::set_loss(std::shared_ptr<const Loss> loss, LossScope scope) {
  Graph graph = snapshot();
  graph.set_loss(std::move(loss), scope);
  load(std::move(graph), live_ids());
}

bool Engine::loss_applies(int f) const {
  if (!graph_.loss()) return false;
  if (static_cast<std::size_t>(f) < under_loss_.size()) return under_loss_[f];
  const FactorType& type = *graph_.factor_pools()[graph_.factor(f).pool].type;
  if (!type.takes_loss()) return false;
  return graph_.loss_scope() == LossScope::all || under_loss(graph_)[f];
}

void Engine::touch(std::int32_t v) { touched_.push_back(v); }

/// Makes the factor a part of H and g.
void Engine::put_in(int f) {
  const auto variables = models_.variables(f);
  for (std::size_t a = 0; a < variables.size(); ++a) {
    if (held_[variables[a]]) continue;
    touch(variables[a]);
    touched_at_[variables[a]] = time_;
    for (std::size_t b = a + 1; b < variables.size(); ++b) {
      if (!held_[variables[b]]) system_.connect(variables[a], variables[b]);
    }
  }
  models_.add_to(system_, f, 1.0, held_);
  covariances_.note(models_, system_, f, 1.0, held_);
  count_bonds(f, 1);
  structure_changed_ = true;
}

/// Whether a factor is anything but a relative one between variables of a group.
bool Engine::is_other(int f) const {
  return !models_.relative(f) || std::ranges::any_of(models_.variables(f), [&](std::int32_t v) {
    return !states_.type(v).lie_group();
  });
}

/// A factor binds its variables to the world unless it is a relative one between some that move.
void Engine::count_bonds(int f, std::int32_t sign) {
  const auto variables = models_.variables(f);
  bool binds = is_other(f);
  if (binds && variables.size() > 1) others_ += sign;
  for (const std::int32_t v : variables) binds = binds || held_[v];
  if (!binds) return;
  for (const std::int32_t v : variables) bound_[v] += sign;
}

void Engine::take_out(int f) {
  must_look_ = true;
  count_bonds(f, -1);
  covariances_.note(models_, system_, f, -1.0, held_);
  models_.add_to(system_, f, -1.0, held_);
  const auto variables = models_.variables(f);
  for (std::size_t a = 0; a < variables.size(); ++a) {
    if (held_[variables[a]]) continue;
    touch(variables[a]);
    for (std::size_t b = a + 1; b < variables.size(); ++b) {
      if (!held_[variables[b]]) system_.disconnect(variables[a], variables[b]);
    }
  }
  structure_changed_ = true;
}

/// A variable's part of H from its factors, without what subtracting has left of rounding.
void Engine::sum_anew(std::int32_t v) {
  if (held_[v]) return;
  const std::int32_t size = system_.size(v);
  std::fill_n(system_.diagonal(v), size * size, 0.0);
  for (const System::Link& link : system_.links(v))
    std::fill_n(system_.block(link.entry), size * system_.size(link.other), 0.0);
  for (const std::int32_t f : factors_of_[v]) models_.add_row(system_, f, v, held_);
}

void Engine::relinearize(int f) {
  for (const std::int32_t v : models_.variables(f)) follow(v);
  covariances_.note(models_, system_, f, -1.0, held_);
  models_.add_to(system_, f, -1.0, held_);
  cost_ -= models_.cost(f);
  models_.linearize(f, graph_, states_);
  cost_ += models_.cost(f);
  models_.add_to(system_, f, 1.0, held_);
  covariances_.note(models_, system_, f, 1.0, held_);
  for (const std::int32_t v : models_.variables(f)) {
    if (!held_[v]) touch(v);
  }
}

/// Whoever changes the factors of a variable must have followed first.
void Engine::follow(std::int32_t v) {
  tree_.follow(v, steps_, changed_);
  if (!changed_.empty()) apply_steps();
}

/// Moves the estimate and the models by the steps of `changed_`.
void Engine::apply_steps() {
  ++check_;
  for (const std::int32_t v : changed_) {
    if (!held_[v]) states_.move(v, steps_.data() + system_.offset(v));
    moved_at_[v] = check_;
  }
  for (const std::int32_t v : changed_) {
    for (const std::int32_t f : factors_of_[v]) {
      if (checked_at_[f] == check_) continue;
      checked_at_[f] = check_;
      move_model(f);
    }
  }
  for (const std::int32_t v : changed_)
    std::fill_n(steps_.data() + system_.offset(v), system_.size(v), 0.0);
  changed_.clear();
}

/// A variable of the factor whose step was not computed is below a node that the pass ended at: its
/// model moves by what arrived there.
void Engine::move_model(int f) {
  const auto variables = models_.variables(f);
  const Node* end = nullptr;
  for (const std::int32_t v : variables) {
    if (moved_at_[v] != check_ && !held_[v]) end = tree_.end_of_pass(v);
  }
  factor_steps_.clear();
  for (const std::int32_t v : variables) {
    const double* step = nullptr;
    if (moved_at_[v] == check_) step = steps_.data() + system_.offset(v);
    if (step && end) {
      if (const double* arrived = tree_.arrived(*end, v)) step = arrived;
    }
    factor_steps_.push_back(step);
  }
  if (models_.move(f, factor_steps_.data())) moving_.push_back(f);
}

// --- solving ---

void Engine::solve(double max_seconds, UpdateReport& report) {
  const Clock::time_point begin = Clock::now();
  settle_gauge();
  ++time_;
  limit_ = max_seconds;
  states_.remember();
  if (broken_) return rescue(report, 1e-6);
  if (must_look_) bring_back();
  bool again = !touched_.empty() || !sources_.empty();
  for (int round = 0; again; ++round) {
    const Clock::time_point round_begin = Clock::now();
    const double before = cost();
    if (!bring_factor_up_to_date(report)) {
      step_back();
      return rescue(report, 1e-6);
    }
    if (round == 0 && negligible()) break;
    take_step(share(kStepShare), report);
    ++report.iterations;
    if (!check(round > 0, report)) return;
    // Negated, so that what is not a number is bad too.
    if (!(cost_ <= 2.0 * before + kRounding * live_factors_)) {
      step_back();
      return rescue(report, 1e-6);
    }
    // The next round may have to factorise more than this one had.
    const bool in_time =
        max_seconds <= 0.0 || seconds_since(begin) + 2.0 * seconds_since(round_begin) < max_seconds;
    again = improve(in_time && report.iterations < settings_.iterations, report);
  }
}

/// Whether what has not been solved for yet would lower chi2 by nothing that matters.
bool Engine::negligible() {
  set_right_hand_side();
  const double gain = tree_.decrement(sources_, system_.g());
  return gain <= std::min(settings_.significance, kEnough * settings_.accuracy * cost());
}

/// A share of the accuracy that is asked for, of the mean cost of a factor.
double Engine::share(double part) const {
  return part * settings_.accuracy * cost() / std::max(live_factors_, 1);
}

/// The estimate from before this update.
void Engine::step_back() {
  states_.undo(
      [&](std::int32_t node, std::span<const double> lead) { tree_.undo_lead(node, lead); });
}

/// Starts anew at the current estimate with an optimizer that never raises chi2.
void Engine::rescue(UpdateReport& report, double tolerance) {
  {
    const Timed timed(report.seconds.linearize);
    write_back();
    Graph graph = clean_graph();
    const std::lock_guard lock(rescuer_->mutex);
    const Summary summary =
        rescuer_->optimizer->optimize(graph, {.max_iterations = 100, .tolerance = tolerance});
    report.iterations += static_cast<int>(summary.iterations.size());
    load(std::move(graph), live_ids());
  }
  broken_ = !bring_factor_up_to_date(report);
  report.ok = !broken_;
  if (broken_) return;
  take_step(0.0, report);
  check(true, report);
}

void Engine::add_source(std::int32_t v) {
  if (held_[v] || is_source_[v]) return;
  is_source_[v] = 1;
  sources_.push_back(v);
}

/// The factor of H as it is now. False if H is not positive definite.
bool Engine::bring_factor_up_to_date(UpdateReport& report) {
  {
    const Timed timed(report.seconds.order);
    tree_.clear_affected();
    if (structure_changed_ && tree_.worn_out() &&
        (limit_ <= 0.0 || tree_.seconds_to_order_anew() < limit_)) {
      touch_all();
    }
    for (const std::int32_t v : touched_) {
      if (!held_[v] || tree_.node_of(v) >= 0) tree_.touch(v);
    }
    for (const std::int32_t v : retiring_) tree_.retire(v);
    if (structure_changed_) {
      tree_.restructure(touched_at_, time_ - settings_.recent);
      states_.remember();  // nodes keep their numbers from here on
    }
    retiring_.clear();
    structure_changed_ = false;
    report.affected_variables += tree_.affected_variables();
    for (const std::int32_t v : touched_) add_source(v);
    touched_.clear();
  }
  const Timed timed(report.seconds.factorize);
  return tree_.factorize() < 0;
}

/// Where something is taken out, what was little may have become much.
void Engine::bring_back() {
  for (int v = 0; v < states_.size(); ++v) {
    if (held_[v] || tree_.node_of(v) < 0 || !system_.has_set_aside(v)) continue;
    system_.sum(v);
    add_source(v);
  }
}

void Engine::set_right_hand_side() {
  for (const std::int32_t v : sources_) {
    tree_.settle(v);
    models_.right_hand_side(system_, states_, v);
  }
}

void Engine::touch_all() {
  for (int v = 0; v < states_.size(); ++v) {
    if (!live_variable_[v] || held_[v]) continue;
    follow(v);
    touch(v);
  }
}

void Engine::take_step(double tolerance, UpdateReport& report) {
  const Timed timed(report.seconds.solve);
  set_right_hand_side();
  for (const std::int32_t v : sources_) system_.settle(v, false);
  decrease_ = tree_.solve(sources_, tolerance, system_.g(), steps_, changed_);
  gained_ += decrease_;
  for (const std::int32_t v : sources_) is_source_[v] = 0;
  sources_.clear();
}

/// Moves to the solution, and if what is known of the factors may be wrong by too much then,
/// evaluates all that have moved: few of them alone would say nothing of the rest. Whether it has.
bool Engine::check(bool anyway, UpdateReport& report) {
  const Timed timed(report.seconds.check);
  apply_steps();
  const double allowed = settings_.accuracy * cost();
  anyway = std::exchange(must_look_, false) || live_factors_ <= kFew || anyway;
  if (!anyway && left_share_ * gained_ <= kLook * allowed && decrease_ <= kFar * allowed)
    return false;
  const double expected = cost();
  looked_at_ = std::exchange(gained_, 0.0);
  looked_.swap(moving_);
  moving_.clear();
  double square = 0.0;
  int compared = 0;
  for (const std::int32_t f : looked_) {
    if (!live_factor_[f]) continue;
    for (const std::int32_t v : models_.variables(f)) tree_.settle(v);
    cost_ -= models_.cost(f);
    models_.correct(f, graph_, states_, system_, held_);
    cost_ += models_.cost(f);
    for (const std::int32_t v : models_.variables(f)) add_source(v);
    if (others_ > 0 && is_other(f)) {
      const double mismatch = models_.mismatch(f, states_);
      square += mismatch * mismatch;
      ++compared;
    }
  }
  mismatch_ = compared > 0 ? std::sqrt(square / compared) : 0.0;
  shortfall_ = cost_ - expected;
  return true;
}

/// Whether to solve once more: whether that would lower chi2 noticeably.
///
/// The gradients that are left would gain gᵀH⁻¹g if H were right, and for poses alone, as a rule,
/// not much more than what chi2 has fallen short of (see docs/online.md). If both agree, H does as
/// it is; if the former is much larger, H is not that of the current estimate, and what has moved
/// is relinearised.
bool Engine::improve(bool enough_time, UpdateReport& report) {
  const double allowed = settings_.accuracy * cost_ + kRounding * live_factors_;
  report.owed = 0;
  double left = 0.0;
  {
    const Timed timed(report.seconds.solve);
    set_right_hand_side();
    left = tree_.decrement(sources_, system_.g());
  }
  const bool poses_alone = others_ == 0 && live_factors_ > kFew;
  const double likely = poses_alone ? std::min(left, kCaution * std::abs(shortfall_)) : left;
  left_share_ = std::max(kForget * left_share_, poses_alone ? kLeastShare : kOthersShare);
  if (looked_at_ > 0.0) left_share_ = std::clamp(likely / looked_at_, left_share_, 1.0);
  const bool right =
      poses_alone ? left <= std::min(kTrusted * likely, looked_at_) : left <= kFast * looked_at_;
  if (likely <= kEnough * allowed && mismatch_ <= kMismatch) {
    set_aside();
    return false;
  }
  if (!enough_time) {
    report.owed = static_cast<int>(looked_.size());
    return false;
  }
  if (right && mismatch_ <= kMismatch) return true;
  const Timed timed(report.seconds.linearize);
  if (report.iterations >= 2 || static_cast<double>(looked_.size()) > kMost * live_factors_) {
    relinearize_all();
    report.relinearized_factors += live_factors_;
    return true;
  }
  for (const std::int32_t f : looked_) {
    if (!live_factor_[f]) continue;
    relinearize(f);
    ++report.relinearized_factors;
  }
  return true;
}

/// Leaves the gradients at hand alone until the factors are evaluated again: with an old H, what
/// little they have to tell might do more harm than good.
void Engine::set_aside() {
  set_right_hand_side();
  for (const std::int32_t v : sources_) {
    system_.settle(v, true);
    std::fill_n(system_.g(v), system_.size(v), 0.0);
    is_source_[v] = 0;
  }
  sources_.clear();
}

/// Everything at the current estimate: H and g are summed anew, without the rounding of updates.
void Engine::relinearize_all() {
  covariances_.note_everything();
  touch_all();
  moving_.clear();
  for (const std::int32_t v : sources_) is_source_[v] = 0;
  sources_.clear();
  system_.clear_values();
  cost_ = gained_ = 0.0;
  for (int v = 0; v < states_.size(); ++v) states_.put_frame_here(v);
  for (int f = 0; f < models_.size(); ++f) {
    if (!live_factor_[f]) continue;
    models_.linearize(f, graph_, states_);
    cost_ += models_.cost(f);
    models_.add_to(system_, f, 1.0, held_);
  }
}

std::vector<FactorId> Engine::live_ids() const {
  std::vector<FactorId> ids;
  for (std::size_t f = 0; f < ids_.size(); ++f) {
    if (live_factor_[f]) ids.push_back(ids_[f]);
  }
  return ids;
}

void Engine::compact() {
  if (dead_ == 0) return;
  Graph graph = snapshot();
  load(std::move(graph), live_ids());
}

/// Without what has been removed.
Graph Engine::clean_graph() {
  Graph graph = graph_.clone();
  if (dead_ == 0) return graph;
  std::vector<bool> factors(live_factor_.size()), variables(live_variable_.size());
  for (std::size_t f = 0; f < factors.size(); ++f) factors[f] = !live_factor_[f];
  for (std::size_t v = 0; v < variables.size(); ++v) variables[v] = !live_variable_[v];
  graph.remove(factors, variables);
  return graph;
}

void Engine::solve_fully(UpdateReport& report) {
  settle_gauge();
  ++time_;
  limit_ = 0.0;
  states_.remember();
  if (broken_) return rescue(report, 1e-12);
  structure_changed_ = true;
  for (int round = 0; round < 50; ++round) {
    {
      const Timed timed(report.seconds.linearize);
      relinearize_all();
      report.relinearized_factors += live_factors_;
    }
    const double before = cost_;
    const bool ok = bring_factor_up_to_date(report);
    if (ok) {
      take_step(0.0, report);
      ++report.iterations;
      check(true, report);
    }
    if (!ok || !(cost_ <= 1.01 * before + kRounding * live_factors_)) {
      step_back();
      return rescue(report, 1e-12);
    }
    if (decrease_ <= 1e-12 * cost_ + kRounding * live_factors_) return;
  }
}

double Engine::chi2() {
  tree_.settle_all();
  double sum = 0.0;
  for (int f = 0; f < models_.size(); ++f) {
    if (live_factor_[f]) sum += models_.cost_now(f, graph_, states_);
  }
  return sum;
}

void Engine::write_back() {
  tree_.settle_all();
  Values values = graph_.values();
  for (int v = 0; v < states_.size(); ++v) {
    const std::int32_t ambient = states_.ambient(v);
    std::copy_n(states_.x(v), ambient,
                values.pools[graph_.pool(v)].begin() + std::ptrdiff_t{graph_.slot(v)} * ambient);
  }
  graph_.set_values(std::move(values));
}

Graph Engine::snapshot() {
  write_back();
  return clean_graph();
}

/// Σ_ab in the variables' frames becomes T_a Σ_ab T_bᵀ: as seen from the poses.
void Engine::as_seen_from(int a, int b, double* block, std::int64_t stride) {
  const std::int32_t rows = system_.size(a), columns = system_.size(b);
  using Block = Eigen::Map<Eigen::MatrixXd, 0, Eigen::OuterStride<>>;
  Block sigma(block, rows, columns, Eigen::OuterStride<>(stride));
  const auto turn = [&](int v, std::int32_t size) {
    return Eigen::Map<const Eigen::MatrixXd>(states_.frame_to_body(v), size, size);
  };
  tree_.settle(a);
  tree_.settle(b);
  if (states_.away(a)) sigma = (turn(a, rows) * sigma).eval();
  if (states_.away(b)) sigma = (sigma * turn(b, columns).transpose()).eval();
}

bool Engine::covariance(int a, int b, double* block) {
  const std::int32_t rows = system_.size(a), columns = system_.size(b);
  if (const double* kept = covariances_.kept(a, b); kept && !broken_) {
    std::copy_n(kept, rows * columns, block);
    as_seen_from(a, b, block, rows);
    return true;
  }
  const std::int32_t row = a;
  return covariance_column({&row, 1}, b, block);
}

bool Engine::covariance_column(std::span<const std::int32_t> rows, int b, double* column) {
  std::int64_t height = 0;
  for (const std::int32_t v : rows) height += system_.size(v);
  const std::int32_t columns = system_.size(b);
  std::fill_n(column, height * columns, 0.0);
  if (held_[b]) return true;
  if (broken_ || tree_.node_of(b) < 0) return false;
  AlignedVector X(static_cast<std::size_t>(system_.scalars()) * 8);
  const std::int32_t source = b;
  for (std::int32_t first = 0; first < columns; first += 8) {
    const std::int32_t width = std::min(8, columns - first);
    std::ranges::fill(X, 0.0);
    for (std::int32_t k = 0; k < width; ++k)
      X[static_cast<std::size_t>(system_.offset(b) + first + k) * 8 + k] = 1.0;
    if (rows.size() == 1) {
      const std::int32_t both[2] = {source, rows[0]};
      tree_.solve_many_above(held_[rows[0]] ? std::span(both, 1) : std::span(both), X);
    } else {
      tree_.solve_many({&source, 1}, X);
    }
    double* out = column + std::int64_t{first} * height;
    for (std::int32_t k = 0; k < width; ++k) {
      for (const std::int32_t v : rows) {
        for (std::int32_t r = 0; r < system_.size(v); ++r)
          *out++ = held_[v] ? 0.0 : X[static_cast<std::size_t>(system_.offset(v) + r) * 8 + k];
      }
    }
  }
  std::int64_t row = 0;
  for (const std::int32_t v : rows) {
    if (!held_[v]) as_seen_from(v, b, column + row, height);
    row += system_.size(v);
  }
  return true;
}

}  // namespace cairn::incremental
