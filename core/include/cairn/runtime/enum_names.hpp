// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "cairn/runtime/error.hpp"
#include "cairn/text/spelling.hpp"

namespace cairn {

/// One value of an enum, and the name that users write for it.
template <class Enum>
struct EnumName {
  Enum value;
  std::string_view name;
};

/// An enum with names. Beside it, in its namespace, stands the one table of them, every value once
/// and in the order in which they are listed for users:
///
///     enum class Ordering { amd, natural };
///     constexpr auto enum_names(Ordering) {
///       return std::to_array<EnumName<Ordering>>(
///           {{Ordering::amd, "amd"}, {Ordering::natural, "natural"}});
///     }
///
/// `to_string`, `find_enum` and `parse_enum` follow from it, and the choices of an option of that
/// type (`OptionFields::choice`).
template <class Enum>
concept NamedEnum = std::is_enum_v<Enum> && requires(Enum value) {
  enum_names(value);
};

/// The name of a value. Throws `std::logic_error` for a value that the table leaves out.
template <NamedEnum Enum>
constexpr std::string_view to_string(Enum value) {
  for (const EnumName<Enum>& entry : enum_names(value)) {
    if (entry.value == value) return entry.name;
  }
  throw std::logic_error("a value of an enum has no name");
}

/// All names, in the order of the table.
template <NamedEnum Enum>
std::vector<std::string> names_of_enum() {
  std::vector<std::string> names;
  for (const EnumName<Enum>& entry : enum_names(Enum{})) names.emplace_back(entry.name);
  return names;
}

/// The value of that name, if there is one.
template <NamedEnum Enum>
constexpr std::optional<Enum> find_enum(std::string_view name) {
  for (const EnumName<Enum>& entry : enum_names(Enum{})) {
    if (entry.name == name) return entry.value;
  }
  return std::nullopt;
}

/// The value of that name. Throws `Error` (usage) with the nearest spelling and the names there
/// are; `what` begins the message, such as "the recovery".
template <NamedEnum Enum>
Enum parse_enum(std::string_view name, std::string_view what) {
  if (const std::optional<Enum> value = find_enum<Enum>(name)) return *value;
  throw Error(ErrorCode::usage, std::string(what) + " cannot be '" + std::string(name) + "'" +
                                    what_is_on_offer(name, names_of_enum<Enum>()));
}

}  // namespace cairn
