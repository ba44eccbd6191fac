// SPDX-License-Identifier: BSD-3-Clause
#include "linear_model.hpp"

#include <algorithm>
#include <numeric>
#include <utility>

#include "blanket_matrices.hpp"
#include "cairn/graph/packed.hpp"
#include "dense/lu.hpp"
#include "dense/products.hpp"

namespace cairn::sparsify {

std::shared_ptr<const LinearConstraint> LinearConstraints::type(
    const LinearConstraint::Nodes& nodes) {
  const auto known =
      std::ranges::find_if(types_, [&](const auto& type) { return type->nodes() == nodes; });
  if (known != types_.end()) return *known;
  types_.push_back(std::make_shared<LinearConstraint>(nodes));
  return types_.back();
}

void add_linear_model(const Graph& graph, const LocalProblem& local, LinearConstraints& types,
                      Marginal& marginal) {
  DenseBlanket& blanket = marginal.dense;
  LinearConstraint::Nodes on{
      .pose = graph.type_of(local.blanket.front()),
      .poses = local.poses,
      .observation = local.types.observation,
      .landmarks = static_cast<int>(std::ssize(local.blanket)) - local.poses};
  if (blanket.absolute) on.absolute_size = std::min(local.absolute_size, on.pose->tangent_size());
  const std::shared_ptr<const LinearConstraint> type = types.type(on);

  const int m = type->residual_size(), d = blanket.size();
  std::vector<const double*> x;
  for (const std::vector<double>& state : marginal.states) x.push_back(state.data());
  std::vector<double> z = type->measurement_at(x.data());
  Matrix S(m, d);
  std::vector<double*> columns;
  const std::vector<int> begin = blanket.offsets();
  for (std::size_t k = 0; k < x.size(); ++k) columns.push_back(S.data() + begin[k] * m);
  Vector e(m);
  type->evaluate(x.data(), z.data(), pack(Matrix::Identity(m, m)).data(), e.data(), columns.data());

  const BlanketProjection projection = project(blanket, Projection::node);
  const auto T = coordinates(projection, d);
  const Matrix known = dense::product_of_transpose(T, information(blanket));  // TᵀΛ
  const Eigen::PartialPivLU<Matrix> inverse(S.rightCols(m).transpose());
  const Matrix G_transposed = inverse.solve(known.rightCols(m).transpose());
  const Vector mean = S * (T * (T.transpose() * marginal.gradient));
  std::ranges::copy(mean, z.end() - m);

  FactorModel model{.nodes = std::vector<int>(x.size()), .size = projection.rank, .jacobian = {}};
  std::iota(model.nodes.begin(), model.nodes.end(), 0);
  const Matrix J = dense::product_of_transpose(G_transposed, S);
  model.jacobian.assign(J.data(), J.data() + J.size());
  blanket.models.push_back(std::move(model));
  marginal.predictions.push_back({type, std::move(z), G_transposed});
}

}  // namespace cairn::sparsify
