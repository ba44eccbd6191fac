// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <concepts>
#include <cstdint>
#include <functional>
#include <limits>
#include <stdexcept>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "cairn/plugin/options.hpp"
#include "cairn/runtime/enum_names.hpp"

namespace cairn {

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
  OptionFields& boolean(std::string name, bool Struct::*member, std::string help) {
    return add(
        make_spec(std::move(name), OptionType::boolean, std::move(help)), member,
        [](bool value) { return option_text(value); },
        [](const Options& from, const std::string& of) { return from.boolean(of); });
  }

  /// A whole number in [minimum, maximum]. Throws `std::logic_error` if the member cannot hold all
  /// of these.
  template <std::integral Integer>
  OptionFields& integer(std::string name, Integer Struct::*member, double minimum, double maximum,
                        std::string help) {
    using Limits = std::numeric_limits<Integer>;
    if (minimum < static_cast<double>(Limits::min()) ||
        maximum > static_cast<double>(Limits::max())) {
      throw std::logic_error("option '" + name + "' has a range that its member cannot hold");
    }
    OptionSpec field = make_spec(std::move(name), OptionType::integer, std::move(help));
    field.minimum = minimum;
    field.maximum = maximum;
    return add(
        std::move(field), member,
        [](Integer value) { return option_text(static_cast<std::int64_t>(value)); },
        [](const Options& from, const std::string& of) {
          return static_cast<Integer>(from.integer(of));
        });
  }

  /// A number in [minimum, maximum].
  OptionFields& real(std::string name, double Struct::*member, double minimum, double maximum,
                     std::string help) {
    OptionSpec field = make_spec(std::move(name), OptionType::real, std::move(help));
    field.minimum = minimum;
    field.maximum = maximum;
    return add(
        std::move(field), member, [](double value) { return option_text(value); },
        [](const Options& from, const std::string& of) { return from.real(of); });
  }

  /// Any text.
  OptionFields& text(std::string name, std::string Struct::*member, std::string help) {
    return add(make_spec(std::move(name), OptionType::text, std::move(help)), member, as_it_is,
               read_text);
  }

  /// Text with a form of its own: `parse` throws `Error` (usage) for what it cannot read, and
  /// `format` is its inverse.
  template <class Value>
  OptionFields& text(std::string name, Value Struct::*member,
                     std::type_identity_t<std::function<Value(const std::string&)>> parse,
                     std::type_identity_t<std::function<std::string(const Value&)>> format,
                     std::string help) {
    return add(make_spec(std::move(name), OptionType::text, std::move(help)), member,
               std::move(format),
               [parse = std::move(parse)](const Options& from, const std::string& of) {
                 return parse(from.text(of));
               });
  }

  /// One of the names of an enum.
  template <NamedEnum Enum>
  OptionFields& choice(std::string name, Enum Struct::*member, std::string help) {
    OptionSpec field = make_spec(std::move(name), OptionType::choice, std::move(help));
    field.choices = names_of_enum<Enum>();
    return add(
        std::move(field), member, [](Enum value) { return std::string(to_string(value)); },
        [](const Options& from, const std::string& of) {
          return find_enum<Enum>(from.text(of)).value();
        });
  }

  /// One of some texts.
  OptionFields& choice(std::string name, std::string Struct::*member,
                       std::vector<std::string> choices, std::string help) {
    OptionSpec field = make_spec(std::move(name), OptionType::choice, std::move(help));
    field.choices = std::move(choices);
    return add(std::move(field), member, as_it_is, read_text);
  }

  /// The name of a component of that interface's kind, with options (`name:key=value`), such as
  /// `to_text` makes of an options struct.
  template <class Interface>
  OptionFields& component(std::string name, std::string Struct::*member, std::string help) {
    OptionSpec field = make_spec(std::move(name), OptionType::component, std::move(help));
    field.choices = {std::string(Interface::kKind)};
    return add(std::move(field), member, as_it_is, read_text);
  }

  /// The fields of a member that is a struct, under the names that they have there.
  template <class Part>
  OptionFields& part(Part Struct::*member, const OptionFields<Part>& fields = Part::fields()) {
    for (const auto& inner : fields.fields_) {
      Field field;
      field.spec = inner.spec;
      field.format = [member, of_part = inner.format](const Struct& options) {
        return of_part(options.*member);
      };
      field.read = [member, of_part = inner.read](const Options& from, Struct& options) {
        of_part(from, options.*member);
      };
      fields_.push_back(std::move(field));
    }
    return *this;
  }

  /// What users see of the options; the defaults are those of `Struct{}`. Throws
  /// `std::logic_error` if two fields have one name.
  OptionTable table() const {
    const Struct defaults = Struct();
    OptionTable result;
    for (const Field& field : fields_) {
      OptionSpec entry = field.spec;
      entry.default_value = field.format(defaults);
      result.add(std::move(entry));
    }
    return result;
  }

  /// The struct of options that were checked against `table()`.
  Struct read(const Options& options) const {
    Struct result = Struct();
    for (const Field& field : fields_) field.read(options, result);
    return result;
  }

  /// Every field as text, by name.
  OptionValues values(const Struct& options) const {
    OptionValues result;
    for (const Field& field : fields_) result.emplace(field.spec.name, field.format(options));
    return result;
  }

 private:
  template <class>
  friend class OptionFields;

  struct Field {
    OptionSpec spec;  ///< without its default
    std::function<std::string(const Struct&)> format;
    std::function<void(const Options&, Struct&)> read;
  };

  static OptionSpec make_spec(std::string name, OptionType type, std::string help) {
    OptionSpec result;
    result.name = std::move(name);
    result.type = type;
    result.help = std::move(help);
    return result;
  }
  static std::string as_it_is(const std::string& value) { return value; }
  static std::string read_text(const Options& from, const std::string& of) { return from.text(of); }

  template <class Value, class Format, class Read>
  OptionFields& add(OptionSpec entry, Value Struct::*member, Format format_value, Read read_value) {
    Field field;
    field.format = [member, format_value = std::move(format_value)](const Struct& options) {
      return format_value(options.*member);
    };
    field.read = [member, read_value = std::move(read_value), name = entry.name](
                     const Options& from, Struct& options) {
      options.*member = read_value(from, name);
    };
    field.spec = std::move(entry);
    fields_.push_back(std::move(field));
    return *this;
  }

  std::vector<Field> fields_;
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
