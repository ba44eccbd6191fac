// SPDX-License-Identifier: BSD-3-Clause
#include "models.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "cairn/graph/packed.hpp"

namespace cairn::incremental {
namespace {

/// out += J δ; J rows × size. The number of rows known when compiling is what makes this fast.
template <int Rows>
void add_product(const double* J, int size, const double* delta, double* out) {
  for (int k = 0; k < size; ++k) {
    for (int r = 0; r < Rows; ++r) out[r] += J[r] * delta[k];
    J += Rows;
  }
}
void add_product(int rows, const double* J, int size, const double* delta, double* out) {
  switch (rows) {
    case 2:
      return add_product<2>(J, size, delta, out);
    case 3:
      return add_product<3>(J, size, delta, out);
    case 6:
      return add_product<6>(J, size, delta, out);
    default:
      for (int k = 0; k < size; ++k) {
        for (int r = 0; r < rows; ++r) out[r] += J[r] * delta[k];
        J += rows;
      }
  }
}

/// out += sign · Aᵀ B; A rows × a, B rows × b, out a × b, all column-major.
template <int Rows>
void add_transposed_product(const double* A, int a, const double* B, int b, double sign,
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
  const auto rows = static_cast<std::size_t>(record.rows);
  const auto scalars = static_cast<std::size_t>(record.scalars);
  record.place = values_.take(rows * (scalars + 1) + scalars);
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
  type.evaluate(
      points_.data(),
      pool.measurements.data() + entry * static_cast<std::size_t>(type.measurement_size()),
      pool.sqrt_information.data() + entry * packed, r, J ? pointers_.data() : nullptr);
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
  double* const r = J + rows * record.scalars;
  double* const gradient = r + rows;
  record.cost = evaluate(record, graph, states.estimate(), r, J);
  std::fill_n(gradient, record.scalars, 0.0);
  add_transposed_product(rows, J, record.scalars, r, 1, 1.0, gradient);
  std::fill_n(r, rows, 0.0);
  into_frames(record, states, J);
  record.moving = false;
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

void Models::add_to(System& system, int f, double sign, std::span<const std::uint8_t> held) const {
  const Record& record = records_[f];
  const int rows = record.rows;
  const std::int32_t* v = variables_.data() + record.variables;
  const double* J = values_.at(record.place);
  const double* const change = J + rows * record.scalars;
  const double* gradient = change + rows;
  for (int ka = 0; ka < record.arity; ++ka) {
    const std::int32_t a = v[ka], size = system.size(a);
    if (!held[a]) {
      add_transposed_product(rows, J, size, J, size, sign, system.diagonal(a));
      add_transposed_product(rows, J, size, change, 1, sign, system.change(a));
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

namespace {

/// r ← r + Σ J_k δ_k for two variables of `Size` coordinates.
template <int Rows, int Size>
void move_pair(const double* J, const double* const* steps, double* r) {
  double change[Rows] = {};
  for (int k = 0; k < 2; ++k, J += Rows * Size) {
    if (!steps[k]) continue;
    for (int c = 0; c < Size; ++c) {
      for (int i = 0; i < Rows; ++i) change[i] += J[c * Rows + i] * steps[k][c];
    }
  }
  for (int i = 0; i < Rows; ++i) r[i] += change[i];
}

}  // namespace

bool Models::move(int f, const double* const* steps) {
  Record& record = records_[f];
  const int rows = record.rows;
  const double* J = values_.at(record.place);
  double* change = values_.at(record.place) + rows * record.scalars;
  if (record.arity == 2 && rows == 3 && record.scalars == 6 && size_of(record, 0) == 3) {
    move_pair<3, 3>(J, steps, change);
  } else if (record.arity == 2 && rows == 6 && record.scalars == 12 && size_of(record, 0) == 6) {
    move_pair<6, 6>(J, steps, change);
  } else {
    for (int k = 0; k < record.arity; ++k) {
      const int size = size_of(record, k);
      if (steps[k]) add_product(rows, J, size, steps[k], change);
      J += rows * size;
    }
  }
  return !std::exchange(record.moving, true);
}

double Models::correct(int f, const Graph& graph, const States& states, System& system,
                       std::span<const std::uint8_t> held, bool compare) {
  Record& record = records_[f];
  const int rows = record.rows, doubles = rows * record.scalars;
  const std::int64_t room = std::int64_t{doubles} + rows + record.scalars;
  scratch_.resize(static_cast<std::size_t>(room));
  double* const J_now = scratch_.data();
  double* const r_now = J_now + doubles;
  double* const beyond = r_now + rows;  // J(x)ᵀ r(x) less γ when last evaluated
  record.cost = evaluate(record, graph, states.estimate(), r_now, J_now);
  const double* const J = values_.at(record.place);
  double* const change = values_.at(record.place) + doubles;
  double* const gradient = change + rows;
  std::fill_n(beyond, record.scalars, 0.0);
  add_transposed_product(rows, J_now, record.scalars, r_now, 1, 1.0, beyond);
  for (int c = 0; c < record.scalars; ++c) {
    const double now = beyond[c];
    beyond[c] -= gradient[c];
    gradient[c] = now;
  }
  record.moving = false;
  int first = 0;
  for (int k = 0; k < record.arity; ++k) {
    const std::int32_t v = variables_[record.variables + k], size = system.size(v);
    if (!held[v]) {
      system.count_all(v);
      add_transposed_product(rows, J + first * rows, size, change, 1, -1.0, system.change(v));
      for (int i = 0; i < size; ++i) system.gradient(v)[i] += beyond[first + i];
    }
    first += size;
  }
  std::fill_n(change, rows, 0.0);
  if (!compare) return 0.0;
  into_frames(record, states, J_now);
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
  if (!states.away(v)) {
    for (int i = 0; i < size; ++i) out[i] += gradient[i];
    return;
  }
  const double* T = states.frame_to_body(v);
  for (int i = 0; i < size; ++i) {
    for (int k = 0; k < size; ++k) out[i] += T[i * size + k] * gradient[k];
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
