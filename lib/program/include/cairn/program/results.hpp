// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <exception>
#include <functional>
#include <initializer_list>
#include <string>
#include <vector>

namespace cairn::app {

/// Writes the results of a command, one after the other. One that fails (a full disk) costs none of
/// the others: the first error is thrown at the end.
///
///     Results results;
///     results.write(options.output, [&] { write_graph(graph, options.output, registry); });
///     results.add([&] { session.print(…); });
///     results.finish();
class Results {
 public:
  /// Runs `write`, which writes `file`; does nothing if that is empty.
  void write(const std::string& file, const std::function<void()>& write);
  /// Runs what writes to other places, such as the report or standard output. False if it failed.
  bool add(const std::function<void()>& write);
  /// Those of the files that have been written, without standard output.
  std::vector<std::string> written(std::initializer_list<std::string> files) const;
  /// Throws the first error again. Those after it have been noted on standard error.
  void finish() const;

 private:
  std::exception_ptr first_;
  std::vector<std::string> written_;
};

}  // namespace cairn::app
