// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/plugin/option_fields.hpp"

#include <stdexcept>

namespace cairn::detail {
namespace {

/// The member of a type at its place in a struct.
template <class Value>
const Value& as(const void* member) {
  return *static_cast<const Value*>(member);
}
template <class Value>
Value& as(void* member) {
  return *static_cast<Value*>(member);
}

}  // namespace

struct OptionFieldList::Field {
  OptionSpec spec;  ///< without its default
  std::ptrdiff_t place = 0;
  std::function<std::string(const void* member)> format;
  std::function<void(const Options& from, const std::string& name, void* member)> read;
};

OptionFieldList::OptionFieldList() = default;
OptionFieldList::OptionFieldList(const OptionFieldList& other) = default;
OptionFieldList::OptionFieldList(OptionFieldList&& other) noexcept = default;
OptionFieldList& OptionFieldList::operator=(const OptionFieldList& other) = default;
OptionFieldList& OptionFieldList::operator=(OptionFieldList&& other) noexcept = default;
OptionFieldList::~OptionFieldList() = default;

OptionFieldList::Field& OptionFieldList::add(std::string_view name, OptionType type,
                                             std::string_view help, std::ptrdiff_t place) {
  Field& field = fields_.emplace_back();
  field.spec.name = name;
  field.spec.type = type;
  field.spec.help = help;
  field.place = place;
  return field;
}

OptionFieldList::Field& OptionFieldList::add_text(std::string_view name, OptionType type,
                                                  std::string_view help, std::ptrdiff_t place) {
  Field& field = add(name, type, help, place);
  field.format = [](const void* member) { return as<std::string>(member); };
  field.read = [](const Options& from, const std::string& of, void* member) {
    as<std::string>(member) = from.text(of);
  };
  return field;
}

void OptionFieldList::boolean(std::string_view name, std::ptrdiff_t place, std::string_view help) {
  Field& field = add(name, OptionType::boolean, help, place);
  field.format = [](const void* member) { return option_text(as<bool>(member)); };
  field.read = [](const Options& from, const std::string& of, void* member) {
    as<bool>(member) = from.boolean(of);
  };
}

void OptionFieldList::integer(std::string_view name, std::ptrdiff_t place,
                              const IntegerAccess& access, double minimum, double maximum,
                              std::string_view help) {
  if (minimum < access.least || maximum > access.largest) {
    throw std::logic_error("option '" + std::string(name) +
                           "' has a range that its member cannot hold");
  }
  Field& field = add(name, OptionType::integer, help, place);
  field.spec.minimum = minimum;
  field.spec.maximum = maximum;
  field.format = [get = access.get](const void* member) { return option_text(get(member)); };
  field.read = [set = access.set](const Options& from, const std::string& of, void* member) {
    set(member, from.integer(of));
  };
}

void OptionFieldList::real(std::string_view name, std::ptrdiff_t place, double minimum,
                           double maximum, std::string_view help) {
  Field& field = add(name, OptionType::real, help, place);
  field.spec.minimum = minimum;
  field.spec.maximum = maximum;
  field.format = [](const void* member) { return option_text(as<double>(member)); };
  field.read = [](const Options& from, const std::string& of, void* member) {
    as<double>(member) = from.real(of);
  };
}

void OptionFieldList::text(std::string_view name, std::ptrdiff_t place, std::string_view help) {
  add_text(name, OptionType::text, help, place);
}

void OptionFieldList::text(std::string_view name, std::ptrdiff_t place, TextAccess access,
                           std::string_view help) {
  Field& field = add(name, OptionType::text, help, place);
  field.format = std::move(access.format);
  field.read = [parse = std::move(access.parse)](const Options& from, const std::string& of,
                                                 void* member) { parse(member, from.text(of)); };
}

void OptionFieldList::choice(std::string_view name, std::ptrdiff_t place, const EnumAccess& access,
                             std::string_view help) {
  Field& field = add(name, OptionType::choice, help, place);
  field.spec.choices = access.names();
  field.format = [get = access.get](const void* member) { return std::string(get(member)); };
  field.read = [set = access.set](const Options& from, const std::string& of, void* member) {
    set(member, from.text(of));
  };
}

void OptionFieldList::choice(std::string_view name, std::ptrdiff_t place,
                             std::vector<std::string> choices, std::string_view help) {
  add_text(name, OptionType::choice, help, place).spec.choices = std::move(choices);
}

void OptionFieldList::component(std::string_view name, std::ptrdiff_t place,
                                std::vector<std::string> kinds, bool several,
                                std::string_view help) {
  Field& field = add_text(name, OptionType::component, help, place);
  field.spec.choices = std::move(kinds);
  field.spec.components = several;
}

void OptionFieldList::optional_real(std::string_view name, std::ptrdiff_t place, double minimum,
                                    double maximum, std::string_view help) {
  using Member = std::optional<double>;
  real(name, place, minimum, maximum, help);
  Field& field = fields_.back();
  field.spec.optional = true;
  field.format = [](const void* member) {
    return as<Member>(member) ? option_text(*as<Member>(member)) : std::string();
  };
  field.read = [](const Options& from, const std::string& of, void* member) {
    as<Member>(member) = from.absent(of) ? Member() : Member(from.real(of));
  };
}

void OptionFieldList::optional_integer(std::string_view name, std::ptrdiff_t place, double minimum,
                                       double maximum, std::string_view help) {
  using Member = std::optional<std::int64_t>;
  Field& field = add(name, OptionType::integer, help, place);
  field.spec.minimum = minimum;
  field.spec.maximum = maximum;
  field.spec.optional = true;
  field.format = [](const void* member) {
    return as<Member>(member) ? option_text(*as<Member>(member)) : std::string();
  };
  field.read = [](const Options& from, const std::string& of, void* member) {
    as<Member>(member) = from.absent(of) ? Member() : Member(from.integer(of));
  };
}

void OptionFieldList::list(std::string_view name, std::ptrdiff_t place, OptionType type,
                           std::vector<std::string> kinds, std::string_view help) {
  using Member = std::vector<std::string>;
  Field& field = add(name, type, help, place);
  field.spec.choices = std::move(kinds);
  field.spec.list = true;
  field.format = [](const void* member) { return list_text(as<Member>(member)); };
  field.read = [](const Options& from, const std::string& of, void* member) {
    as<Member>(member) = split_list(from.text(of));
  };
}

void OptionFieldList::part(const OptionFieldList& fields, std::ptrdiff_t place) {
  for (Field field : fields.fields_) {
    field.place += place;
    fields_.push_back(std::move(field));
  }
}

OptionSpec& OptionFieldList::last() { return fields_.back().spec; }

OptionTable OptionFieldList::table(const void* defaults) const {
  OptionTable result;
  for (const Field& field : fields_) {
    OptionSpec entry = field.spec;
    entry.default_value = field.format(static_cast<const char*>(defaults) + field.place);
    result.add(std::move(entry));
  }
  return result;
}

void OptionFieldList::read(const Options& options, void* result) const {
  for (const Field& field : fields_)
    field.read(options, field.spec.name, static_cast<char*>(result) + field.place);
}

OptionValues OptionFieldList::values(const void* options) const {
  OptionValues result;
  for (const Field& field : fields_)
    result.emplace(field.spec.name, field.format(static_cast<const char*>(options) + field.place));
  return result;
}

}  // namespace cairn::detail
