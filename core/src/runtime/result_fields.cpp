// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/runtime/result_fields.hpp"

#include <algorithm>
#include <stdexcept>

namespace cairn {
namespace {

std::size_t place_of(const std::vector<ResultField>& fields, std::string_view name) {
  const auto found = std::ranges::find(fields, name, &ResultField::name);
  if (found == fields.end())
    throw std::logic_error("no field of the result is called '" + std::string(name) + "'");
  return static_cast<std::size_t>(found - fields.begin());
}

std::string under(std::string_view part, const std::string& name) {
  return part.empty() || name.empty() ? std::string(part) + name : std::string(part) + "." + name;
}

}  // namespace

std::size_t ResultRecord::find(std::string_view name) const { return place_of(*fields, name); }

namespace detail {

void ResultFieldList::add(std::string_view name, ResultType type, bool may_be_missing,
                          std::string_view unit, std::string_view help, Read read) {
  if (std::ranges::find(fields_, name, &ResultField::name) != fields_.end())
    throw std::logic_error("two fields of a result are called '" + std::string(name) + "'");
  ResultField& field = fields_.emplace_back();
  field.name = name;
  field.unit = unit;
  field.help = help;
  field.type = type;
  field.may_be_missing = may_be_missing;
  // A list or a struct is no row of a table.
  field.is_detail = type >= ResultType::record;
  reads_.push_back(std::move(read));
  first_ = last_ = fields_.size() - 1;
}

void ResultFieldList::part(std::string_view name, std::string_view attribute,
                           const ResultFieldList& fields, const ReadPart& part,
                           bool may_be_missing) {
  const std::size_t first = fields_.size();
  for (std::size_t k = 0; k < fields.fields_.size(); ++k) {
    const ResultField& from = fields.fields_[k];
    add(under(name, from.name), from.type, from.may_be_missing || may_be_missing, from.unit,
        from.help,
        [part, read = fields.reads_[k]](const void* result) { return part(result, read); });
    ResultField& field = fields_.back();
    ResultField copy = from;
    copy.name = field.name;
    copy.may_be_missing = field.may_be_missing;
    copy.attribute = under(attribute, from.attribute.empty() ? from.name : from.attribute);
    if (may_be_missing) {
      copy.record = name;
    } else if (!from.record.empty()) {
      copy.record = under(name, from.record);
    }
    field = std::move(copy);
  }
  first_ = first;
}

ResultField& ResultFieldList::at(std::string_view name) {
  first_ = last_ = place_of(fields_, name);
  return last();
}

void ResultFieldList::move_before(std::string_view name) {
  const auto to = static_cast<std::ptrdiff_t>(place_of(fields_, name));
  const auto from = static_cast<std::ptrdiff_t>(last_);
  const auto turn = [&](auto& all) {
    if (to < from) {
      std::rotate(all.begin() + to, all.begin() + from, all.begin() + from + 1);
    } else {
      std::rotate(all.begin() + from, all.begin() + from + 1, all.begin() + to);
    }
  };
  turn(fields_);
  turn(reads_);
  first_ = last_ = static_cast<std::size_t>(to < from ? to : to - 1);
}

void ResultFieldList::drop(std::string_view name) {
  const std::string prefix = std::string(name) + ".";
  for (std::size_t k = fields_.size(); k-- > 0;) {
    if (fields_[k].name != name && !fields_[k].name.starts_with(prefix)) continue;
    fields_.erase(fields_.begin() + static_cast<std::ptrdiff_t>(k));
    reads_.erase(reads_.begin() + static_cast<std::ptrdiff_t>(k));
  }
  first_ = last_ = fields_.empty() ? 0 : fields_.size() - 1;
}

void ResultFieldList::details() {
  for (ResultField& field : fields_) field.is_detail = true;
}

ResultRecord ResultFieldList::values(const void* result) const {
  ResultRecord record{&fields_, {}};
  record.values.reserve(reads_.size());
  for (const Read& read : reads_) record.values.push_back(read(result));
  return record;
}

}  // namespace detail
}  // namespace cairn
