// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/plugin/registry.hpp"

namespace cairn::fuzz {

using Bytes = std::span<const std::uint8_t>;

/// A guarantee that does not hold for an input; no target catches it. In a fuzzer it ends the
/// process with its message, in a test it is a failure.
class Finding : public std::logic_error {
 public:
  using std::logic_error::logic_error;
};

/// Throws `Finding` unless `holds`. `describe()` makes the message, and is called only then.
template <class Describe>
void expect(bool holds, const Describe& describe) {
  if (!holds) throw Finding(describe());
}

/// A component that a target needs, as the registry names it.
struct Needed {
  std::string_view kind;
  std::string_view name;
};

/// One kind of input that is not trusted, and what cairn guarantees for every input of that kind.
struct Target {
  std::string_view name;
  /// One execution. Throws `Finding` where a guarantee is broken; anything else that it throws, and
  /// any crash, is a finding as well. Depends on the bytes alone.
  void (*run)(Bytes bytes);
  /// Inputs that reach each part of what is tested: the corpus that a fuzzer starts from.
  std::vector<std::string> (*seeds)();
  /// Words that such inputs contain, for the dictionary of a fuzzer.
  std::vector<std::string> (*words)();
  std::vector<Needed> needs;
  int longest;  ///< input worth trying [bytes]
};

/// All targets.
const std::vector<Target>& targets();
/// The target of that name. Throws `std::out_of_range` if there is none.
const Target& target(std::string_view name);

/// One registry for the process, with the plugins of the build alone, so that nothing is loaded
/// more than once.
Registry& registry();

/// The bytes as text.
std::string_view text_of(Bytes bytes);

/// Reads decisions from an input; past its end all are zero.
class Source {
 public:
  explicit Source(Bytes bytes) : left_(bytes) {}

  bool empty() const { return left_.empty(); }
  std::uint8_t byte();
  /// 0 … count - 1; 0 where count is 0.
  int below(int count);
  /// -1 … 1, in steps of 1/127.
  double unit();
  /// Everything that has not been read.
  Bytes rest() const { return left_; }

 private:
  Bytes left_;
};

/// A folder for the files of this process, in memory where the system has that; removed when the
/// process ends.
const std::string& scratch_folder();

// The targets, each in the file of its name.
Target reader();
Target line_protocol();
Target policy_protocol();
Target journal();
Target packed_file();
Target sidecar();
Target recording();
Target option_text();
Target incremental();
Target grid();
Target scan_log();

}  // namespace cairn::fuzz
