// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/types/evaluated_factor.hpp"

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "dense/products.hpp"

namespace cairn {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Where the states of one factor of a pool are.
std::vector<const double*> states_of(const FactorType& type, const FactorView& pool,
                                     std::size_t factor) {
  std::vector<const double*> x;
  const auto arity = static_cast<std::size_t>(type.arity());
  for (std::size_t k = 0; k < arity; ++k) {
    x.push_back(pool.states[k] + static_cast<std::ptrdiff_t>(pool.slots[factor * arity + k]) *
                                     type.ambient_size(static_cast<int>(k)));
  }
  return x;
}

std::size_t packed_size(const FactorType& type) {
  const auto n = static_cast<std::size_t>(type.residual_size());
  return n * (n + 1) / 2;
}

}  // namespace

EvaluatedFactorType::~EvaluatedFactorType() = default;

void EvaluatedFactorType::evaluate_entry(const FactorView& pool, std::size_t f, double* residual,
                                         double* const* jacobians) const {
  evaluate(states_of(*this, pool, f).data(),
           pool.measurements + f * static_cast<std::size_t>(measurement_size()),
           pool.sqrt_information + pool.noise(f) * packed_size(*this), residual, jacobians);
}

void EvaluatedFactorType::squared_norms(const FactorView& pool, std::size_t begin, std::size_t end,
                                        double* out) const {
  VectorXd r(residual_size());
  for (std::size_t f = begin; f < end; ++f) {
    evaluate_entry(pool, f, r.data(), nullptr);
    out[f - begin] = r.squaredNorm();
  }
}

void EvaluatedFactorType::linearize(const FactorView& pool, std::size_t begin, std::size_t end,
                                    const double* weights, const LinearizeSink& sink,
                                    double* out_squared_norms) const {
  const int n = arity(), m = residual_size();
  const auto pairs = static_cast<std::size_t>(n * (n + 1) / 2);
  VectorXd r(m);
  std::vector<MatrixXd> J;
  std::vector<double*> out;
  for (int k = 0; k < n; ++k) J.emplace_back(m, tangent_size(k));
  for (MatrixXd& block : J) out.push_back(block.data());
  for (std::size_t f = begin; f < end; ++f) {
    evaluate_entry(pool, f, r.data(), out.data());
    if (out_squared_norms) out_squared_norms[f - begin] = r.squaredNorm();
    const double weight = weights ? weights[f - begin] : 1.0;
    std::size_t pair = f * pairs;
    for (int a = 0; a < n; ++a) {
      for (int b = a; b < n; ++b, ++pair) {
        const LinearizeTarget target = sink.blocks[pair];
        if (target.is_none()) continue;
        const bool turned = a != b && target.transposed();
        const MatrixXd block =
            dense::scaled_product_of_transpose(weight, J[turned ? b : a], J[turned ? a : b]);
        sink.put(target, block.data(), static_cast<std::size_t>(block.size()));
      }
      const VectorXd gradient = -weight * J[a].transpose() * r;
      sink.put(sink.gradients[f * static_cast<std::size_t>(n) + a], gradient.data(),
               static_cast<std::size_t>(gradient.size()));
    }
  }
}

}  // namespace cairn
