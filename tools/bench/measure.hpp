// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <boost/json/value.hpp>

#include "child_process.hpp"
#include "data_sets.hpp"

namespace cairn::performance {

/// Linear solvers go under `optimizer`; optimizers that bring their own stand in `complete`.
struct Contestants {
  std::string optimizer = "gauss_newton";
  std::vector<std::string> linear_solvers;
  std::vector<std::string> complete;
};

/// One run of a command of `cairn` and what became of it.
struct Run {
  Outcome outcome;
  boost::json::value report;  ///< null if there is none
};

/// Throws `std::runtime_error` with the program's complaint if it was in time and gave no report.
void require_report(const Run& run);

/// The program that is measured. Every run is a process of its own, so that memory can be told and
/// nothing is warm that would not be for a user.
class Cairn {
 public:
  Cairn(std::filesystem::path program, std::filesystem::path work);

  /// `cairn bench`: interleaved rounds on one graph; returns the whole report. Throws
  /// `std::runtime_error` with its complaint if it gave none.
  boost::json::value bench(const DataSet& set, const Contestants& contestants, int threads,
                           int rounds, const std::vector<std::string>& more) const;

  /// `cairn optimize`, stopped after `limit` seconds (0: never).
  Run optimize(const DataSet& set, const std::vector<std::string>& arguments, int threads,
               double limit) const;

  /// `cairn marginals` at the states as given, likewise.
  Run marginals(const DataSet& set, const std::vector<std::string>& arguments, int threads,
                double limit) const;

  /// `cairn replay`, likewise.
  Run replay(const DataSet& set, const std::vector<std::string>& arguments, int threads,
             double limit) const;

  /// `cairn study compact`, likewise.
  Run compact(const DataSet& set, const std::vector<std::string>& arguments, int threads,
              double limit) const;

  /// `cairn study sparsify`, likewise.
  Run sparsify(const DataSet& set, const std::vector<std::string>& arguments, int threads,
               double limit) const;

  /// `cairn study problems`, with one thread.
  Run solve_problems(const std::filesystem::path& problems,
                     const std::vector<std::string>& arguments, double limit) const;

  /// `cairn explore`, likewise.
  Run explore(const std::string& floor, const std::vector<std::string>& arguments, int threads,
              double limit) const;

  const std::filesystem::path& program() const { return program_; }
  /// A folder for files of the runs.
  const std::filesystem::path& work() const { return work_; }

  /// The names on offer of a kind, such as "linear_solver".
  std::vector<std::string> names(const std::string& kind) const;
  /// Of the names with options given, those that this build can make.
  std::vector<std::string> accepted_solvers(const std::vector<std::string>& specs) const;
  std::vector<std::string> accepted_optimizers(const std::vector<std::string>& specs) const;

 private:
  Run run(const std::vector<std::string>& command, const DataSet& set,
          const std::vector<std::string>& arguments, int threads, double limit) const;
  std::vector<std::string> accepted(const std::string& option,
                                    const std::vector<std::string>& specs) const;

  std::filesystem::path program_, work_;
};

}  // namespace cairn::performance
