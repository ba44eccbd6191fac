// SPDX-License-Identifier: BSD-3-Clause
#include "tag_lines.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/core.h>
#include <fmt/ranges.h>

#include "cairn/runtime/error.hpp"
#include "cairn/text/spelling.hpp"
#include "euler_angles.hpp"

namespace cairn::formats {

void read_fix(Scanner& scanner, Draft& draft) {
  scanner.expect({});
  if (!scanner.more()) scanner.fail("FIX without an id; expected one or more ids");
  while (scanner.more()) draft.add_held(scanner.read_id(), scanner.line());
}

namespace {

/// Tags of g2o that are not read, and what is to be written instead.
constexpr std::array<std::pair<std::string_view, std::string_view>, 1> kInstead{
    {{"EDGE_BEARING_SE2_XY",
      "EDGE_BEARING_RANGE_SE2_XY with information 0 of the range (bearing, any range, I11 0 0)"}}};

std::string remedy(std::string_view tag, std::span<const std::string> on_offer,
                   std::span<const std::string> commands) {
  for (const auto& [other, instead] : kInstead) {
    if (tag == other) return fmt::format("; expected {}", instead);
  }
  std::vector<std::string> words(on_offer.begin(), on_offer.end());
  words.insert(words.end(), commands.begin(), commands.end());
  const std::string nearest = nearest_spelling(tag, words);
  if (!nearest.empty()) return fmt::format("; did you mean '{}'?", nearest);
  if (commands.empty()) return fmt::format("; on offer: {}", fmt::join(on_offer, ", "));
  return fmt::format(
      "; commands: {}; `cairn plugins factor` and `cairn plugins variable` list tags",
      fmt::join(commands, ", "));
}

}  // namespace

void unknown_tag(const Scanner& scanner, Draft& draft, const ReadOptions& options,
                 const std::function<std::vector<std::string>()>& on_offer,
                 std::span<const std::string> commands) {
  if (options.skip_unknown) {
    draft.add_skipped(scanner);
    return;
  }
  scanner.fail(fmt::format("unknown tag '{}'{} (ReadOptions::skip_unknown leaves such lines out){}",
                           shown(scanner.tag()), remedy(scanner.tag(), on_offer(), commands),
                           draft.plugin_problems()));
}

void read_factor(Scanner& scanner, Draft& draft, std::int32_t kind,
                 const Arrangement& arrangement) {
  const Draft::FactorKind& k = draft.factor(kind);
  scanner.expect({k.arity, k.measurement, k.information});
  const Draft::FactorSlots slots = draft.add_factor(kind, scanner.line());
  for (Id& id : slots.ids) id = scanner.read_id();
  scanner.read_numbers(slots.measurement);
  read_information(scanner, draft, arrangement);
}

void read_information(Scanner& scanner, Draft& draft, const Arrangement& arrangement) {
  if (!scanner.more()) return draft.take_unit_information(scanner);
  constexpr std::size_t kUsual = 21;  // up to 6 × 6, without allocating
  std::array<double, kUsual> usual;
  std::vector<double> large;
  std::span<double> as_in_file(usual);
  const auto count = static_cast<std::size_t>(scanner.layout().information);
  if (count > kUsual) {
    large.resize(count);
    as_in_file = large;
  }
  as_in_file = as_in_file.first(count);
  scanner.read_numbers(as_in_file);
  scanner.end_line();
  arrangement.to_rows(as_in_file, draft.slots(draft.factors().back()).information);
  draft.finish_factor(scanner, arrangement);
}

void read_pose_of_angles(Scanner& scanner, std::span<double> pose) {
  scanner.read_numbers(pose.first<3>());
  std::array<double, 3> angles;
  scanner.read_numbers(angles);
  std::ranges::copy(quaternion_from(angles), pose.begin() + 3);
}

void read_edge_of_angles(Scanner& scanner, Draft& draft, std::int32_t kind,
                         const Arrangement& arrangement) {
  scanner.expect({2, 6, 21});
  const Draft::FactorSlots slots = draft.add_factor(kind, scanner.line());
  for (Id& id : slots.ids) id = scanner.read_id();
  read_pose_of_angles(scanner, slots.measurement);
  read_information(scanner, draft, arrangement);
}

void read_variable(Scanner& scanner, Draft& draft, std::int32_t kind) {
  scanner.expect({1, draft.variable(kind).size, 0});
  const Id id = scanner.read_id();
  scanner.read_numbers(draft.add_variable(kind, id, scanner.line()));
  scanner.end_line();
}

}  // namespace cairn::formats
