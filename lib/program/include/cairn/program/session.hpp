// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include <boost/json/fwd.hpp>

#include "cairn/plugin/option_fields.hpp"
#include "cairn/program/file_roles.hpp"

namespace cairn {
class Registry;
}

namespace cairn::app {

/// What every subcommand takes.
struct CommonOptions {
  std::string json;                  ///< file for the report; "-" is standard output
  int threads = 0;                   ///< 0: all cores
  std::vector<std::string> plugins;  ///< shared objects to load besides those that are found
  std::vector<std::string> types;    ///< NAME:key=value
  bool quiet = false;

  static OptionFields<CommonOptions> fields();
};

/// One run of the program: its common options, its registry and its two streams.
///
/// Results go to standard output, and everything else (progress, notes, errors) to standard error,
/// so that a result can be piped. Where standard output is taken by a file or by JSON, nothing else
/// goes there. `quiet` leaves only results and errors.
class Session {
 public:
  Session();
  ~Session();

  CommonOptions common;
  FileRoles files;

  /// The registry, made on first use of the plugins that `common` names, with the types' options
  /// set.
  Registry& registry();
  /// Takes over what was given. A registry of other plugins is made anew.
  void set_common(CommonOptions given);
  /// Applies `--threads`.
  void use_threads() const;

  /// Says that a file named "-" will be written to standard output. Throws `Error` (usage) if the
  /// JSON report or another file goes there too.
  void write_file_to_stdout();
  /// A part of the result, for people.
  void print(std::string_view text) const;
  /// Whether `print` may colour.
  bool colour() const;
  /// A line on standard error that a user should see, such as what a reader had to repair.
  void note(std::string_view text) const;

  bool wants_json() const { return !common.json.empty(); }
  /// Writes the report to where `--json` says; does nothing without it.
  void write_json(const boost::json::object& report) const;

 private:
  std::unique_ptr<Registry> registry_;
  bool types_are_set_ = false;
  bool stdout_is_file_ = false;
};

/// Writes to standard output. A reader that has gone away is no error: the rest is dropped. Throws
/// `Error` (input) where the output cannot be written for another reason, such as a full disk.
void write_stdout(std::string_view text);

/// Whether standard output is a pipe (or socket) whose reader is gone.
bool stdout_reader_is_gone();

}  // namespace cairn::app
