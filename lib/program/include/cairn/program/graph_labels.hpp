// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

namespace cairn::app {

/// The label of a graph of the command line in tables, reports and plots: "sphere.g2o" for
/// maps/sphere.g2o, "standard input" for "-", a generator with its options as it is.
std::string graph_label(const std::string& file);

/// Labels of several graphs. Where files in different folders have one name, as much of the path is
/// added as makes them different. `names` are the user's own names for the first of them; an empty
/// one is none. Throws `Error` (usage) if there are more names than files.
std::vector<std::string> graph_labels(const std::vector<std::string>& files,
                                      const std::vector<std::string>& names);

}  // namespace cairn::app
