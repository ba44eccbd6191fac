// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

namespace cairn::app {

/// What the files of one run of the program are for, so that no output replaces another, and none
/// an input by accident. Two names of one file are one file. "-",
/// generated graphs and what is not a regular file (such as /dev/null) are left alone.
class FileRoles {
 public:
  /// The graph that is worked on, whose place the `result` may take, as -o of `cairn optimize` may;
  /// anything else that is read; the result; anything else that is written. All throw `Error`
  /// (usage): for a file that two outputs would write, and for an input that an output would
  /// replace.
  void add_graph(const std::string& file);
  void add_input(const std::string& file);
  void add_result(const std::string& file);
  void add_output(const std::string& file);

 private:
  struct File {
    std::string name, identity;
    bool exchangeable;  // the graph, the result
  };
  void read(const std::string& file, bool exchangeable);
  void write(const std::string& file, bool exchangeable);
  std::vector<File> inputs_, outputs_;
};

}  // namespace cairn::app
