// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/online/command_session.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "cairn/io/format.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn {
namespace {

constexpr const char* kNoCovariance =
    "the measurements do not determine everything, or rounding takes its digits";

}  // namespace

CommandSession::CommandSession(StreamFormat& format, Registry& registry, AnswerSettings settings,
                               std::vector<Command> commands)
    : format_(format),
      registry_(registry),
      settings_(std::move(settings)),
      commands_(std::move(commands)) {
  std::ranges::move(
      std::vector{command("CHI2", &CommandSession::report_chi2),
                  command("SAVE", &CommandSession::save), command("HELP", &CommandSession::help),
                  command("QUIT", &CommandSession::quit)},
      std::back_inserter(commands_));
  std::vector<std::string> words;
  for (const Command& one : commands_) {
    if (one.offered) words.emplace_back(one.word);
  }
  format_.add_other_words(words);
}

void CommandSession::perform(std::string_view line, const Words& words, Reply& reply) {
  const auto named = std::ranges::find(commands_, words[0], &Command::word);
  if (named == commands_.end()) {
    take_data(line, reply);
  } else {
    named->run(*this, words, reply);
  }
}

// Commands --------------------------------------------------------------------------------------

void CommandSession::report_chi2(const Words& words, Reply& reply) {
  expect_words(words, 1, "CHI2");
  settle(reply);
  const double chi2 = estimator().chi2();
  if (!std::isfinite(chi2))
    throw Error(ErrorCode::numerical,
                "chi2 is not finite: a residual overflows, or is not a number");
  answer(reply, caveats() + fmt::format("CHI2 {}\n", chi2));
}

void CommandSession::save(const Words& words, Reply& reply) {
  const std::string file = file_to_save(words);
  settle(reply);
  Estimator& estimator = this->estimator();
  // No journal has this line, unless it was forged: then it must not replace files.
  if (!silent()) write_graph(estimator.graph(), file, registry_);
  answer(reply, {});
}

void CommandSession::help(const Words& words, Reply& reply) {
  expect_words(words, 1, "HELP");
  std::vector<std::string_view> names;
  for (const Command& one : commands_) {
    if (one.offered) names.push_back(one.word);
  }
  answer(reply,
         fmt::format("NOTE commands: {}; with --listen WRITE, FOLLOW and JSON; other lines are "
                     "data, such as NEW VERTEX_SE2 0; docs/online.md explains each\n",
                     fmt::join(names, ", ")));
}

/// Not a change: a journal goes on before it.
void CommandSession::quit(const Words& words, Reply& reply) {
  expect_words(words, 1, "QUIT");
  reply.quit = true;
  finish();
  answer(reply, {});
}

// Words and lines -------------------------------------------------------------------------------

Variable CommandSession::declared_variable(const Words& words) {
  expect_words(words, 3, "NEW TAG id");
  if (!registry_.has("variable", words[1])) {
    throw bad_line(fmt::format("there is no type of variable '{}'; on offer: {}", words[1],
                               fmt::join(registry_.names("variable"), ", ")));
  }
  const Id id = parse_whole(words[2], "id");
  if (id < 0) throw bad_line(fmt::format("'{}' is not an id; expected an integer from 0", id));
  return {registry_.variable_type(words[1]), id, {}, false};
}

std::string CommandSession::estimate_line(const VariableType& type, Id id,
                                          std::span<const double> state) {
  return fmt::format("{} {} {}\n", type.tag(), id, fmt::join(state, " "));
}

std::string CommandSession::covariance_line(Estimator& estimator, Id a, const VariableType& type_a,
                                            Id b, const VariableType& type_b) {
  const auto rows = static_cast<std::size_t>(type_a.tangent_size()),
             columns = static_cast<std::size_t>(type_b.tangent_size());
  std::vector<double> block(rows * columns);
  if (!estimator.covariance(a, b, block)) return {};
  std::string text = fmt::format("COVARIANCE {} {} {} {}", a, b, rows, columns);
  for (std::size_t row = 0; row < rows; ++row) {
    for (std::size_t column = 0; column < columns; ++column)
      text += fmt::format(" {}", block[column * rows + row]);
  }
  return text + '\n';
}

std::string CommandSession::wanted_covariance(Estimator& estimator, Id a,
                                              const VariableType& type_a, Id b,
                                              const VariableType& type_b) {
  std::string line = covariance_line(estimator, a, type_a, b, type_b);
  if (line.empty())
    throw Error(ErrorCode::numerical, fmt::format("there is no covariance: {}", kNoCovariance));
  return line;
}

std::string CommandSession::covariance_or_note(Estimator& estimator, Id id,
                                               const VariableType& type) {
  std::string line = covariance_line(estimator, id, type, id, type);
  if (!line.empty()) return line;
  return fmt::format("NOTE there is no covariance of {}: {}\n", id, kNoCovariance);
}

std::string CommandSession::wanted_estimates(
    Id newest, const Ids& all, const std::function<void(Id, const Estimate&)>& look_up) {
  std::string text;
  const auto write = [&](Id id) {
    look_up(id, [&](const VariableType& type, std::span<const double> state) {
      if (settings_.output == "changed") {
        std::vector<double>& reported = reported_[id];
        if (std::ranges::equal(reported, state)) return;
        reported.assign(state.begin(), state.end());
      }
      text += estimate_line(type, id, state);
    });
  };
  if (settings_.output == "last") write(newest);
  if (settings_.output == "all" || settings_.output == "changed")
    std::ranges::for_each(all(), write);
  return text;
}

std::vector<Id> CommandSession::wanted_covariances(std::optional<Id> newest, const Ids& all) const {
  if (settings_.marginals == "diagonal") return all();
  return settings_.marginals == "last" && newest ? std::vector{*newest} : std::vector<Id>();
}

}  // namespace cairn
