// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/program/graph_labels.hpp"

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <iterator>

#include <fmt/core.h>

#include "cairn/program/table.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn::app {
namespace {

bool is_file(const std::string& name) { return name != "-" && !name.starts_with('@'); }

/// The last `parts` parts of a file's path.
std::string end_of_path(const std::string& file, std::ptrdiff_t parts) {
  const std::filesystem::path path = std::filesystem::path(file).lexically_normal();
  const std::ptrdiff_t all = std::distance(path.begin(), path.end());
  std::filesystem::path end;
  for (auto part = std::next(path.begin(), std::max<std::ptrdiff_t>(0, all - parts));
       part != path.end(); ++part) {
    end /= *part;
  }
  return end.string();
}

/// The shortest end of a file's path that no other of the files has.
std::string distinct_end(const std::string& file, const std::vector<std::string>& files) {
  const std::string whole = end_of_path(file, PTRDIFF_MAX);
  for (std::ptrdiff_t parts = 1;; ++parts) {
    std::string end = end_of_path(file, parts);
    const bool shared = std::ranges::any_of(files, [&](const std::string& other) {
      return is_file(other) && end_of_path(other, PTRDIFF_MAX) != whole &&
             end_of_path(other, parts) == end;
    });
    if (!shared || end == whole) return end;
  }
}

}  // namespace

std::string graph_label(const std::string& file) {
  if (file == "-") return "standard input";
  return is_file(file) ? end_of_path(file, 1) : file;
}

std::vector<std::string> graph_labels(const std::vector<std::string>& files,
                                      const std::vector<std::string>& names) {
  if (names.size() > files.size()) {
    throw Error(ErrorCode::usage, fmt::format("--name is given {} times for {}", names.size(),
                                              plural(std::ssize(files), "graph")));
  }
  std::vector<std::string> labels;
  for (std::size_t k = 0; k < files.size(); ++k) {
    if (k < names.size() && !names[k].empty()) {
      labels.push_back(names[k]);
    } else {
      labels.push_back(is_file(files[k]) ? distinct_end(files[k], files) : graph_label(files[k]));
    }
  }
  return labels;
}

}  // namespace cairn::app
