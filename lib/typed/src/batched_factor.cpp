// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/typed/batched_factor.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <utility>

#include "cairn/graph/packed.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn {
namespace {

constexpr int kMostNumbers = 1000;  // of a residual or a measurement
constexpr double kStep = 6e-6;  // the cube root of the rounding error: best for central differences

std::size_t size_of(int n) { return static_cast<std::size_t>(n); }

bool same(const double* a, const double* b, std::size_t count) {
  return std::memcmp(a, b, count * sizeof(double)) == 0;
}

/// out = U in for n × columns, `in` row by row, `out` column by column; U upper triangular, packed
/// row by row.
void whiten(const double* U, int n, int columns, const double* in, double* out) {
  for (int row = 0; row < n; ++row) {
    for (int column = 0; column < columns; ++column) {
      double sum = 0.0;
      for (int k = row; k < n; ++k) sum += U[k - row] * in[k * columns + column];
      out[column * n + row] = sum;
    }
    U += n - row;
  }
}

}  // namespace

/// The factors of a pool from `first` on, evaluated.
struct BatchedFactorType::Batch {
  std::size_t first = 0;
  std::vector<std::vector<double>> states;  ///< of each variable: count × ambient size
  std::vector<double> measurements;
  std::vector<double> residuals;               ///< empty: not all results are finite
  std::vector<std::vector<double>> jacobians;  ///< empty: not asked for yet

  /// Of the inputs of factors [begin, end), at the present states of a pool.
  static Batch gather(const BatchedFactorType& type, const FactorView& pool, std::size_t begin,
                      std::size_t end) {
    Batch batch;
    batch.first = begin;
    const std::size_t arity = size_of(type.arity()), count = end - begin;
    for (std::size_t k = 0; k < arity; ++k) {
      const std::size_t ambient = size_of(type.ambient_size(static_cast<int>(k)));
      std::vector<double>& rows = batch.states.emplace_back(count * ambient);
      for (std::size_t f = 0; f < count; ++f) {
        const double* x = pool.states[k] + size_of(pool.slots[(begin + f) * arity + k]) * ambient;
        std::copy_n(x, ambient, rows.begin() + static_cast<std::ptrdiff_t>(f * ambient));
      }
    }
    const std::size_t size = size_of(type.measurement_size());
    batch.measurements.assign(pool.measurements + begin * size, pool.measurements + end * size);
    return batch;
  }

  void evaluate(const BatchedFactorType& type, std::size_t count, bool with_jacobians) {
    const std::vector<const double*> x = pointers();
    if (residuals.empty()) {
      residuals.resize(count * size_of(type.residual_size()));
      type.residuals(count, x, measurements.data(), residuals.data());
    }
    if (!with_jacobians) return;
    std::vector<double*> out;
    for (int k = 0; k < type.arity(); ++k) {
      jacobians.emplace_back(count * size_of(type.residual_size() * type.tangent_size(k)));
      out.push_back(jacobians.back().data());
    }
    type.jacobians(count, x, measurements.data(), out.data());
  }

  bool is_finite() const {
    const auto finite = [](const std::vector<double>& numbers) {
      return std::ranges::all_of(numbers, [](double x) { return std::isfinite(x); });
    };
    return finite(residuals) && std::ranges::all_of(jacobians, finite);
  }

  std::vector<const double*> pointers() const {
    std::vector<const double*> result;
    for (const std::vector<double>& rows : states) result.push_back(rows.data());
    return result;
  }

  /// Its inputs alone.
  Batch without_results() const { return {first, states, measurements, {}, {}}; }

  bool same_inputs(const Batch& other) const {
    return states == other.states && measurements == other.measurements;
  }

  /// Whether factors [begin, end) of a pool have the inputs that they have here.
  bool holds(const BatchedFactorType& type, const FactorView& pool, std::size_t begin,
             std::size_t end) const {
    const std::size_t arity = size_of(type.arity()), size = size_of(type.measurement_size());
    if (measurements.size() != pool.size * size) return false;
    if (states[0].size() != pool.size * size_of(type.ambient_size(0))) return false;
    if (!same(measurements.data() + begin * size, pool.measurements + begin * size,
              (end - begin) * size))
      return false;
    for (std::size_t k = 0; k < arity; ++k) {
      const std::size_t ambient = size_of(type.ambient_size(static_cast<int>(k)));
      for (std::size_t f = begin; f < end; ++f) {
        const double* x = pool.states[k] + size_of(pool.slots[f * arity + k]) * ambient;
        if (!same(states[k].data() + f * ambient, x, ambient)) return false;
      }
    }
    return true;
  }
};

/// Evaluated factors of one pool, for what the base class does with `evaluate`.
class BatchedFactorType::Evaluated final : public EvaluatedFactorType {
 public:
  Evaluated(const BatchedFactorType& type, const Batch& batch) : type_(&type), batch_(&batch) {}

  std::string_view tag() const override { return type_->tag(); }
  int arity() const override { return type_->arity(); }
  std::span<const std::string_view> variable_tags() const override {
    return type_->variable_tags();
  }
  int residual_size() const override { return type_->residual_size(); }
  int measurement_size() const override { return type_->measurement_size(); }
  int tangent_size(int variable) const override { return type_->tangent_size(variable); }
  int ambient_size(int variable) const override { return type_->ambient_size(variable); }
  std::string normalize(double*) const override { return {}; }
  bool propagate(int, const double* const*, const double*, double*) const override { return false; }
  bool is_relative() const override { return false; }

  void evaluate(const double* const*, const double*, const double*, double*,
                double* const*) const override {}  // all are entries of the pool
  void evaluate_entry(const FactorView& pool, std::size_t f, double* residual,
                      double* const* jacobians) const override {
    const int n = residual_size();
    const std::size_t row = f - batch_->first;
    const double* sqrt_information = pool.sqrt_information + pool.noise(f) * packed_size(n);
    whiten(sqrt_information, n, 1, batch_->residuals.data() + row * size_of(n), residual);
    for (int k = 0; jacobians && k < arity(); ++k) {
      if (!jacobians[k]) continue;
      const int columns = tangent_size(k);
      whiten(sqrt_information, n, columns,
             batch_->jacobians[size_of(k)].data() + row * size_of(n * columns), jacobians[k]);
    }
  }

 private:
  const BatchedFactorType* type_;
  const Batch* batch_;
};

BatchedFactorType::BatchedFactorType(Description description)
    : description_(std::move(description)) {
  const auto refuse = [&](const char* what) {
    throw Error(ErrorCode::usage, "factor type '" + description_.tag + "': " + what);
  };
  if (description_.tag.empty()) refuse("it needs a tag, such as EDGE_RANGE");
  if (std::ranges::any_of(description_.tag, [](unsigned char c) { return c <= ' ' || c == 0x7f; }))
    refuse("its tag has a blank or a control character, and is one word of a line in files");
  if (description_.variables.empty()) refuse("it needs the types of its variables");
  if (description_.residual_size < 1) refuse("its residual has at least one number");
  if (description_.residual_size > kMostNumbers) refuse("its residual has at most 1000 numbers");
  if (description_.measurement_size < 0) refuse("the size of its measurement is negative");
  if (description_.measurement_size > kMostNumbers) refuse("it measures at most 1000 numbers");
  for (const auto& type : description_.variables) {
    if (!type) refuse("the type of a variable is null");
    tags_.push_back(type->tag());
  }
}

BatchedFactorType::~BatchedFactorType() = default;

int BatchedFactorType::tangent_size(int variable) const {
  return description_.variables[size_of(variable)]->tangent_size();
}
int BatchedFactorType::ambient_size(int variable) const {
  return description_.variables[size_of(variable)]->ambient_size();
}

void BatchedFactorType::jacobians(std::size_t count, std::span<const double* const> states,
                                  const double* measurements, double* const* out) const {
  const std::size_t n = size_of(residual_size());
  std::vector<const double*> moved(states.begin(), states.end());
  std::vector<double> after(count * n), before(count * n);
  for (std::size_t k = 0; k < states.size(); ++k) {
    const VariableType& type = *description_.variables[k];
    const std::size_t columns = size_of(type.tangent_size());
    std::vector<double> delta(count * columns), x(count * size_of(type.ambient_size()));
    std::vector<std::int64_t> offsets(count);
    for (std::size_t f = 0; f < count; ++f) offsets[f] = static_cast<std::int64_t>(f * columns);
    moved[k] = x.data();
    for (std::size_t column = 0; column < columns; ++column) {
      const auto residuals_at = [&](double step, std::vector<double>& r) {
        for (std::size_t f = 0; f < count; ++f) delta[f * columns + column] = step;
        type.retract(count, states[k], offsets.data(), delta.data(), x.data());
        residuals(count, moved, measurements, r.data());
      };
      residuals_at(kStep, after);
      residuals_at(-kStep, before);
      for (std::size_t f = 0; f < count; ++f) delta[f * columns + column] = 0.0;
      for (std::size_t row = 0; row < count * n; ++row)
        out[k][row * columns + column] = (after[row] - before[row]) / (2.0 * kStep);
    }
    moved[k] = states[k];
  }
}

std::shared_ptr<const BatchedFactorType::Batch> BatchedFactorType::batch(
    const FactorView& pool, std::size_t begin, std::size_t end, bool with_jacobians) const {
  const std::scoped_lock lock(mutex_);
  const bool known = latest_ && latest_->holds(*this, pool, begin, end);
  if (known && latest_->residuals.empty()) {
    // What was not finite may have been so once only: nothing of it is kept, and each range is
    // evaluated by itself, or every range would evaluate all.
    Batch range = Batch::gather(*this, pool, begin, end);
    range.evaluate(*this, end - begin, with_jacobians);
    return std::make_shared<const Batch>(std::move(range));
  }
  if (known && (!with_jacobians || !latest_->jacobians.empty())) return latest_;
  Batch fresh = Batch::gather(*this, pool, 0, pool.size);
  if (latest_ && fresh.same_inputs(*latest_)) fresh.residuals = latest_->residuals;
  fresh.evaluate(*this, pool.size, with_jacobians);
  const bool finite = fresh.is_finite();
  const auto all = std::make_shared<const Batch>(std::move(fresh));
  latest_ = finite ? all : std::make_shared<const Batch>(all->without_results());
  return all;
}

void BatchedFactorType::squared_norms(const FactorView& pool, std::size_t begin, std::size_t end,
                                      double* out) const {
  const std::shared_ptr<const Batch> all = batch(pool, begin, end, false);
  Evaluated(*this, *all).squared_norms(pool, begin, end, out);
}

void BatchedFactorType::linearize(const FactorView& pool, std::size_t begin, std::size_t end,
                                  const double* weights, const LinearizeSink& sink,
                                  double* out_squared_norms) const {
  const std::shared_ptr<const Batch> all = batch(pool, begin, end, true);
  Evaluated(*this, *all).linearize(pool, begin, end, weights, sink, out_squared_norms);
}

void BatchedFactorType::evaluate(const double* const* x, const double* measurement,
                                 const double* sqrt_information, double* residual,
                                 double* const* out) const {
  const int n = residual_size();
  const std::span<const double* const> states(x, size_of(arity()));
  std::vector<double> e(size_of(n));
  std::vector<std::vector<double>> J;
  {
    const std::scoped_lock lock(mutex_);
    residuals(1, states, measurement, e.data());
    if (out) {
      std::vector<double*> pointers;
      for (int k = 0; k < arity(); ++k) {
        J.emplace_back(size_of(n * tangent_size(k)));
        pointers.push_back(J.back().data());
      }
      jacobians(1, states, measurement, pointers.data());
    }
  }
  whiten(sqrt_information, n, 1, e.data(), residual);
  for (int k = 0; out && k < arity(); ++k) {
    if (out[k]) whiten(sqrt_information, n, tangent_size(k), J[size_of(k)].data(), out[k]);
  }
}

}  // namespace cairn
