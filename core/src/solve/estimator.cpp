// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/solve/estimator.hpp"

#include <utility>

namespace cairn {

Estimator::~Estimator() = default;

void UpdateReport::doubt(std::string sentence) {
  doubts.push_back(sentence);
  notes.push_back(std::move(sentence));
}

UpdateSeconds& UpdateSeconds::operator+=(const UpdateSeconds& other) {
  total += other.total;
  linearize += other.linearize;
  order += other.order;
  factorize += other.factorize;
  solve += other.solve;
  check += other.check;
  marginals += other.marginals;
  return *this;
}

std::string_view to_string(MarginalsBy by) {
  switch (by) {
    case MarginalsBy::none:
      return "none";
    case MarginalsBy::unchanged:
      return "unchanged";
    case MarginalsBy::downdate:
      return "downdate";
    case MarginalsBy::recomputation:
      return "recomputation";
  }
  return "unknown";  // only a value that is no MarginalsBy gets here
}

std::vector<double> joint_covariance(Estimator& estimator, std::span<const Id> variables,
                                     int tangent_size) {
  const std::size_t n = static_cast<std::size_t>(tangent_size), rows = variables.size() * n;
  std::vector<double> Sigma(rows * rows, 0.0);
  for (std::size_t k = 0; k < variables.size(); ++k)
    estimator.covariance_column(variables[k], variables,
                                std::span(Sigma).subspan(k * n * rows, n * rows));
  return Sigma;
}

}  // namespace cairn
