// SPDX-License-Identifier: BSD-3-Clause
#include "constraint_model.hpp"

#include <algorithm>
#include <numeric>
#include <utility>

#include "blanket_matrices.hpp"
#include "cairn/graph/packed.hpp"
#include "dense/lu.hpp"
#include "dense/products.hpp"

namespace cairn::sparsify {

std::shared_ptr<const LinearConstraint> LinearConstraints::type(
    const LinearConstraint::Nodes& nodes, int rank) {
  const auto known = std::ranges::find_if(types_, [&](const auto& type) {
    return type->nodes() == nodes && type->residual_size() == rank;
  });
  if (known != types_.end()) return *known;
  types_.push_back(std::make_shared<LinearConstraint>(nodes, rank));
  return types_.back();
}

namespace {

/// S at the states, coordinates × d: the Jacobian of a constraint with G = I.
Matrix root_shift(const LinearConstraint::Nodes& on, const DenseBlanket& blanket,
                  const std::vector<const double*>& x) {
  const int m = LinearConstraint::coordinates_of(on);
  const LinearConstraint plain(on, m);
  const Matrix I = Matrix::Identity(m, m);
  const std::vector<double> zero(m);
  const std::vector<double> z =
      plain.measurement_at(x.data(), zero, {I.data(), static_cast<std::size_t>(I.size())});
  const std::vector<int> begin = blanket.offsets();
  Matrix S(m, blanket.size());
  Vector r(m);
  std::vector<double*> columns;
  for (std::size_t k = 0; k < x.size(); ++k) columns.push_back(S.data() + begin[k] * m);
  plain.evaluate(x.data(), z.data(), pack(I).data(), r.data(), columns.data());
  return S;
}

}  // namespace

void add_constraint_model(const Graph& graph, const LocalProblem& local, LinearConstraints& types,
                          Marginal& marginal) {
  DenseBlanket& blanket = marginal.dense;
  LinearConstraint::Nodes on{
      .pose = graph.type_of(local.blanket.front()),
      .poses = local.poses,
      .observation = local.types.observation,
      .landmarks = static_cast<int>(std::ssize(local.blanket)) - local.poses};
  if (blanket.absolute) on.absolute_size = std::min(local.absolute_size, on.pose->tangent_size());
  std::vector<const double*> x;
  for (const std::vector<double>& state : marginal.states) x.push_back(state.data());

  const Matrix S = root_shift(on, blanket, x);
  const BlanketProjection projection = project(blanket, Projection::node);
  const auto T = coordinates(projection, blanket.size());
  const Matrix known = dense::product_of_transpose(T, information(blanket));  // TᵀΛ
  const Eigen::PartialPivLU<Matrix> lu(S.rightCols(S.rows()).transpose());
  const Matrix G = lu.solve(known.rightCols(S.rows()).transpose()).transpose();
  const Vector b = T.transpose() * marginal.gradient;

  const auto type = types.type(on, projection.rank);
  FactorModel model{.nodes = std::vector<int>(x.size()), .size = projection.rank, .jacobian = {}};
  std::iota(model.nodes.begin(), model.nodes.end(), 0);
  const Matrix J = dense::product(G, S);
  model.jacobian.assign(J.data(), J.data() + J.size());
  blanket.models.push_back(std::move(model));
  marginal.predictions.push_back(
      {type,
       type->measurement_at(x.data(), {b.data(), static_cast<std::size_t>(b.size())},
                            {G.data(), static_cast<std::size_t>(G.size())}),
       {}});
}

}  // namespace cairn::sparsify
