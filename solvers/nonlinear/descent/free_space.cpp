// SPDX-License-Identifier: BSD-3-Clause
#include "free_space.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <map>

namespace cairn {
namespace {

/// A turn by one radian counts as much as a shift by so many units, in units of the measurements:
/// more than the extent of a map.
constexpr double kStiffRotation = 1e6;

bool has_orientation(const VariableType& type) {
  return type.placement() && type.placement()->has_orientation();
}

/// Modified Gram-Schmidt, twice.
void orthonormalise(Eigen::MatrixXd& V) {
  for (Eigen::Index j = 0; j < V.cols(); ++j) {
    for (int round = 0; round < 2; ++round) {
      V.col(j).normalize();
      for (Eigen::Index i = 0; i < j; ++i) V.col(j) -= V.col(i).dot(V.col(j)) * V.col(i);
    }
    V.col(j).normalize();
  }
}

}  // namespace

FreeSpace::FreeSpace(const Graph& graph, const FreeDirections& free, const Linearizer& linearizer,
                     std::span<const double> diagonal) {
  if (free.empty()) return;
  double largest = 0.0;
  for (const double entry : diagonal) largest = std::max(largest, entry);
  if (!(largest > 0.0)) largest = 1.0;
  pins_.assign(diagonal.size(), 0.0);
  std::map<int, std::vector<const FreeDirection*>> by_part;
  for (const FreeDirection& direction : free.directions)
    by_part[direction.part].push_back(&direction);
  for (const auto& [number, directions] : by_part) {
    Part part;
    std::vector<double> roots, least;
    std::map<std::int64_t, Eigen::Index> place;
    for (const FreeDirection* direction : directions) {
      for (const FreeMove& move : direction->moves) {
        const std::int64_t first =
            linearizer.structure()
                .offsets()[static_cast<std::size_t>(linearizer.block_of(move.variable))];
        const auto n = static_cast<std::int64_t>(move.delta.size());
        const std::int64_t of_one = numbers_of_one_unit(graph.type(move.variable));
        for (std::int64_t k = 0; k < n; ++k) {
          if (!place.try_emplace(first + k, std::ssize(part.rows)).second) continue;
          part.rows.push_back(first + k);
          const auto unit = k < of_one ? diagonal.subspan(static_cast<std::size_t>(first),
                                                          static_cast<std::size_t>(of_one))
                                       : diagonal.subspan(static_cast<std::size_t>(first + of_one),
                                                          static_cast<std::size_t>(n - of_one));
          least.push_back(std::max(std::ranges::max(unit), 1e-14 * largest));
          const bool turns = k >= of_one && has_orientation(graph.type(move.variable));
          roots.push_back(std::sqrt(least.back()) * (turns ? kStiffRotation : 1.0));
        }
      }
    }
    part.root = Eigen::Map<const Eigen::VectorXd>(roots.data(), std::ssize(roots));
    part.least = Eigen::Map<const Eigen::VectorXd>(least.data(), std::ssize(least));
    part.V = Eigen::MatrixXd::Zero(std::ssize(part.rows), std::ssize(directions));
    for (std::size_t j = 0; j < directions.size(); ++j) {
      for (const FreeMove& move : directions[j]->moves) {
        const Eigen::Index first =
            place.at(linearizer.structure()
                         .offsets()[static_cast<std::size_t>(linearizer.block_of(move.variable))]);
        for (std::size_t k = 0; k < move.delta.size(); ++k) {
          const Eigen::Index row = first + static_cast<Eigen::Index>(k);
          part.V(row, static_cast<Eigen::Index>(j)) = part.root[row] * move.delta[k];
        }
      }
    }
    orthonormalise(part.V);
    pin(part, diagonal);
    parts_.push_back(std::move(part));
  }
}

/// Pins the rows that Gauss elimination with complete pivoting chooses.
void FreeSpace::pin(const Part& part, std::span<const double> diagonal) {
  Eigen::MatrixXd V = part.V;
  for (Eigen::Index j = 0; j < V.cols(); ++j) {
    Eigen::Index row = 0, column = 0;
    V.rightCols(V.cols() - j).cwiseAbs().maxCoeff(&row, &column);
    V.col(j).swap(V.col(j + column));
    for (Eigen::Index c = j + 1; c < V.cols(); ++c) V.col(c) -= V(row, c) / V(row, j) * V.col(j);
    const auto at = static_cast<std::size_t>(part.rows[static_cast<std::size_t>(row)]);
    pins_[at] = std::max(diagonal[at], part.least[row]);
  }
}

void FreeSpace::project(std::span<double> step) const {
  for (const Part& part : parts_) {
    Eigen::VectorXd x(std::ssize(part.rows));
    for (std::size_t k = 0; k < part.rows.size(); ++k) {
      const auto i = static_cast<Eigen::Index>(k);
      x[i] = part.root[i] * step[static_cast<std::size_t>(part.rows[k])];
    }
    x -= part.V * (part.V.transpose() * x);
    for (std::size_t k = 0; k < part.rows.size(); ++k) {
      const auto i = static_cast<Eigen::Index>(k);
      step[static_cast<std::size_t>(part.rows[k])] = x[i] / part.root[i];
    }
  }
}

}  // namespace cairn
