// SPDX-License-Identifier: BSD-3-Clause
#include "models.hpp"

#include <algorithm>
#include <cmath>
#include <type_traits>
#include <utility>

#include "add_product.hpp"
#include "cairn/graph/packed.hpp"
#include "cairn/types/factor_call.hpp"

namespace cairn::incremental {
namespace {

/// out += sign · Aᵀ B; A rows × a, B rows × b, out a × b, all column-major. Sizes that the compiler
/// knows unroll the loops.
template <int Rows, class SizeA, class SizeB>
void add_transposed_product(SizeA a, SizeB b, const double* A, const double* B, double sign,
                            double* out) {
  for (int j = 0; j < b; ++j) {
    double column[Rows];
    for (int r = 0; r < Rows; ++r) column[r] = sign * B[j * Rows + r];
    for (int i = 0; i < a; ++i) {
      double sum = 0.0;
      for (int r = 0; r < Rows; ++r) sum += A[i * Rows + r] * column[r];
      *out++ += sum;
    }
  }
}
template <int Rows>
void add_transposed_product(const double* A, int a, const double* B, int b, double sign,
                            double* out) {
  // The factors of poses have as many rows as a pose has coordinates.
  constexpr std::integral_constant<int, Rows> kRows;
  constexpr std::integral_constant<int, 1> kOne;
  if (a == Rows && b == Rows)
    add_transposed_product<Rows>(kRows, kRows, A, B, sign, out);
  else if (a == Rows && b == 1)
    add_transposed_product<Rows>(kRows, kOne, A, B, sign, out);
  else
    add_transposed_product<Rows>(a, b, A, B, sign, out);
}
void add_transposed_product(int rows, const double* A, int a, const double* B, int b, double sign,
                            double* out) {
  switch (rows) {
    case 2:
      return add_transposed_product<2>(A, a, B, b, sign, out);
    case 3:
      return add_transposed_product<3>(A, a, B, b, sign, out);
    case 6:
      return add_transposed_product<6>(A, a, B, b, sign, out);
    default:
      for (int j = 0; j < b; ++j) {
        for (int i = 0; i < a; ++i) {
          double sum = 0.0;
          for (int r = 0; r < rows; ++r) sum += A[i * rows + r] * B[j * rows + r];
          *out++ += sign * sum;
        }
      }
  }
}

/// The sum of J_k (now_k − start_k) over the two variables of a factor, which starts from now then.
template <int Size>
void take_steps(const double* J, const double* const* now, double* start, double* change) {
  std::fill_n(change, Size, 0.0);
  for (int k = 0; k < 2; ++k) {
    for (int i = 0; i < Size; ++i) {
      const double step = now[k][i] - *start;
      *start++ = now[k][i];
      for (int r = 0; r < Size; ++r) change[r] += J[r] * step;
      J += Size;
    }
  }
}

}  // namespace

void Models::add(const Graph& graph, int position) {
  const FactorRef ref = graph.ref(position);
  const FactorType& type = *graph.factor_pools()[ref.pool].type;
  Record record{.place = 0,
                .variables = static_cast<std::int32_t>(variables_.size()),
                .pool = ref.pool,
                .entry = ref.entry,
                .arity = static_cast<std::int16_t>(type.arity()),
                .rows = static_cast<std::int16_t>(type.residual_size()),
                .scalars = 0,
                .relative = type.is_relative()};
  for (int k = 0; k < record.arity; ++k) {
    tangents_.push_back(static_cast<std::int16_t>(type.tangent_size(k)));
    record.scalars = static_cast<std::int16_t>(record.scalars + type.tangent_size(k));
  }
  const auto factor_variables = graph.factor_variables(position);
  variables_.insert(variables_.end(), factor_variables.begin(), factor_variables.end());
  record.of_poses = record.arity == 2 && type.tangent_size(0) == record.rows &&
                    type.tangent_size(1) == record.rows;
  const auto rows = static_cast<std::size_t>(record.rows);
  const auto scalars = static_cast<std::size_t>(record.scalars);
  record.place = values_.take(rows * scalars + 2 * scalars);
  records_.push_back(record);
}

/// J of its k-th variable.
const double* Models::block(const Record& record, int k) const {
  const double* J = values_.at(record.place);
  for (int before = 0; before < k; ++before) J += record.rows * size_of(record, before);
  return J;
}

/// The whitened residual and, unless J is null, the Jacobian at an estimate, both weighted by √ρ′.
/// Returns ρ(‖r‖²).
double Models::evaluate(const Record& record, const Graph& graph, const Estimate& estimate,
                        double* r, double* J) const {
  if (!answers_) return ask(record, graph, estimate, r, J);
  const auto rows = static_cast<std::size_t>(record.rows);
  const std::size_t numbers = J ? rows * static_cast<std::size_t>(record.scalars) : 0;
  double rho = 0.0;
  answers_->write({{r, rows}, {J, numbers}, {&rho, 1}},
                  [&] { rho = ask(record, graph, estimate, r, J); });
  return rho;
}

double Models::ask(const Record& record, const Graph& graph, const Estimate& estimate, double* r,
                   double* J) const {
  const FactorPool& pool = graph.factor_pools()[record.pool];
  const FactorType& type = *pool.type;
  points_.clear();
  pointers_.clear();
  double* next = J;
  for (int k = 0; k < record.arity; ++k) {
    points_.push_back(estimate.x(variables_[record.variables + k]));
    pointers_.push_back(next);
    if (J) next += record.rows * size_of(record, k);
  }
  const std::size_t packed = packed_size(record.rows);
  const std::size_t entry = static_cast<std::size_t>(record.entry);
  call_factor(
      type, [&] { return graph.describe_factor(pool.sequence[entry]); },
      [&] {
        type.evaluate(
            points_.data(),
            pool.measurements.data() + entry * static_cast<std::size_t>(type.measurement_size()),
            pool.sqrt_information.data() + static_cast<std::size_t>(pool.noises[entry]) * packed, r,
            J ? pointers_.data() : nullptr);
      });
  double s = 0.0;
  for (int k = 0; k < record.rows; ++k) s += r[k] * r[k];
  if (!graph.has_losses() || !graph.any_loss(record.pool, entry, entry + 1)) return s;
  double rho = 0.0, weight = 1.0;
  graph.weigh(record.pool, entry, {&s, 1}, {&rho, 1}, {&weight, 1});
  const double root = std::sqrt(weight);
  for (int k = 0; k < record.rows; ++k) r[k] *= root;
  if (J) {
    for (int k = 0; k < record.rows * record.scalars; ++k) J[k] *= root;
  }
  return rho;
}

/// J_k ← J_k T_k: from steps as seen from the poses to steps in the variables' frames.
void Models::into_frames(const Record& record, const States& states, double* J) const {
  const int rows = record.rows;
  for (int k = 0; k < record.arity; ++k) {
    const std::int32_t v = variables_[record.variables + k];
    const int size = size_of(record, k);
    if (states.away(v)) {
      const double* T = states.frame_to_body(v);
      turned_.assign(static_cast<std::size_t>(rows) * static_cast<std::size_t>(size), 0.0);
      for (int c = 0; c < size; ++c)
        add_product(rows, J, size, T + c * size, turned_.data() + c * rows);
      std::ranges::copy(turned_, J);
    }
    J += rows * size;
  }
}

void Models::linearize(int f, const Graph& graph, const States& states) {
  Record& record = records_[f];
  const int rows = record.rows;
  double* const J = values_.at(record.place);
  double* const gradient = J + rows * record.scalars + record.scalars;
  scratch_.resize(static_cast<std::size_t>(rows));
  record.cost = evaluate(record, graph, states.estimate(), scratch_.data(), J);
  std::fill_n(gradient, record.scalars, 0.0);
  add_transposed_product(rows, J, record.scalars, scratch_.data(), 1, 1.0, gradient);
  into_frames(record, states, J);
  start_here(record, states);
}

double Models::cost_now(int f, const Graph& graph, const Estimate& estimate) const {
  scratch_.resize(static_cast<std::size_t>(records_[f].rows));
  return evaluate(records_[f], graph, estimate, scratch_.data(), nullptr);
}

/// Its part of the block that joins its variables ka and kb.
void Models::add_block(System& system, const Record& record, int ka, int kb, double sign) const {
  const std::int32_t* v = variables_.data() + record.variables;
  const std::int32_t a = v[ka], b = v[kb];
  const double *Ja = block(record, ka), *Jb = block(record, kb);
  double* target = system.block(system.find(a, b));
  if (a < b) {
    add_transposed_product(record.rows, Ja, system.size(a), Jb, system.size(b), sign, target);
  } else {
    add_transposed_product(record.rows, Jb, system.size(b), Ja, system.size(a), sign, target);
  }
}

void Models::add_to(System& system, const States& states, int f, double sign,
                    std::span<const std::uint8_t> held) const {
  const Record& record = records_[f];
  const int rows = record.rows;
  const std::int32_t* v = variables_.data() + record.variables;
  const double* J = values_.at(record.place);
  const double* gradient = J + rows * record.scalars + record.scalars;
  const double* const change = has_moved(record, states) ? this->change(f, states) : nullptr;
  for (int ka = 0; ka < record.arity; ++ka) {
    const std::int32_t a = v[ka], size = system.size(a);
    if (!held[a]) {
      add_transposed_product(rows, J, size, J, size, sign, system.diagonal(a));
      if (change) add_transposed_product(rows, J, size, change, 1, sign, system.change(a));
      for (int i = 0; i < size; ++i) {
        system.gradient(a)[i] += sign * gradient[i];
        system.pending(a)[i] += gradient[i];
      }
      if (sign < 0.0) system.count_all(a);
      for (int kb = ka + 1; kb < record.arity; ++kb) {
        if (!held[v[kb]]) add_block(system, record, ka, kb, sign);
      }
    }
    J += rows * size;
    gradient += size;
  }
}

void Models::add_row(System& system, int f, std::int32_t variable,
                     std::span<const std::uint8_t> held) const {
  const Record& record = records_[f];
  const std::int32_t* v = variables_.data() + record.variables;
  for (int ka = 0; ka < record.arity; ++ka) {
    if (v[ka] != variable) continue;
    const double* J = block(record, ka);
    const std::int32_t size = system.size(variable);
    add_transposed_product(record.rows, J, size, J, size, 1.0, system.diagonal(variable));
    for (int kb = 0; kb < record.arity; ++kb) {
      if (kb != ka && !held[v[kb]]) add_block(system, record, ka, kb, 1.0);
    }
  }
}

void Models::move(int f, std::int32_t variable, const double* step) {
  const Record& record = records_[f];
  double* start = values_.at(record.place) + record.rows * record.scalars;
  for (int k = 0; k < record.arity; start += size_of(record, k++)) {
    if (variables_[record.variables + k] != variable) continue;
    for (int i = 0; i < size_of(record, k); ++i) start[i] -= step[i];
  }
}

/// The variables have travelled so far.
void Models::start_here(const Record& record, const States& states) {
  double* start = values_.at(record.place) + record.rows * record.scalars;
  for (int k = 0; k < record.arity; ++k) {
    start =
        std::copy_n(states.travelled(variables_[record.variables + k]), size_of(record, k), start);
  }
}

/// Whether any of its variables has moved, in its frame, since it was last evaluated.
bool Models::has_moved(const Record& record, const States& states) const {
  const double* start = values_.at(record.place) + record.rows * record.scalars;
  for (int k = 0; k < record.arity; start += size_of(record, k++)) {
    const double* now = states.travelled(variables_[record.variables + k]);
    if (!std::equal(now, now + size_of(record, k), start)) return true;
  }
  return false;
}

const double* Models::change(int f, const States& states) const {
  const Record& record = records_[f];
  const double* J = values_.at(record.place);
  const double* start = J + record.rows * record.scalars;
  step_.resize(static_cast<std::size_t>(record.scalars));
  double* next = step_.data();
  for (int k = 0; k < record.arity; ++k) {
    const double* now = states.travelled(variables_[record.variables + k]);
    for (int i = 0; i < size_of(record, k); ++i) *next++ = *now++ - *start++;
  }
  change_.assign(static_cast<std::size_t>(record.rows), 0.0);
  add_product(record.rows, J, record.scalars, step_.data(), change_.data());
  return change_.data();
}

/// `gathered_`: these factors at the estimate.
void Models::gather(std::span<const std::int32_t> factors, const Graph& graph,
                    const Estimate& estimate) {
  const Record& one = records_[factors.front()];
  const FactorPool& pool = graph.factor_pools()[one.pool];
  const std::size_t arity = static_cast<std::size_t>(one.arity),
                    measured = static_cast<std::size_t>(pool.type->measurement_size());
  Gathered& all = gathered_;
  all.slots.resize(factors.size() * arity);
  all.measurements.resize(factors.size() * measured);
  all.noises.resize(factors.size());
  all.states.resize(arity);
  for (std::size_t k = 0; k < arity; ++k)
    all.states[k].resize(factors.size() *
                         static_cast<std::size_t>(pool.type->ambient_size(static_cast<int>(k))));
  for (std::size_t i = 0; i < factors.size(); ++i) {
    const Record& record = records_[factors[i]];
    const std::size_t entry = static_cast<std::size_t>(record.entry);
    std::copy_n(pool.measurements.data() + entry * measured, measured,
                all.measurements.data() + i * measured);
    all.noises[i] = pool.noises[entry];
    std::fill_n(all.slots.data() + i * arity, arity, static_cast<std::int32_t>(i));
  }
  for (std::size_t k = 0; k < arity; ++k) {
    const int ambient = pool.type->ambient_size(static_cast<int>(k));
    double* to = all.states[k].data();
    for (const std::int32_t f : factors) {
      const std::int32_t v = variables_[records_[f].variables + static_cast<std::int32_t>(k)];
      to = std::copy_n(estimate.x(v), ambient, to);
    }
  }
  all.state_arrays.clear();
  for (const std::vector<double>& states : all.states) all.state_arrays.push_back(states.data());
}

void Models::correct(std::span<const std::int32_t> factors, const Graph& graph,
                     const States& states, System& system, std::span<const std::uint8_t> held) {
  if (factors.empty()) return;
  gather(factors, graph, states.estimate());
  const Record& one = records_[factors.front()];
  const std::size_t count = factors.size();
  const bool weighs = graph.has_losses() && graph.factor_pools()[one.pool].type->takes_loss();
  Gathered& all = gathered_;
  all.norms.resize(count);
  all.costs.resize(count);
  all.gradients.resize(count * static_cast<std::size_t>(one.scalars));
  if (answers_) {
    answers_->write({all.norms, all.costs, all.gradients}, [&] { ask(factors, graph, weighs); });
  } else {
    ask(factors, graph, weighs);
  }
  const double* now = all.gradients.data();
  for (std::size_t i = 0; i < count; ++i) {
    Record& record = records_[factors[i]];
    record.cost = weighs ? all.costs[i] : all.norms[i];
    if (one.of_poses && one.rows == 3)
      replace_gradient_of_pair<3>(record, now, states, system, held);
    else if (one.of_poses && one.rows == 6)
      replace_gradient_of_pair<6>(record, now, states, system, held);
    else
      replace_gradient(factors[i], now, states, system, held);
    now += one.scalars;
  }
}

/// Evaluates the factors that `gathered_` has: norms, costs where one is weighed, and gradients.
void Models::ask(std::span<const std::int32_t> factors, const Graph& graph, bool weighs) {
  const Record& one = records_[factors.front()];
  const FactorPool& pool = graph.factor_pools()[one.pool];
  const int position = pool.sequence[static_cast<std::size_t>(one.entry)];
  if (factors.size() == 1) {
    call_factor(
        *pool.type, [&] { return graph.describe_factor(position); },
        [&] { ask_gathered(factors, graph, weighs); });
  } else {
    call_factor(*pool.type, [&] { ask_gathered(factors, graph, weighs); });
  }
}

void Models::ask_gathered(std::span<const std::int32_t> factors, const Graph& graph, bool weighs) {
  const Record& one = records_[factors.front()];
  const FactorPool& pool = graph.factor_pools()[one.pool];
  const FactorType& type = *pool.type;
  const std::size_t count = factors.size(), arity = static_cast<std::size_t>(one.arity);
  Gathered& all = gathered_;
  const FactorView view{.size = count,
                        .slots = all.slots.data(),
                        .measurements = all.measurements.data(),
                        .sqrt_information = pool.sqrt_information.data(),
                        .noises = all.noises.data(),
                        .states = all.state_arrays.data()};
  all.weights.clear();
  if (weighs) {
    type.squared_norms(view, 0, count, all.norms.data());
    for (std::size_t i = 0; i < count; ++i) {
      double& weight = all.weights.emplace_back(1.0);
      graph.weigh(one.pool, static_cast<std::size_t>(records_[factors[i]].entry),
                  {&all.norms[i], 1}, {&all.costs[i], 1}, {&weight, 1});
    }
  }
  all.blocks.resize(count * arity * (arity + 1) / 2);  // nowhere
  all.gradient_targets.clear();
  std::int64_t place = 0;
  for (std::size_t i = 0; i < count; ++i) {
    for (int k = 0; k < one.arity; ++k) {
      all.gradient_targets.emplace_back(LinearizeTarget::Array::gradient, place,
                                        LinearizeTarget::How::write);
      place += size_of(one, k);
    }
  }
  const LinearizeSink sink{.arrays = {nullptr, all.gradients.data(), nullptr},
                           .blocks = all.blocks.data(),
                           .gradients = all.gradient_targets.data()};
  type.linearize(view, 0, count, all.weights.empty() ? nullptr : all.weights.data(), sink,
                 all.norms.data());
}

/// As `replace_gradient`, for a factor of two variables with as many coordinates as it has rows.
template <int Size>
void Models::replace_gradient_of_pair(const Record& record, const double* now, const States& states,
                                      System& system, std::span<const std::uint8_t> held) {
  const std::int32_t* v = variables_.data() + record.variables;
  double* const numbers = values_.at(record.place);
  const double* J = numbers;
  double* gradient = numbers + 2 * Size * (Size + 1);
  const double* const travelled[] = {states.travelled(v[0]), states.travelled(v[1])};
  double change[Size];
  take_steps<Size>(J, travelled, numbers + 2 * Size * Size, change);
  for (int k = 0; k < 2; ++k, J += Size * Size, gradient += Size, now += Size) {
    if (!held[v[k]]) {
      system.count_all(v[k]);
      double* const changed = system.change(v[k]);
      double* const sum = system.gradient(v[k]);
      for (int i = 0; i < Size; ++i) {
        double by = 0.0;
        for (int r = 0; r < Size; ++r) by += J[i * Size + r] * change[r];
        changed[i] -= by;
        sum[i] += -now[i] - gradient[i];
      }
    }
    for (int i = 0; i < Size; ++i) gradient[i] = -now[i];
  }
}

/// The gradient of a factor, of which `now` is the negative, is that at the current estimate.
void Models::replace_gradient(int f, const double* now, const States& states, System& system,
                              std::span<const std::uint8_t> held) {
  const Record& record = records_[f];
  const int rows = record.rows;
  const double* J = values_.at(record.place);
  double* gradient = values_.at(record.place) + rows * record.scalars + record.scalars;
  const double* const change = this->change(f, states);
  start_here(record, states);
  for (int k = 0; k < record.arity; ++k) {
    const std::int32_t v = variables_[record.variables + k], size = system.size(v);
    if (!held[v]) {
      system.count_all(v);
      add_transposed_product(rows, J, size, change, 1, -1.0, system.change(v));
      for (int i = 0; i < size; ++i) system.gradient(v)[i] += -now[i] - gradient[i];
    }
    for (int i = 0; i < size; ++i) gradient[i] = -now[i];
    J += rows * size;
    now += size;
    gradient += size;
  }
}

double Models::mismatch(int f, const Graph& graph, const States& states) const {
  const Record& record = records_[f];
  const int rows = record.rows, doubles = rows * record.scalars;
  scratch_.resize(static_cast<std::size_t>(doubles) + static_cast<std::size_t>(rows));
  double* const J_now = scratch_.data();
  evaluate(record, graph, states.estimate(), J_now + doubles, J_now);
  into_frames(record, states, J_now);
  const double* const J = values_.at(record.place);
  double difference = 0.0, norm = 0.0;
  for (int k = 0; k < doubles; ++k) {
    difference += (J_now[k] - J[k]) * (J_now[k] - J[k]);
    norm += J[k] * J[k];
  }
  return norm > 0.0 ? std::sqrt(difference / norm) : 0.0;
}

/// out += T_vᵀ γ: a gradient as seen from the variable, in its frame.
void Models::add_in_frame(const States& states, std::int32_t v, int size, const double* gradient,
                          double* out) const {
  if (states.away(v)) {
    add_transposed_product(size, states.frame_to_body(v), size, gradient, 1, 1.0, out);
  } else {
    for (int i = 0; i < size; ++i) out[i] += gradient[i];
  }
}

void Models::right_hand_side(System& system, const States& states, std::int32_t v) const {
  const std::int32_t size = system.size(v);
  double* const g = system.g(v);
  if (system.counts_all(v)) {
    std::copy_n(system.change(v), size, g);
    add_in_frame(states, v, size, system.gradient(v), g);
  } else {
    std::fill_n(g, size, 0.0);
    add_in_frame(states, v, size, system.pending(v), g);
  }
  for (std::int32_t i = 0; i < size; ++i) g[i] = -g[i];
}

}  // namespace cairn::incremental
