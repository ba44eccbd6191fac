// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <sys/types.h>

#include <chrono>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include <boost/json/value.hpp>

namespace cairn::test {

using Arguments = std::vector<std::string>;
using Environment = std::map<std::string, std::string>;

/// What a run of the program left.
struct Outcome {
  int exit_code = -1;  ///< -1 where a signal ended it
  std::string out;
  std::string err;
};

/// Runs `cairn` with these arguments to its end. `environment` is added to this process's own;
/// `input` is its standard input.
Outcome cairn(const Arguments& arguments, const Environment& environment = {},
              const std::string& input = "");

/// Runs another program (with the search path) in the same way.
Outcome run_program(const Arguments& command, const Environment& environment = {},
                    const std::string& input = "");

/// Starts `cairn`, sends `signal` as soon as its standard error says `cue`, and waits for its end.
Outcome cairn_interrupted(const Arguments& arguments, const std::string& cue, int signal);

/// Starts `cairn` with `input` and more to come, and kills it (SIGKILL) when it has written `lines`
/// lines and `delay` has passed; what it had written by then.
Outcome cairn_killed(const Arguments& arguments, const std::string& input, int lines,
                     std::chrono::microseconds delay);

/// `cairn` as a partner in a conversation: is told lines, and its own are read one by one. Killed
/// if it has not ended with the object.
class Partner {
 public:
  explicit Partner(const Arguments& arguments);
  Partner(const Partner&) = delete;
  Partner& operator=(const Partner&) = delete;
  ~Partner();

  void tell(const std::string& line);
  /// The next line, as soon as it is there; none once there will be no more.
  std::optional<std::string> hear();
  /// Ends the input, and waits for the end; what had not been heard yet.
  Outcome end();
  void send_signal(int number);

 private:
  struct Process;
  std::unique_ptr<Process> process_;
};

/// Runs `cairn` with standard output and error on a terminal of so many columns (0: it does not
/// say); both arrive in `out`.
Outcome cairn_on_terminal(const Arguments& arguments, const Environment& environment = {},
                          int columns = 0);

/// A folder of its own for each test, removed at its end.
class TemporaryFolder {
 public:
  TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  ~TemporaryFolder();

  std::string file(const std::string& name) const { return (path_ / name).string(); }
  const std::filesystem::path& path() const { return path_; }
  /// Names of what is in it, sorted.
  std::vector<std::string> contents() const;

 private:
  std::filesystem::path path_;
};

/// Tests that need a graph worth optimising, as a file.
class WithGraphFile : public ::testing::Test {
 protected:
  std::string graph();
  TemporaryFolder folder_;
};

std::string read_text(const std::filesystem::path& file);
void write_text(const std::filesystem::path& file, const std::string& text);
/// Parses JSON and nothing but JSON: fails the test otherwise.
boost::json::value parse_json(const std::string& text);
/// Runs `cairn` with these arguments, which must go well, and parses its report (`--json`).
boost::json::value report_of(Arguments arguments);
std::vector<std::string> lines(const std::string& text);
/// The words with one blank between them, as they were before the program folded them to lines.
std::string unfolded(const std::string& text);
/// How many columns of a terminal a line takes: its code points, escape sequences not counted.
std::size_t columns(const std::string& line);

/// The path of the program under test.
std::string program();
/// The folder of the project's sources.
std::string source_folder();
/// The folder of the plugins that are wrong on purpose.
std::string bad_plugins();

}  // namespace cairn::test
