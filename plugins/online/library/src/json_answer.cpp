// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/online/json_answer.hpp"

#include <algorithm>
#include <span>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <boost/json/serialize.hpp>
#include <boost/json/value.hpp>

#include "escaped_bytes.hpp"

namespace cairn {
namespace {

using Words = std::vector<std::string_view>;

std::string quoted(std::string_view text) {
  const std::string valid = escaped_bytes(text);
  return boost::json::serialize(boost::json::string_view(valid.data(), valid.size()));
}

/// By the grammar of RFC 8259, section 6.
bool is_json_number(std::string_view word) {
  const auto take_digits = [&] {
    const std::size_t count = std::min(word.find_first_not_of("0123456789"), word.size());
    word.remove_prefix(count);
    return count;
  };
  if (word.starts_with('-')) word.remove_prefix(1);
  const bool begins_with_zero = word.starts_with('0');
  const std::size_t whole = take_digits();
  if (whole == 0 || (begins_with_zero && whole > 1)) return false;
  if (word.starts_with('.')) {
    word.remove_prefix(1);
    if (take_digits() == 0) return false;
  }
  if (word.starts_with('e') || word.starts_with('E')) {
    word.remove_prefix(1);
    if (word.starts_with('+') || word.starts_with('-')) word.remove_prefix(1);
    if (take_digits() == 0) return false;
  }
  return word.empty();
}

/// A number as it is, and every other word as a string.
std::string value_of(std::string_view word) {
  if (is_json_number(word)) return std::string(word);
  const std::string_view magnitude = word.substr(word.starts_with('-') ? 1 : 0);
  return magnitude == "inf" || magnitude == "nan" ? "null" : quoted(word);
}

std::string array_of(std::span<const std::string_view> words) {
  std::vector<std::string> values;
  for (const std::string_view word : words) values.push_back(value_of(word));
  return fmt::format("[{}]", fmt::join(values, ","));
}

Words split(std::string_view line) {
  Words words;
  for (std::size_t at = 0; (at = line.find_first_not_of(' ', at)) != std::string_view::npos;) {
    const std::size_t end = std::min(line.find(' ', at), line.size());
    words.push_back(line.substr(at, end - at));
    at = end;
  }
  return words;
}

class Object {
 public:
  explicit Object(const IsVariableType& is_variable_type) : is_variable_type_(is_variable_type) {}

  void add_line(std::string_view line) {
    const Words words = split(line);
    if (words.empty()) return;
    const std::string_view word = words[0];
    const std::span<const std::string_view> rest = std::span(words).subspan(1);
    if (word == "NOTE") return add_to("notes", quoted(line.substr(std::min(line.size(), 5UL))));
    if (word == "ERROR" && words.size() > 2) return add_error(line, words);
    if (words.size() > 3 && words[2] == "variables") return add_end(words);
    if (words.size() == 2 && (word == "UPDATE" || word == "CHI2" || word == "KLD"))
      return add(word == "UPDATE" ? "update" : word == "CHI2" ? "chi2" : "kld", value_of(words[1]));
    if (word == "REMOVED") return add_to("removed", value_of(rest.empty() ? "" : rest[0]));
    if (word == "PRIOR" && words.size() == 2) return add_to("priors", value_of(words[1]));
    if (word == "FACTOR" && words.size() > 2)
      return add_to("new_factors", fmt::format(R"({{"factor":{},"ids":{}}})", value_of(rest[0]),
                                               array_of(rest.subspan(1))));
    if (word == "COVARIANCE" && words.size() > 4)
      return add_to("covariances", fmt::format(R"({{"ids":{},"rows":{},"columns":{},"values":{}}})",
                                               array_of(rest.first(2)), value_of(rest[2]),
                                               value_of(rest[3]), array_of(rest.subspan(4))));
    if (words.size() > 1 && is_variable_type_(word))
      return add_to("estimates", fmt::format(R"({{"type":{},"id":{},"state":{}}})", quoted(word),
                                             value_of(rest[0]), array_of(rest.subspan(1))));
    add_to("results", array_of(words));
  }

  std::string text() const {
    std::vector<std::string> all;
    for (const auto& [name, values] : lists_)
      all.push_back(fmt::format(R"("{}":[{}])", name, fmt::join(values, ",")));
    all.insert(all.begin(), members_.begin(), members_.end());
    return fmt::format("{{{}}}\n", fmt::join(all, ","));
  }

 private:
  void add(std::string_view name, const std::string& value) {
    members_.push_back(fmt::format(R"("{}":{})", name, value));
  }
  void add_to(std::string_view name, std::string value) {
    auto list = std::ranges::find(lists_, name, [](const auto& one) { return one.first; });
    if (list == lists_.end()) list = lists_.insert(list, {name, {}});
    list->second.push_back(std::move(value));
  }
  /// "ERROR line 12: …"
  void add_error(std::string_view line, const Words& words) {
    std::string_view number = words[2];
    const auto reason = static_cast<std::size_t>(number.data() - line.data()) + number.size() + 1;
    if (number.ends_with(':')) number.remove_suffix(1);
    add("answer", quoted("ERROR"));
    add("line", value_of(number));
    add("message", quoted(line.substr(std::min(line.size(), reason))));
  }
  /// "OK 12 variables 4 factors 4 owed 0", "WRITER 12 variables 4 factors 4"
  void add_end(const Words& words) {
    add("answer", quoted(words[0]));
    add("line", value_of(words[1]));
    for (std::size_t k = 2; k + 1 < words.size(); k += 2) add(words[k], value_of(words[k + 1]));
  }

  const IsVariableType& is_variable_type_;
  std::vector<std::string> members_;
  std::vector<std::pair<std::string_view, std::vector<std::string>>> lists_;
};

}  // namespace

std::string json_answer(std::string_view text, const IsVariableType& is_variable_type) {
  if (text.empty()) return {};
  Object object(is_variable_type);
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = std::min(text.find('\n', at), text.size());
    object.add_line(text.substr(at, end - at));
    at = end + 1;
  }
  return object.text();
}

}  // namespace cairn
