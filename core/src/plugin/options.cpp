// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/plugin/options.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

#include "cairn/runtime/error.hpp"
#include "cairn/text/spelling.hpp"

namespace cairn {
namespace {

std::string range_text(const OptionSpec& spec) {
  const bool low = std::isfinite(spec.minimum), high = std::isfinite(spec.maximum);
  const char* const or_zero = spec.or_zero ? ", or 0" : "";
  if (low && high) return fmt::format("{} to {}{}", spec.minimum, spec.maximum, or_zero);
  if (low) return fmt::format("at least {}{}", spec.minimum, or_zero);
  if (high) return fmt::format("at most {}{}", spec.maximum, or_zero);
  return "any";
}

std::string expectation(const OptionSpec& spec) {
  switch (spec.type) {
    case OptionType::boolean:
      return "true or false";
    case OptionType::integer:
      return "an integer, " + range_text(spec);
    case OptionType::real:
      return "a number, " + range_text(spec);
    case OptionType::choice:
      return fmt::format("one of {}", fmt::join(spec.choices, ", "));
    case OptionType::component:
      return spec.choices.empty() ? "the name of a component"
                                  : fmt::format("a name of kind {}", fmt::join(spec.choices, ", "));
    case OptionType::text:
      break;
  }
  return "text";
}

[[noreturn]] void refuse(std::string_view owner, const OptionSpec& spec, const std::string& text) {
  throw Error(ErrorCode::usage, fmt::format("{}: option '{}' is '{}', expected {}", owner,
                                            spec.name, text, expectation(spec)));
}

template <class T>
bool parse_whole(const std::string& text, T& value) {
  const char* begin = text.data() + (text.starts_with('+') ? 1 : 0);
  const auto [end, error] = std::from_chars(begin, text.data() + text.size(), value);
  return error == std::errc() && end == text.data() + text.size();
}

std::vector<std::string> names(const OptionTable& table) {
  std::vector<std::string> result;
  for (const OptionSpec& spec : table.specs()) result.push_back(spec.name);
  return result;
}

}  // namespace

std::string option_text(bool value) { return value ? "true" : "false"; }
std::string option_text(std::int64_t value) { return fmt::format("{}", value); }
std::string option_text(double value) { return fmt::format("{}", value); }

std::string list_text(const std::vector<std::string>& items) {
  std::string text;
  for (const std::string& item : items) {
    if (!text.empty()) text += '\0';
    text += item;
  }
  return text;
}

std::vector<std::string> split_list(std::string_view text) {
  std::vector<std::string> items;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\0'), text.size());
    items.emplace_back(text.substr(0, end));
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  return items;
}

OptionTable& OptionTable::add(OptionSpec spec) {
  if (find(spec.name))
    throw std::logic_error(fmt::format("option '{}' is declared twice", spec.name));
  specs_.push_back(std::move(spec));
  return *this;
}

OptionTable& OptionTable::boolean(std::string name, bool default_value, std::string help) {
  return add({.name = std::move(name),
              .type = OptionType::boolean,
              .default_value = option_text(default_value),
              .help = std::move(help)});
}

OptionTable& OptionTable::integer(std::string name, std::int64_t default_value, double minimum,
                                  double maximum, std::string help) {
  return add({.name = std::move(name),
              .type = OptionType::integer,
              .default_value = option_text(default_value),
              .help = std::move(help),
              .minimum = minimum,
              .maximum = maximum});
}

OptionTable& OptionTable::real(std::string name, double default_value, double minimum,
                               double maximum, std::string help) {
  return add({.name = std::move(name),
              .type = OptionType::real,
              .default_value = option_text(default_value),
              .help = std::move(help),
              .minimum = minimum,
              .maximum = maximum});
}

OptionTable& OptionTable::text(std::string name, std::string default_value, std::string help) {
  return add({.name = std::move(name),
              .type = OptionType::text,
              .default_value = std::move(default_value),
              .help = std::move(help)});
}

OptionTable& OptionTable::choice(std::string name, std::string default_value,
                                 std::vector<std::string> choices, std::string help) {
  return add({.name = std::move(name),
              .type = OptionType::choice,
              .default_value = std::move(default_value),
              .help = std::move(help),
              .choices = std::move(choices)});
}

OptionTable& OptionTable::component(std::string name, std::string kind, std::string default_value,
                                    std::string help) {
  return add({.name = std::move(name),
              .type = OptionType::component,
              .default_value = std::move(default_value),
              .help = std::move(help),
              .choices = {std::move(kind)}});
}

const OptionSpec* OptionTable::find(std::string_view name) const {
  const auto it = std::ranges::find(specs_, name, &OptionSpec::name);
  return it == specs_.end() ? nullptr : &*it;
}

std::string OptionTable::help(std::string_view indent) const {
  std::string text;
  for (const OptionSpec& spec : specs_) {
    text += fmt::format("{}{}={}  {} ({})\n", indent, spec.name, spec.default_value, spec.help,
                        expectation(spec));
  }
  return text;
}

Options::Options(const OptionTable& table, const OptionValues& values, std::string_view owner) {
  for (const auto& [name, text] : values) {
    if (table.find(name)) continue;
    const std::vector<std::string> known = names(table);
    throw Error(ErrorCode::usage,
                known.empty() ? fmt::format("{} takes no options, but '{}' was given", owner, name)
                              : fmt::format("{} has no option '{}'{}", owner, name,
                                            what_is_on_offer(name, known)));
  }
  for (const OptionSpec& spec : table.specs()) {
    Value value{.type = spec.type, .text = spec.default_value};
    if (const auto it = values.find(spec.name); it != values.end()) {
      value.text = it->second;
      value.given = true;
    }
    const std::string& text = value.text;
    value.absent = spec.optional && text.empty();
    if (value.absent) {
      values_.emplace(spec.name, std::move(value));
      continue;
    }
    switch (spec.type) {
      case OptionType::boolean:
        if (text != "true" && text != "false" && text != "1" && text != "0" && text != "yes" &&
            text != "no") {
          refuse(owner, spec, text);
        }
        value.whole = text == "true" || text == "1" || text == "yes";
        break;
      case OptionType::integer:
        if (!parse_whole(text, value.whole)) refuse(owner, spec, text);
        value.number = static_cast<double>(value.whole);
        break;
      case OptionType::real:
        if (!parse_whole(text, value.number) || std::isnan(value.number)) refuse(owner, spec, text);
        break;
      case OptionType::choice:
        if (std::ranges::find(spec.choices, text) == spec.choices.end()) {
          throw Error(ErrorCode::usage,
                      fmt::format("{}: option '{}' cannot be '{}'{}", owner, spec.name, text,
                                  what_is_on_offer(text, spec.choices)));
        }
        break;
      case OptionType::component:
      case OptionType::text:
        break;
    }
    if ((spec.type == OptionType::integer || spec.type == OptionType::real) &&
        (value.number < spec.minimum || value.number > spec.maximum) &&
        !(spec.or_zero && value.number == 0.0)) {
      refuse(owner, spec, text);
    }
    values_.emplace(spec.name, std::move(value));
  }
}

const Options::Value& Options::value(std::string_view name, OptionType type) const {
  const auto it = values_.find(name);
  if (it == values_.end()) throw std::logic_error(fmt::format("no option '{}' was declared", name));
  const bool text_like = type == OptionType::text && (it->second.type == OptionType::choice ||
                                                      it->second.type == OptionType::component);
  if (it->second.type != type && !text_like) {
    throw std::logic_error(fmt::format("option '{}' was declared with another type", name));
  }
  return it->second;
}

bool Options::boolean(std::string_view name) const {
  return value(name, OptionType::boolean).whole != 0;
}
std::int64_t Options::integer(std::string_view name) const {
  return value(name, OptionType::integer).whole;
}
double Options::real(std::string_view name) const { return value(name, OptionType::real).number; }
const std::string& Options::text(std::string_view name) const {
  return value(name, OptionType::text).text;
}

bool Options::absent(std::string_view name) const {
  const auto it = values_.find(name);
  return it != values_.end() && it->second.absent;
}

bool Options::given(std::string_view name) const {
  const auto it = values_.find(name);
  return it != values_.end() && it->second.given;
}

std::string spec_text(const ComponentSpec& spec) {
  std::string text = spec.name;
  for (const auto& [name, value] : spec.values)
    text += fmt::format("{}{}={}", text.size() == spec.name.size() ? ":" : ",", name, value);
  return text;
}

ComponentSpec parse_component(std::string_view text) {
  const auto malformed = [&](std::string_view why) {
    return Error(ErrorCode::usage,
                 fmt::format("'{}' {}; the form is name or name:key=value,key=value", text, why));
  };
  ComponentSpec spec;
  const std::size_t colon = text.find(':');
  spec.name = std::string(text.substr(0, colon));
  if (spec.name.empty()) throw malformed("has no name");
  if (colon == std::string_view::npos) return spec;
  std::string_view rest = text.substr(colon + 1);
  if (rest.empty()) throw malformed("ends after the colon");
  while (!rest.empty()) {
    const std::size_t comma = rest.find(',');
    const std::string_view pair = rest.substr(0, comma);
    const std::size_t equals = pair.find('=');
    if (equals == std::string_view::npos || equals == 0)
      throw malformed(fmt::format("has '{}' where key=value belongs", pair));
    const auto [it, added] = spec.values.emplace(pair.substr(0, equals), pair.substr(equals + 1));
    if (!added) throw malformed(fmt::format("gives '{}' twice", it->first));
    if (comma == std::string_view::npos) break;
    rest.remove_prefix(comma + 1);
    if (rest.empty()) throw malformed("ends with a comma");
  }
  return spec;
}

std::string to_text(const ComponentSpec& spec) {
  if (spec.name.empty() || spec.name.find(':') != std::string::npos)
    throw Error(ErrorCode::usage, fmt::format("'{}' is not a name of a component", spec.name));
  std::string text = spec.name;
  char before = ':';
  for (const auto& [name, value] : spec.values) {
    if (value.find(',') != std::string::npos) {
      throw Error(ErrorCode::usage,
                  fmt::format("{}: option '{}' is '{}'; the form name:key=value,key=value cannot "
                              "hold a value with a comma",
                              spec.name, name, value));
    }
    text += fmt::format("{}{}={}", before, name, value);
    before = ',';
  }
  return text;
}

std::vector<std::string> split_components(std::string_view text) {
  std::vector<std::string> result;
  while (true) {
    const std::size_t comma = text.find(',');
    const std::string_view part = text.substr(0, comma);
    const std::size_t equals = part.find('=');
    const bool continues = equals != std::string_view::npos &&
                           part.substr(0, equals).find(':') == std::string_view::npos;
    if (continues && !result.empty()) {
      result.back().append(",").append(part);
    } else {
      result.emplace_back(part);
    }
    if (comma == std::string_view::npos) return result;
    text.remove_prefix(comma + 1);
  }
}

}  // namespace cairn
