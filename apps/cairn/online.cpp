// SPDX-License-Identifier: BSD-3-Clause
// cairn online: measurements from standard input as they come, estimates to standard output.
#include <algorithm>
#include <chrono>
#include <memory>
#include <optional>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "cairn/error.hpp"
#include "cairn/estimator.hpp"
#include "cairn/format.hpp"
#include "cairn/journal.hpp"
#include "cairn/threads.hpp"
#include "commands.hpp"
#include "graph_files.hpp"
#include "help.hpp"
#include "interrupt.hpp"
#include "json_report.hpp"
#include "line_input.hpp"
#include "online_session.hpp"
#include "problem_setup.hpp"
#include "table.hpp"

namespace cairn::app {
namespace {

namespace json = boost::json;

struct OnlineOptions {
  std::string estimator = "incremental_cholesky";
  InputOptions input;
  std::string solve = "auto";
  std::string estimates = "last";
  std::string marginals = "none";
  double budget = 0.0;
  std::string journal;
  std::string sync = "batch";
  std::string output;
  ProblemOptions problem;
};

struct Counts {
  std::int64_t lines = 0, taken = 0, refused = 0, solves = 0, restored = 0;
  double solve_seconds = 0.0, longest = 0.0;
};

/// What must be the same for a journal to give the same estimate again.
std::string identity(const OnlineOptions& options, const Session& session) {
  const std::string types = fmt::format("{}", fmt::join(session.common.types, " "));
  return fmt::format("estimator {}, types {}, format {}{}, loss {} on {}, solve {}",
                     options.estimator, types.empty() ? "as they are" : types, options.input.format,
                     options.input.read.repair_information ? " with repairs" : "",
                     options.problem.loss.empty() ? "none" : options.problem.loss,
                     options.problem.loss_on, options.solve);
}

Journal::Sync sync_of(const std::string& name) {
  if (name == "every") return Journal::Sync::every;
  return name == "none" ? Journal::Sync::none : Journal::Sync::batch;
}

/// "ERROR line N: …" on one line. The format's messages begin with the place themselves.
std::string error_line(std::int64_t number, std::string message) {
  const std::string place = fmt::format("input:{}: ", number);
  if (message.starts_with(place)) message.erase(0, place.size());
  std::ranges::replace(message, '\n', ' ');
  return fmt::format("ERROR line {}: {}\n", number, message);
}

/// The conversation: lines in, answers out, the journal in between.
class Conversation {
 public:
  Conversation(OnlineSession& online, std::optional<Journal>& journal, Counts& counts)
      : online_(online), journal_(journal), counts_(counts) {}

  /// Takes in again what the journal has. Returns the number of the last line.
  std::int64_t restore() {
    std::int64_t number = 0;
    for (const Journal::Record& record : journal_->take_records()) {
      try {
        online_.restore(record.text, record.number);
      } catch (const Error& error) {
        throw Error(error.code(), fmt::format("the journal's line {} was taken before and is now "
                                              "refused: {}",
                                              record.number, error.what()));
      }
      number = record.number;
      ++counts_.restored;
    }
    return number;
  }

  /// False once the conversation is over.
  bool take(const std::string& line, std::int64_t number) {
    ++counts_.lines;
    OnlineSession::Reply reply;
    try {
      reply = online_.take(line, number);
    } catch (const Error& error) {
      ++counts_.refused;
      write_stdout(error_line(number, error.what()));
      return true;
    }
    counts_.taken += reply.changes;
    if (reply.solved) {
      ++counts_.solves;
      counts_.solve_seconds += online_.last_seconds();
      counts_.longest = std::max(counts_.longest, online_.last_seconds());
    }
    if (journal_ && reply.changes) journal_->append(number, line);
    if (!reply.text.empty()) {
      if (journal_) journal_->commit();  // what is acknowledged is not lost
      write_stdout(reply.text);
      if (stdout_reader_is_gone()) return false;
    }
    return !reply.quit;
  }

 private:
  OnlineSession& online_;
  std::optional<Journal>& journal_;
  Counts& counts_;
};

json::object report_json(const OnlineOptions& options, const Counts& counts,
                         const Estimator& estimator) {
  json::object report = begin_report("online");
  report["estimator"] = options.estimator;
  report["threads"] = threads();
  report["graph"] = {{"variables", estimator.variable_count()},
                     {"factors", estimator.factor_count()}};
  report["lines"] = {{"read", counts.lines},
                     {"taken", counts.taken},
                     {"refused", counts.refused},
                     {"restored", counts.restored}};
  report["solves"] = counts.solves;
  report["seconds"] = {{"total", counts.solve_seconds}, {"longest", counts.longest}};
  report["journal"] = text_json(options.journal);
  report["output"] = text_json(options.output);
  end_report(report);
  return report;
}

void check(const OnlineOptions& options, Session& session) {
  session.write_file_to_stdout();  // standard output is the conversation's
  if (options.output == "-")
    throw Error(ErrorCode::usage, "-o writes a file; standard output is for answers");
  check_output(options.output, "", session);
  if (!options.journal.empty()) check_folder(options.journal);
}

int run(const OnlineOptions& options, Session& session) {
  check(options, session);
  session.use_threads();
  Registry& registry = session.registry();
  const auto estimator = registry.make<Estimator>(options.estimator);
  const auto format = registry.make<StreamFormat>(options.input.format);
  const ProblemSetup setup(options.problem, registry);
  estimator->set_loss(setup.loss(), setup.loss_scope());
  if (options.marginals != "none") {
    estimator->keep_marginals(options.marginals == "last" ? KeptMarginals::last
                                                          : KeptMarginals::diagonal);
  }
  OnlineSession online(*estimator, *format, registry,
                       {.read = options.input.read,
                        .automatic = options.solve == "auto",
                        .output = options.estimates,
                        .marginals = options.marginals,
                        .budget = options.budget});
  std::optional<Journal> journal;
  Counts counts;
  Conversation conversation(online, journal, counts);
  std::int64_t number = 0;
  if (!options.journal.empty()) {
    journal.emplace(options.journal, identity(options, session), sync_of(options.sync));
    session.note(journal->note());
    number = conversation.restore();
    write_stdout(fmt::format("RESTORED {} variables {} factors {}\n", number,
                             estimator->variable_count(), estimator->factor_count()));
  }

  const InterruptGuard guard;
  LineInput input(guard.flag());
  for (std::string line; input.next(line) && conversation.take(line, ++number);) {
  }
  if (journal) journal->commit();
  if (!options.output.empty()) write_graph(estimator->graph(), options.output, registry);
  session.write_json(report_json(options, counts, *estimator));
  return guard.interrupted() ? kExitInterrupted : 0;
}

}  // namespace

Command add_online(CLI::App& program) {
  auto options = std::make_shared<OnlineOptions>();  // lives as long as the parser and the run
  options->input.format = "g2o";
  CLI::App* app =
      program.add_subcommand("online", "estimate from standard input while measurements arrive");
  app->add_option("--estimator", options->estimator,
                  "who estimates, with options as NAME:key=value")
      ->type_name("NAME")
      ->capture_default_str();
  app->add_option("--solve", options->solve, "auto, after every measurement, or explicit: by SOLVE")
      ->type_name("WHEN")
      ->check(one_of({"auto", "explicit"}))
      ->capture_default_str();
  app->add_option("--output", options->estimates,
                  "estimates written after a solve: none, last, changed or all")
      ->type_name("WHICH")
      ->check(one_of({"none", "last", "changed", "all"}))
      ->capture_default_str();
  app->add_option("--marginals", options->marginals,
                  "covariances kept, and written after a solve: none, last or diagonal")
      ->type_name("WHICH")
      ->check(one_of({"none", "last", "diagonal"}))
      ->capture_default_str();
  app->add_option("--budget", options->budget, "seconds an update may take; 0: no limit")
      ->type_name("S")
      ->check(within(0.0, 1e9))
      ->default_str("0");
  app->add_option("--journal", options->journal,
                  "log what is taken in, and begin with what the log has")
      ->type_name("FILE");
  app->add_option("--sync", options->sync,
                  "the journal waits for the disk: every line, batch (before answers) or none")
      ->type_name("WHEN")
      ->check(one_of({"every", "batch", "none"}))
      ->capture_default_str();
  app->add_option("-o,--save", options->output, "write the last estimate as a graph at the end")
      ->type_name("OUT");
  add_loss_options(*app, options->problem);
  add_input_options(*app, options->input);
  app->footer(
      "Lines are those of g2o files and SOLVE, FULL, NEW, REMOVE, CHANGE, MARGINALIZE, "
      "COVARIANCE,\n"
      "ESTIMATE, CHI2, SAVE and QUIT: docs/online.md.\n\n"
      "Example:\n"
      "  robot | cairn online --marginals last --journal today.journal");
  return {app, [options](Session& session) { return run(*options, session); }};
}

}  // namespace cairn::app
