// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <concepts>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "cairn/plugin/options.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/runtime/enum_names.hpp"

namespace cairn {

namespace detail {

/// Members of integer type, of any size.
struct IntegerAccess {
  double least, largest;
  std::int64_t (*get)(const void* member);
  void (*set)(void* member, std::int64_t value);
};
template <std::integral Integer>
constexpr IntegerAccess integer_access() {
  using Limits = std::numeric_limits<Integer>;
  return {static_cast<double>(Limits::min()), static_cast<double>(Limits::max()),
          [](const void* member) {
            return static_cast<std::int64_t>(*static_cast<const Integer*>(member));
          },
          [](void* member, std::int64_t value) {
            *static_cast<Integer*>(member) = static_cast<Integer>(value);
          }};
}

/// Members of an enum.
struct EnumAccess {
  std::vector<std::string> (*names)();
  std::string_view (*get)(const void* member);
  void (*set)(void* member, std::string_view name);
};
template <NamedEnum Enum>
constexpr EnumAccess enum_access() {
  return {names_of_enum<Enum>,
          [](const void* member) { return to_string(*static_cast<const Enum*>(member)); },
          [](void* member, std::string_view name) {
            *static_cast<Enum*>(member) = find_enum<Enum>(name).value();
          }};
}

/// Members whose text has a form of its own.
struct TextAccess {
  std::function<std::string(const void* member)> format;
  std::function<void(void* member, const std::string& text)> parse;
};

/// The fields of a struct whose type is not known here: a member is known by its place, the bytes
/// from the beginning of the struct to it. What each of the functions adds, and what it throws:
/// `OptionFields`.
class CAIRN_API OptionFieldList {
 public:
  OptionFieldList();
  OptionFieldList(const OptionFieldList& other);
  OptionFieldList(OptionFieldList&& other) noexcept;
  OptionFieldList& operator=(const OptionFieldList& other);
  OptionFieldList& operator=(OptionFieldList&& other) noexcept;
  ~OptionFieldList();

  void boolean(std::string_view name, std::ptrdiff_t place, std::string_view help);
  void integer(std::string_view name, std::ptrdiff_t place, const IntegerAccess& access,
               double minimum, double maximum, std::string_view help);
  void real(std::string_view name, std::ptrdiff_t place, double minimum, double maximum,
            std::string_view help);
  void text(std::string_view name, std::ptrdiff_t place, std::string_view help);
  void text(std::string_view name, std::ptrdiff_t place, TextAccess access, std::string_view help);
  void choice(std::string_view name, std::ptrdiff_t place, const EnumAccess& access,
              std::string_view help);
  void choice(std::string_view name, std::ptrdiff_t place, std::vector<std::string> choices,
              std::string_view help);
  void component(std::string_view name, std::ptrdiff_t place, std::vector<std::string> kinds,
                 bool several, std::string_view help);
  void optional_real(std::string_view name, std::ptrdiff_t place, double minimum, double maximum,
                     std::string_view help);
  void optional_integer(std::string_view name, std::ptrdiff_t place, double minimum, double maximum,
                        std::string_view help);
  /// A member of type std::vector<std::string>.
  void list(std::string_view name, std::ptrdiff_t place, OptionType type,
            std::vector<std::string> kinds, std::string_view help);
  void part(const OptionFieldList& fields, std::ptrdiff_t place);

  /// The option that was added last, without its default. Precondition: there is one.
  OptionSpec& last();

  OptionTable table(const void* defaults) const;
  void read(const Options& options, void* result) const;
  OptionValues values(const void* options) const;

 private:
  struct Field;
  Field& add(std::string_view name, OptionType type, std::string_view help, std::ptrdiff_t place);
  Field& add_text(std::string_view name, OptionType type, std::string_view help,
                  std::ptrdiff_t place);

  std::vector<Field> fields_;
};

}  // namespace detail

/// The options of a component, declared once: a struct, whose members have the defaults, and its
/// function `fields`, which adds to each member its name, its range and a line of help.
///
///     struct DenseOptions {
///       std::int64_t max_size = 8000;  ///< scalars beyond which it refuses
///       std::string linear_solver = "block_cholesky";
///       static auto fields() {
///         return OptionFields<DenseOptions>()
///             .integer("max_size", &DenseOptions::max_size, 1, 46000, "scalars beyond which …")
///             .component<LinearSolver>("linear_solver", &DenseOptions::linear_solver,
///                                      "solves …");
///       }
///     };
///
/// From it follow the `OptionTable` (checks, help), the struct of checked `Options`, and the text
/// of a struct. Options that several components share are a struct of their own, and a `part` of
/// each of theirs. The order of the fields is that of the help.
template <class Struct>
class OptionFields {
 public:
  OptionFields& boolean(std::string_view name, bool Struct::*member, std::string_view help) {
    fields_.boolean(name, place_of(member), help);
    return *this;
  }

  /// A whole number in [minimum, maximum]. Throws `std::logic_error` if the member cannot hold all
  /// of these.
  template <std::integral Integer>
  OptionFields& integer(std::string_view name, Integer Struct::*member, double minimum,
                        double maximum, std::string_view help) {
    fields_.integer(name, place_of(member), detail::integer_access<Integer>(), minimum, maximum,
                    help);
    return *this;
  }

  /// A number in [minimum, maximum].
  OptionFields& real(std::string_view name, double Struct::*member, double minimum, double maximum,
                     std::string_view help) {
    fields_.real(name, place_of(member), minimum, maximum, help);
    return *this;
  }

  /// Any text.
  OptionFields& text(std::string_view name, std::string Struct::*member, std::string_view help) {
    fields_.text(name, place_of(member), help);
    return *this;
  }

  /// Text with a form of its own: `parse` throws `Error` (usage) for what it cannot read, and
  /// `format` is its inverse.
  template <class Value>
  OptionFields& text(std::string_view name, Value Struct::*member,
                     std::type_identity_t<std::function<Value(const std::string&)>> parse,
                     std::type_identity_t<std::function<std::string(const Value&)>> format,
                     std::string_view help) {
    fields_.text(name, place_of(member),
                 {[format = std::move(format)](const void* value) {
                    return format(*static_cast<const Value*>(value));
                  },
                  [parse = std::move(parse)](void* value, const std::string& text) {
                    *static_cast<Value*>(value) = parse(text);
                  }},
                 help);
    return *this;
  }

  /// One of the names of an enum.
  template <NamedEnum Enum>
  OptionFields& choice(std::string_view name, Enum Struct::*member, std::string_view help) {
    fields_.choice(name, place_of(member), detail::enum_access<Enum>(), help);
    return *this;
  }

  /// One of some texts.
  OptionFields& choice(std::string_view name, std::string Struct::*member,
                       std::vector<std::string> choices, std::string_view help) {
    fields_.choice(name, place_of(member), std::move(choices), help);
    return *this;
  }

  /// The name of a component of that interface's kind, with options (`name:key=value`), such as
  /// `to_text` makes of an options struct.
  template <class Interface>
  OptionFields& component(std::string_view name, std::string Struct::*member,
                          std::string_view help) {
    return component(name, member, {std::string(Interface::kKind)}, help);
  }
  /// Of one of several kinds; of any without one.
  OptionFields& component(std::string_view name, std::string Struct::*member,
                          std::vector<std::string> kinds, std::string_view help) {
    fields_.component(name, place_of(member), std::move(kinds), false, help);
    return *this;
  }
  /// Several of them in one text, `A,B` (`split_components`).
  OptionFields& components(std::string_view name, std::string Struct::*member,
                           std::vector<std::string> kinds, std::string_view help) {
    fields_.component(name, place_of(member), std::move(kinds), true, help);
    return *this;
  }

  /// The same fields of the same struct, declared elsewhere.
  OptionFields& all_of(const OptionFields& fields) {
    fields_.part(fields.fields_, 0);
    return *this;
  }

  // Of commands, whose options are many: numbers that may be absent, and lists.
  OptionFields& real(std::string_view name, std::optional<double> Struct::*member, double minimum,
                     double maximum, std::string_view help) {
    fields_.optional_real(name, place_of(member), minimum, maximum, help);
    return *this;
  }
  OptionFields& integer(std::string_view name, std::optional<std::int64_t> Struct::*member,
                        double minimum, double maximum, std::string_view help) {
    fields_.optional_integer(name, place_of(member), minimum, maximum, help);
    return *this;
  }
  OptionFields& text(std::string_view name, std::vector<std::string> Struct::*member,
                     std::string_view help) {
    fields_.list(name, place_of(member), OptionType::text, {}, help);
    return *this;
  }
  OptionFields& component(std::string_view name, std::vector<std::string> Struct::*member,
                          std::vector<std::string> kinds, std::string_view help) {
    fields_.list(name, place_of(member), OptionType::component, std::move(kinds), help);
    return *this;
  }
  /// A list, each item of which may hold several.
  OptionFields& components(std::string_view name, std::vector<std::string> Struct::*member,
                           std::vector<std::string> kinds, std::string_view help) {
    component(name, member, std::move(kinds), help);
    fields_.last().components = true;
    return *this;
  }

  // What follows is of the option before it -------------------------------------------------------
  /// A number may be zero besides, which stands for no limit.
  OptionFields& or_zero() {
    fields_.last().or_zero = true;
    return *this;
  }
  /// A choice may be left out: the empty text.
  OptionFields& optional() {
    fields_.last().optional = true;
    return *this;
  }
  /// Of a text: values that completion offers.
  OptionFields& suggest(std::vector<std::string> values) {
    fields_.last().choices = std::move(values);
    return *this;
  }
  // How it stands on a command line (`CommandLineForm`).
  OptionFields& placeholder(std::string_view text) {
    fields_.last().form.placeholder = text;
    return *this;
  }
  OptionFields& letter(char letter) {
    fields_.last().form.letter = letter;
    return *this;
  }
  OptionFields& positional(bool named = false) {
    fields_.last().form.positional = true;
    fields_.last().form.named = named;
    return *this;
  }
  OptionFields& required() {
    fields_.last().form.required = true;
    return *this;
  }
  OptionFields& takes_words() {
    fields_.last().form.takes_words = true;
    return *this;
  }
  OptionFields& separated_by(char separator) {
    fields_.last().form.separator = separator;
    return *this;
  }
  OptionFields& or_generated_by(std::vector<std::string> kinds) {
    fields_.last().form.generators = std::move(kinds);
    return *this;
  }

  /// The fields of a member that is a struct, under the names that they have there.
  template <class Part>
  OptionFields& part(Part Struct::*member, const OptionFields<Part>& fields = Part::fields()) {
    fields_.part(fields.fields_, place_of(member));
    return *this;
  }

  /// What users see of the options; the defaults are those of `Struct{}`. Throws
  /// `std::logic_error` if two fields have one name.
  OptionTable table() const { return fields_.table(&defaults_); }

  /// The struct of options that were checked against `table()`.
  Struct read(const Options& options) const {
    Struct result = Struct();
    fields_.read(options, &result);
    return result;
  }

  /// Every field as text, by name.
  OptionValues values(const Struct& options) const { return fields_.values(&options); }

 private:
  template <class>
  friend class OptionFields;

  template <class Value>
  std::ptrdiff_t place_of(Value Struct::*member) const {
    return reinterpret_cast<const char*>(&(defaults_.*member)) -
           reinterpret_cast<const char*>(&defaults_);
  }

  detail::OptionFieldList fields_;
  Struct defaults_ = Struct();
};

/// A struct that declares its options.
template <class Struct>
concept OptionStruct = std::default_initializable<Struct> && requires {
  { Struct::fields() } -> std::same_as<OptionFields<Struct>>;
};

/// The component of that name with these options, all of them given: what `Registry::make` takes.
/// Nothing is checked here; making the component does.
template <OptionStruct Struct>
ComponentSpec to_spec(std::string_view name, const Struct& options) {
  return {std::string(name), Struct::fields().values(options)};
}

/// The same as text, `name:key=value,key=value`, with the options that differ from the struct's
/// defaults: what a field for a component takes. Throws `Error` (usage) for what that form cannot
/// hold (`to_text` of a `ComponentSpec`).
template <OptionStruct Struct>
std::string to_text(std::string_view name, const Struct& options) {
  const OptionFields<Struct> fields = Struct::fields();
  const OptionValues defaults = fields.values(Struct());
  ComponentSpec spec{std::string(name), fields.values(options)};
  std::erase_if(spec.values,
                [&](const auto& value) { return value == *defaults.find(value.first); });
  return to_text(spec);
}

/// The struct of option values as they were written. Throws `Error` (usage) as `Options` does.
template <OptionStruct Struct>
Struct from_values(const OptionValues& values, std::string_view owner) {
  const OptionFields<Struct> fields = Struct::fields();
  return fields.read(Options(fields.table(), values, owner));
}

}  // namespace cairn
