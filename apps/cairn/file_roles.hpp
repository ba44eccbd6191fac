// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

namespace cairn::app {

/// What the files of one run of the program are for, so that no output replaces another, and none
/// an input by accident. Two names of one file are one file. "-",
/// generated graphs and what is no regular file (such as /dev/null) are left alone.
class FileRoles {
 public:
  /// Both throw `Error` (usage): for a file that two outputs would write, and for an input that an
  /// output would replace, unless that output `may_replace_an_input`, as the -o of
  /// `cairn optimize` may.
  void add_input(const std::string& file);
  void add_output(const std::string& file, bool may_replace_an_input);

 private:
  struct Output {
    std::string name, identity;
    bool may_replace_an_input;
  };
  static void refuse(const std::string& input);
  std::vector<std::string> inputs_;  // identities
  std::vector<Output> outputs_;
};

}  // namespace cairn::app
