// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <limits>
#include <string_view>

namespace cairn::performance {

// What Tables 4.1 to 4.3 of J. Vallvé, Information metrics for localization and mapping (thesis,
// UPC Barcelona 2018) say. Graphs are called M3500, Intel, FR079 and MITb; schemes `single` and
// `multi`. What it does not say is NaN.

inline constexpr double kNotSaid = std::numeric_limits<double>::quiet_NaN();

/// Table 4.1.
struct ThesisCounts {
  double problems = kNotSaid;
  double blanket = kNotSaid;  ///< nodes, on average
};
/// With the topology `clt`, or `mi` with the population tree:2.
ThesisCounts thesis_counts(std::string_view graph, std::string_view scheme,
                           std::string_view topology, int keep_every);

/// Table 4.2.
struct ThesisLoss {
  double kld = kNotSaid;
  double rmse = kNotSaid;     ///< [m]
  double seconds = kNotSaid;  ///< in all
};
/// By `clt`, `ip`, `fd` or `ncfd`.
ThesisLoss thesis_loss(std::string_view graph, std::string_view scheme, std::string_view recovery,
                       int keep_every);

/// Table 4.3.
struct ThesisTopology {
  double kld = kNotSaid;
  double rmse = kNotSaid;     ///< [m]
  double seconds = kNotSaid;  ///< of sparsification
  double topology_seconds = kNotSaid;
  double factors = kNotSaid;
};
/// Of `clt`, or of population and topology such as "tree:1.5 mi".
ThesisTopology thesis_topology(std::string_view graph, std::string_view which);

}  // namespace cairn::performance
