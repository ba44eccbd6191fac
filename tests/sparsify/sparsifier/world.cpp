// SPDX-License-Identifier: BSD-3-Clause
#include "sparsify/sparsifier/world.hpp"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Dense>

#include "cairn/geometry/pose.hpp"
#include "cairn/graph/packed.hpp"
#include "support/dense_system.hpp"
#include "work_graph.hpp"

namespace cairn::sparsify {

void World::pose(Id id) {
  const auto type = registry_.variable_type(plane() ? "VERTEX_SE2" : "VERTEX_SE3:QUAT");
  std::vector<double> x(type->ambient_size());
  Matrix delta = draw_.matrix(type->tangent_size(), 1);
  delta.topRows(dimension_) *= 3.0;
  type->lie_group()->exp(delta.data(), x.data());
  graph.add_variable(type, id, x);
}

void World::landmark(Id id) {
  const Matrix at = 4.0 * draw_.matrix(dimension_, 1);
  graph.add_variable(registry_.variable_type(plane() ? "VERTEX_XY" : "VERTEX_TRACKXYZ"), id,
                     {at.data(), static_cast<std::size_t>(dimension_)});
}

void World::relate(Id a, Id b) {
  const LieGroup& lie = *graph.type(index(a)).lie_group();
  std::vector<double> back(graph.state(index(a)).size()), z(back.size());
  lie.inverse(graph.state(index(a)).data(), back.data());
  lie.compose(back.data(), graph.state(index(b)).data(), z.data());
  add(plane() ? "EDGE_SE2" : "EDGE_SE3:QUAT", {index(a), index(b)}, z);
}

void World::observe(Id pose, Id landmark) {
  const Pose from = pose_of(graph.type(index(pose)), graph.state(index(pose)));
  const Eigen::Vector3d to = position(graph.type(index(landmark)), graph.state(index(landmark)));
  const Eigen::Vector3d seen = from.R.transpose() * (to - from.t);
  add(plane() ? "EDGE_SE2_XY" : "EDGE_SE3_TRACKXYZ", {index(pose), index(landmark)},
      {seen.data(), seen.data() + dimension_});
}

void World::bearing_range(Id pose, Id landmark) {
  const Pose from = pose_of(graph.type(index(pose)), graph.state(index(pose)));
  const Eigen::Vector3d to = position(graph.type(index(landmark)), graph.state(index(landmark)));
  const Eigen::Vector3d seen = from.R.transpose() * (to - from.t);
  add("EDGE_BEARING_RANGE_SE2_XY", {index(pose), index(landmark)},
      {std::atan2(seen.y(), seen.x()), seen.norm()});
}

void World::place(Id id) {
  const bool point = is_point(graph.type(index(id)));
  const auto x = graph.state(index(id));
  add(point ? (plane() ? "EDGE_PRIOR_XY" : "EDGE_PRIOR_TRACKXYZ")
            : (plane() ? "EDGE_PRIOR_SE2" : "EDGE_PRIOR_SE3:QUAT"),
      {index(id)}, {x.begin(), x.end()});
}

void World::locate(Id id) {
  const auto type = registry_.factor_type(plane() ? "EDGE_PRIOR_SE2" : "EDGE_PRIOR_SE3:QUAT");
  const auto x = graph.state(index(id));
  Matrix information = Matrix::Zero(type->residual_size(), type->residual_size());
  information.topLeftCorner(dimension_, dimension_) = 20.0 * draw_.definite(dimension_);
  graph.add_factor(type, std::vector<int>{index(id)}, {x.begin(), x.end()}, pack(information));
}

std::vector<int> World::indices(const std::vector<Id>& ids) const {
  std::vector<int> all;
  for (const Id id : ids) all.push_back(index(id));
  return all;
}

DenseBlanket World::blanket(const std::vector<Id>& removed, bool parts) const {
  const WorkGraph work(graph);
  LocalProblem local = crop(work, indices(removed));
  local.parts = parts;
  EXPECT_THAT(local.refusal, testing::IsEmpty());
  return marginalize(work, local, LocalMinimum::measured).dense;
}

std::string World::refusal(Id id) const { return crop(WorkGraph(graph), {index(id)}).refusal; }

Sparsification World::removal(const std::vector<Id>& ids, const std::string& sparsifier) {
  return registry_.make<Sparsifier>(sparsifier)->remove(graph, indices(ids));
}

Graph World::without(const std::vector<Id>& ids, const std::string& sparsifier) {
  Graph sparse = graph.clone();
  apply(removal(ids, sparsifier), sparse);
  return sparse;
}

void World::add(const char* tag, const std::vector<int>& on, std::vector<double> z) {
  const auto type = registry_.factor_type(tag);
  type->normalize(z.data());
  graph.add_factor(type, on, z, pack(20.0 * draw_.definite(type->residual_size())));
}

Matrix marginal_of(const Graph& graph, const Graph& kept) {
  const test::DenseSystem system =
      test::dense_system(graph, std::vector<bool>(graph.variable_count()));
  std::vector<Eigen::Index> stay, leave;
  const auto rows = [&](Id id, std::vector<Eigen::Index>& into) {
    const auto& at = system.rows.at(id);
    for (Eigen::Index k = 0; k < at.size; ++k) into.push_back(at.first + k);
  };
  for (int v = 0; v < kept.variable_count(); ++v) rows(kept.id(v), stay);
  for (int v = 0; v < graph.variable_count(); ++v) {
    if (!kept.find(graph.id(v))) rows(graph.id(v), leave);
  }
  Matrix L = system.H(stay, stay);
  if (!leave.empty()) {
    const Matrix across = system.H(leave, stay);
    L -= across.transpose() * Matrix(system.H(leave, leave)).ldlt().solve(across);
  }
  return L;
}

double dense_divergence(const Matrix& L, const Matrix& sparse) {
  const Eigen::SelfAdjointEigenSolver<Matrix> eigen(L);
  const Eigen::Index n = L.rows();
  Eigen::Index zeros = 0;
  while (eigen.eigenvalues()[zeros] < 1e-9 * eigen.eigenvalues()[n - 1]) ++zeros;
  const Matrix T = eigen.eigenvectors().rightCols(n - zeros) *
                   eigen.eigenvalues().tail(n - zeros).cwiseSqrt().cwiseInverse().asDiagonal();
  // What Λ leaves open, Λ̆ does.
  const Matrix open = eigen.eigenvectors().leftCols(zeros);
  EXPECT_LE((sparse * open).norm(), 1e-7 * sparse.norm());
  return dense_kld(T.transpose() * sparse * T);
}

}  // namespace cairn::sparsify
