// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/graph/graph.hpp"
#include "cairn/graph/update.hpp"
#include "cairn/io/format.hpp"
#include "cairn/runtime/component.hpp"

namespace cairn {

class Registry;

/// What one line of a stream says: at most one of these.
struct StreamLine {
  std::vector<Variable> variables;
  std::vector<Factor> factors;
  std::vector<Id> held;            ///< variables to be held fixed
  bool skipped = false;            ///< its tag is unknown, and such lines are to be left out
  std::vector<std::string> notes;  ///< what reading it changed, a sentence each
};

/// A text format that can be read line by line as it comes, without knowing what follows. One
/// object reads one stream: it remembers what later lines refer to, such as the offsets of sensors.
class CAIRN_API StreamFormat : public Component {
 public:
  static constexpr std::string_view kKind = "stream_format";
  ~StreamFormat() override;

  /// What a line says; nothing where it is blank, a comment, or only to be remembered. Types come
  /// from the registry by tag. Throws `Error` (input) with `name` and `number` (of the line, from
  /// 1), in the words of the format's reader of files; the line then counts as not read.
  virtual StreamLine read(std::string_view line, const std::string& name, std::int64_t number,
                          Registry& types, const ReadOptions& options) = 0;

  /// Words that begin lines of the same stream and are not for `read`, such as the commands of
  /// `cairn online`. What it says of an unknown tag suggests one of these, too.
  void add_other_words(std::span<const std::string> words) {
    other_words_.insert(other_words_.end(), words.begin(), words.end());
  }

 protected:
  const std::vector<std::string>& other_words() const { return other_words_; }

 private:
  std::vector<std::string> other_words_;
};

}  // namespace cairn
