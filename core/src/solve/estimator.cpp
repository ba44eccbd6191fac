// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/solve/estimator.hpp"

#include <utility>

#include "cairn/runtime/result_fields.hpp"

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

ResultFields<UpdateSeconds> UpdateSeconds::fields() {
  using S = UpdateSeconds;
  return ResultFields<S>()
      .figure("total", &S::total, "s", "of the update")
      .figure("linearize", &S::linearize, "s", "evaluating factors")
      .figure("order", &S::order, "s", "finding the affected part, ordering and analysing it")
      .figure("factorize", &S::factorize, "s", "factorising the affected part")
      .figure("solve", &S::solve, "s", "back substitution")
      .figure("check", &S::check, "s", "deciding what should be relinearised")
      .figure("marginals", &S::marginals, "s", "keeping covariances up to date")
      .details();
}

ResultFields<UpdateReport> UpdateReport::fields() {
  using R = UpdateReport;
  return ResultFields<R>()
      .figure("ok", &R::ok,
              "whether H is positive definite; else the estimate is the best there is")
      .figure("converged", &R::converged,
              "false: everything was to be solved until it has converged, and it has not")
      .figure("first_factor", &R::first_factor,
              "id of the first of the new factors; the others follow it")
      .figure("priors", &R::priors, "ids of the priors that marginalisation left")
      .figure("iterations", &R::iterations, "linear systems solved")
      .figure("affected_variables", &R::affected_variables,
              "variables whose columns of the factor were recomputed, summed")
      .figure("relinearized_factors", &R::relinearized_factors, "besides the new ones")
      .figure("owed", &R::owed, "factors whose relinearisation was deferred to later updates")
      .figure("marginals_by", &R::marginals_by,
              "how kept covariances were updated: none, unchanged, downdate or recomputation")
      .part("seconds", &R::seconds)
      .figure("notes", &R::notes, "sentences for the user")
      .figure("doubts", &R::doubts, "what gives reason to doubt the estimate, while it lasts");
}

}  // namespace cairn
