// SPDX-License-Identifier: BSD-3-Clause
#include "tag_lines.hpp"

#include <fmt/core.h>
#include <fmt/ranges.h>

#include "cairn/runtime/error.hpp"
#include "cairn/text/spelling.hpp"

namespace cairn::formats {

void read_fix(Scanner& scanner, Draft& draft) {
  scanner.expect({});
  if (!scanner.more()) scanner.fail("FIX without an id; expected one or more ids");
  while (scanner.more()) draft.add_held(scanner.read_id(), scanner.line());
}

namespace {

std::string remedy(std::string_view tag, std::span<const std::string> on_offer,
                   std::span<const std::string> commands) {
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
                 std::span<const std::string> on_offer, std::span<const std::string> commands) {
  if (options.skip_unknown) {
    ++draft.report().skipped[shown(scanner.tag())];
    return;
  }
  scanner.fail(fmt::format("unknown tag '{}'{} (ReadOptions::skip_unknown leaves such lines out){}",
                           shown(scanner.tag()), remedy(scanner.tag(), on_offer, commands),
                           draft.plugin_problems()));
}

Draft::FactorSlots read_factor(Scanner& scanner, Draft& draft, std::int32_t kind) {
  const Draft::FactorKind& k = draft.factor(kind);
  scanner.expect({k.arity, k.measurement, k.information});
  const Draft::FactorSlots slots = draft.add_factor(kind, scanner.line());
  for (Id& id : slots.ids) id = scanner.read_id();
  scanner.read_numbers(slots.measurement);
  scanner.read_numbers(slots.information);
  scanner.end_line();
  return slots;
}

void read_variable(Scanner& scanner, Draft& draft, std::int32_t kind) {
  scanner.expect({1, draft.variable(kind).size, 0});
  const Id id = scanner.read_id();
  scanner.read_numbers(draft.add_variable(kind, id, scanner.line()));
  scanner.end_line();
}

}  // namespace cairn::formats
