// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/estimator.hpp"

namespace cairn {

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

}  // namespace cairn
