// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "fault_record.hpp"
#include "process.hpp"

namespace cairn::faults {

/// What is made to fail in a run.
struct Fault {
  enum class What {
    nothing,
    allocation,  ///< one allocation
    memory,      ///< an allocation and all after it
    thread,      ///< the start of a thread and of all after it
    output,      ///< a call on an output, as `kind` names it (kKindVariable)
    kill,        ///< none: the process is killed, `number` microseconds after its start
  };
  What what = What::nothing;
  std::uint64_t number = 0;  ///< of the call, from 1
  std::string kind;
};

/// "allocation:17", "output:3:ENOSPC", "kill:12000"
std::string to_string(const Fault& fault);
/// The inverse. Throws `std::invalid_argument`.
Fault parse_fault(const std::string& text);

/// A command of the program under test, as it is run again and again.
struct Trial {
  std::string name;
  std::vector<std::string> arguments;  ///< in the run's folder; inputs are in ../inputs
  std::vector<std::string> outputs;    ///< names of the files that it writes there
  /// Those of two files of one output, such as a map and its picture: the second → the first.
  std::map<std::string, std::string> parts;
  std::string journal;  ///< one of them that grows with what standard output acknowledges, or empty
  /// One of them that is written line by line, so that a process that is killed leaves its
  /// beginning, which `cairn view` shows; or empty.
  std::string recording;
  std::string input;   ///< file for standard input, in the folder of inputs, or empty
  std::string stream;  ///< of a trial with a journal: all lines, those restored among them
  /// Files that are there before: name → file in the folder of inputs.
  std::map<std::string, std::string> before;
  /// Outputs that lines of the stream order: name → number of the line.
  std::map<std::string, long> saved;
  bool memory = true;    ///< allocations are made to fail
  bool threads = false;  ///< the starts of threads are made to fail, and nothing else
};

/// What a run left.
struct RunResult {
  int code = -1;                             ///< exit code; -1 where a signal ended the process
  int signal = 0;                            ///< that ended it
  std::string out, err;                      ///< standard output and error
  std::map<std::string, std::string> files;  ///< all files of its folder, by name
  std::int64_t microseconds = 0;             ///< that it took
  std::uint64_t started = 0, allocations = 0, threads = 0, outputs = 0, failed = 0;
  std::vector<OutputCall> calls;  ///< on outputs
};

/// Runs a program with faults, each time in a folder that looks as it did before.
class Experiment {
 public:
  /// `library` is the injected one; `folder` is made.
  Experiment(const std::filesystem::path& program, const std::filesystem::path& library,
             std::filesystem::path folder);

  const std::filesystem::path& inputs() const { return inputs_; }
  const std::filesystem::path& run_folder() const { return run_; }

  /// Runs to the end; a process that does not end is killed (signal SIGALRM). Throws
  /// `std::runtime_error` where the run itself cannot be made.
  RunResult run(const Trial& trial, const Fault& fault);

  /// Runs the program without the library in the folder of inputs, to make inputs. Throws
  /// `std::runtime_error` if it fails.
  void make_input(const std::vector<std::string>& arguments, const std::string& input = "");

  /// The line for a shell that repeats a run, in its folder.
  std::string shell_line(const Trial& trial, const Fault& fault) const;

 private:
  void prepare(const Trial& trial) const;
  pid_t start(const std::vector<std::string>& arguments, std::vector<std::string> environment,
              const std::filesystem::path& folder, const std::string& input) const;
  std::vector<std::string> environment(const Fault& fault, bool injected) const;

  std::filesystem::path program_, library_, inputs_, run_, record_, out_, err_;
};

/// What stands in an output before a run.
std::string old_content(const std::string& name);

}  // namespace cairn::faults
