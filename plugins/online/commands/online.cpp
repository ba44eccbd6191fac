// SPDX-License-Identifier: BSD-3-Clause
// cairn online: measurements from standard input as they come, estimates to standard output.
#include <algorithm>
#include <exception>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>

#include <fmt/core.h>
#include <boost/crc.hpp>

#include "cairn/evaluation/plausibility.hpp"
#include "cairn/evaluation/undetermined.hpp"
#include "cairn/io/format.hpp"
#include "cairn/io/losses_not_written.hpp"
#include "cairn/online/conversation.hpp"
#include "cairn/online/journal.hpp"
#include "cairn/online/line_server.hpp"
#include "cairn/online/online_session.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/program/command.hpp"
#include "cairn/program/graph_files.hpp"
#include "cairn/program/interrupt.hpp"
#include "cairn/program/json_report.hpp"
#include "cairn/program/option_words.hpp"
#include "cairn/program/problem_setup.hpp"
#include "cairn/program/table.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/plugin_call.hpp"
#include "cairn/runtime/threads.hpp"
#include "cairn/solve/estimator.hpp"
#include "cairn/update/marginal_prior.hpp"
#include "cairn/update/pose_remover.hpp"
#include "line_input.hpp"

namespace cairn::app {
namespace {

namespace json = boost::json;

constexpr const char* kDefaultEstimator = "incremental_cholesky";
constexpr const char* kRemover = "sparsify";

struct OnlineOptions {
  std::string estimator;   ///< empty: the default, or the policy's own
  std::string thresholds;  ///< a file with the policy's options; empty: none
  std::string map;         ///< that a policy's poses continue; empty: none
  std::string policy;      ///< empty: everything is taken in
  InputOptions input;
  std::string solve = "auto";
  std::string estimates = "last";
  std::string marginals = "none";
  double budget = 0.0;
  int keep = 0;
  std::string sparsifier;  ///< empty: the default, and so is `select`
  std::string select;
  std::string listen;  ///< a socket; empty: standard input and output
  std::string journal;
  std::string sync = "batch";
  std::string output;
  std::string trajectory;
  ProblemOptions problem;

  OnlineOptions() {
    problem.initial.clear();
    input.format = "g2o";
  }

  static auto fields() {
    using O = OnlineOptions;
    return OptionFields<O>()
        .component("estimator", &O::estimator, {"estimator"},
                   "the estimator, with options as NAME:key=value [incremental_cholesky]")
        .component("policy", &O::policy, {"pose_policy"},
                   "decides which poses are kept, such as compact_pose; default: all are")
        .text("thresholds", &O::thresholds, "with --policy, take its thresholds from a file")
        .placeholder("FILE")
        .text("map", &O::map, "with --policy, continue this map; where on it is unknown at first")
        .placeholder("MAP")
        .choice("solve", &O::solve, {"auto", "explicit"},
                "auto, after every measurement, or explicit: by SOLVE")
        .placeholder("WHEN")
        .choice("output", &O::estimates, {"none", "last", "changed", "all"},
                "estimates written after a solve: none, last, changed or all")
        .choice("marginals", &O::marginals, {"none", "last", "diagonal"},
                "covariances kept, and written after a solve: none, last or diagonal")
        .real("budget", &O::budget, 0.0, 1e9, "seconds that an update may take; 0: no limit")
        .placeholder("S")
        .integer("keep", &O::keep, 2, 1e9,
                 "keep so many poses: others are sparsified as new ones come; 0: all, or those "
                 "that --policy keeps")
        .or_zero()
        .component("select", &O::select, {"node_selection"},
                   "which poses leave: nearest, oldest, smallest_blanket, least_loss [nearest]")
        .component("sparsifier", &O::sparsifier, {"sparsifier"},
                   "what replaces poses that leave by factors, with options as NAME:key=value")
        .text("listen", &O::listen,
              "serve many clients at this Unix domain socket, of which one writes")
        .placeholder("SOCKET")
        .text("journal", &O::journal, "restore the session from this journal, and append to it")
        .placeholder("FILE")
        .choice("sync", &O::sync, {"every", "batch", "none"},
                "sync of the journal to disk: every line, batch or none")
        .placeholder("WHEN")
        .text("save", &O::output, "write the last estimate as a graph at the end")
        .letter('o')
        .placeholder("OUT")
        .text("trajectory", &O::trajectory,
              "with --policy, write all poses at the end, and estimate those left out")
        .placeholder("FILE")
        .part(&O::problem, ProblemOptions::loss_fields())
        .part(&O::input);
  }
};

/// What must be the same for a journal to give the same estimate again.
std::string identity(const OnlineOptions& options, const std::string& who, const Session& session) {
  const std::string types = joined(session.common.types, " ");
  std::string text = fmt::format("{}, types {}, format {}{}, loss {} on {}, solve {}", who,
                                 types.empty() ? "as they are" : types, options.input.format,
                                 options.input.read.repair_information ? " with repairs" : "",
                                 options.problem.loss.empty() ? "none" : options.problem.loss,
                                 options.problem.loss_on, options.solve);
  // Not where they are not given: journals of before are continued.
  if (options.input.read.unit_information) text += ", unit information";
  if (options.keep > 0) text += fmt::format(", keep {}", options.keep);
  if (!options.sparsifier.empty()) text += ", sparsifier " + options.sparsifier;
  if (!options.select.empty()) text += ", select " + options.select;
  return text;
}

/// CRC-32 of a map's numbers: a journal is of the session that continued this map.
std::uint32_t fingerprint(const Graph& map) {
  boost::crc_32_type crc;
  const auto add = [&](std::span<const double> numbers) {
    crc.process_bytes(numbers.data(), numbers.size_bytes());
  };
  for (int v = 0; v < map.variable_count(); ++v) {
    const Id id = map.id(v);
    crc.process_bytes(&id, sizeof id);
    add(map.state(v));
  }
  for (int f = 0; f < map.factor_count(); ++f) {
    const auto on = map.factor_variables(f);
    crc.process_bytes(on.data(), on.size_bytes());
    add(map.measurement(f));
    add(map.information(f));
  }
  return crc.checksum();
}

Journal::Sync sync_of(const std::string& name) {
  if (name == "every") return Journal::Sync::every;
  return name == "none" ? Journal::Sync::none : Journal::Sync::batch;
}

json::object clients_json(const LineServer::Counts& counts) {
  return {{"connected", counts.clients},
          {"most", counts.most_clients},
          {"writers", counts.writers},
          {"updates", {{"sent", counts.updates}, {"dropped", counts.dropped}}}};
}

json::object report_json(const OnlineOptions& options, const Conversation::Counts& counts,
                         const LineSession& lines) {
  json::object report = begin_report("online");
  report["estimator"] = text_json(options.estimator);
  report["policy"] = text_json(options.policy);
  report["threads"] = threads();
  report["graph"] = {{"variables", lines.variable_count()}, {"factors", lines.factor_count()}};
  for (const auto& [name, count] : lines.counts()) {
    const std::size_t dot = name.find('.');
    json::value& group = report[name.substr(0, dot)];
    if (!group.is_object()) group.emplace_object();
    group.as_object()[name.substr(dot + 1)] = count;
  }
  report["lines"] = {{"read", counts.lines},
                     {"taken", counts.taken},
                     {"refused", counts.refused},
                     {"questions", counts.questions},
                     {"restored", counts.restored}};
  report["solves"] = counts.solves;
  report["seconds"] = {{"total", counts.solve_seconds}, {"longest", counts.longest}};
  report["journal"] = text_json(options.journal);
  report["output"] = text_json(options.output);
  report["trajectory"] = text_json(options.trajectory);
  end_report(report);
  return report;
}

/// A session with the components behind it.
struct Listener {
  std::unique_ptr<StreamFormat> format;
  std::unique_ptr<Component> component;  ///< what decides: an estimator, or a policy
  std::unique_ptr<PoseRemover> remover;  ///< null: with a policy
  std::string name;                      ///< of the estimator or policy, for messages
  std::string identity;                  ///< of the journal
  std::unique_ptr<LineSession> lines;
};

std::unique_ptr<PoseRemover> pose_remover(const OnlineOptions& options, Registry& registry) {
  ComponentSpec spec{kRemover, {{"savable", "true"}}};
  if (!options.sparsifier.empty()) spec.values["sparsifier"] = options.sparsifier;
  if (!options.select.empty()) spec.values["selection"] = options.select;
  // A wrong name is refused at once. Without these options the plugin need not be there.
  if (options.keep > 0 || !options.sparsifier.empty() || !options.select.empty())
    return registry.make<PoseRemover>(spec);
  return made_when_used(std::move(spec), registry);
}

Listener follow_graph(const OnlineOptions& options, const ProblemSetup& setup, Session& session) {
  Registry& registry = session.registry();
  Listener listener;
  listener.name = fmt::format("estimator '{}'", options.estimator);
  listener.identity = identity(options, "estimator " + options.estimator, session);
  listener.format = registry.make<StreamFormat>(options.input.format);
  auto estimator = registry.make<Estimator>(options.estimator);
  estimator->set_loss(setup.loss(), setup.loss_selector());
  if (options.marginals != "none") {
    estimator->keep_marginals(options.marginals == "last" ? KeptMarginals::last
                                                          : KeptMarginals::diagonal);
  }
  listener.remover = pose_remover(options, registry);
  listener.lines =
      std::make_unique<OnlineSession>(*estimator, *listener.format, registry,
                                      OnlineSettings{.read = options.input.read,
                                                     .automatic = options.solve == "auto",
                                                     .output = options.estimates,
                                                     .marginals = options.marginals,
                                                     .budget = options.budget,
                                                     .remover = listener.remover.get(),
                                                     .keep = options.keep});
  listener.component = std::move(estimator);
  return listener;
}

Listener follow_policy(const OnlineOptions& options, const ProblemSetup& setup, Session& session) {
  Registry& registry = session.registry();
  Listener listener;
  listener.name = fmt::format("policy '{}'", options.policy);
  listener.format = registry.make<StreamFormat>(options.input.format);
  LineSessionRequest request{.component = parse_component(options.policy),
                             .given = {},
                             .thresholds = options.thresholds,
                             .read = options.input.read,
                             .output = options.estimates,
                             .marginals = options.marginals,
                             .trajectory = !options.trajectory.empty(),
                             .loss = setup.loss(),
                             .loss_on = setup.loss_selector()};
  const auto give = [&](const char* name, const std::string& value) {
    if (!value.empty()) request.given.emplace(name, value);
  };
  give("estimator", options.estimator);
  give("keep", options.keep > 0 ? fmt::format("{}", options.keep) : "");
  give("select", options.select);
  give("sparsifier", options.sparsifier);
  std::optional<Graph> map;
  if (!options.map.empty()) {
    map = load_graph(options.map, options.input, session).graph;
    request.map = &*map;
  }
  LineSessionKind::Opened opened =
      registry.make<LineSessionKind>("pose_policy")->open(request, *listener.format, registry);
  listener.component = std::move(opened.component);
  listener.lines = std::move(opened.lines);
  OnlineOptions rest = options;  // what is not among the policy's
  rest.keep = 0;
  rest.sparsifier = rest.select = "";
  listener.identity = identity(rest, opened.identity, session);
  if (map) {
    listener.lines->protect(options.map, "the map that is continued");
    listener.identity += fmt::format(", map {:08x}", fingerprint(*map));
  }
  return listener;
}

void check(const OnlineOptions& options, Session& session) {
  if (options.listen.empty())
    session.write_file_to_stdout();  // standard output is the conversation's
  if (options.output == "-")
    throw Error(ErrorCode::usage, "-o writes a file; standard output is for answers");
  if (!options.policy.empty() && (options.solve != "auto" || options.budget > 0.0)) {
    throw Error(ErrorCode::usage,
                "a policy solves when it has to: --solve explicit and --budget are for runs "
                "without --policy");
  }
  if (!options.policy.empty() && options.map.empty() && options.input.read.skip_dangling) {
    throw Error(ErrorCode::usage,
                "--skip-dangling has no effect with --policy but for the file of --map: a policy "
                "refuses what leads to poses that it does not know");
  }
  if (!options.thresholds.empty() && options.policy.empty())
    throw Error(ErrorCode::usage, "--thresholds are those of a policy: give --policy");
  session.files.add_input(options.thresholds);
  session.files.add_input(options.map);
  if (!options.map.empty() && options.policy.empty()) {
    throw Error(ErrorCode::usage,
                "--map is continued by a policy: give --policy; without one, send the lines of the "
                "map first");
  }
  if (options.trajectory == "-")
    throw Error(ErrorCode::usage, "--trajectory writes a file; standard output is for answers");
  if (!options.trajectory.empty() && options.policy.empty()) {
    throw Error(
        ErrorCode::usage,
        "--trajectory puts back poses that a policy has left out: give --policy, or -o, which "
        "has all poses without one");
  }
  session.files.add_input("-");
  check_output(options.output, "", session);
  check_output(options.trajectory, "", session, false);
  session.files.add_output(options.journal);  // is tried when it is opened
  session.files.add_output(options.listen);   // too
}

/// Answers each line. Where the reader of the answers is gone, goes on without them if the map is
/// `kept`, in a file or a journal.
void converse(Conversation& conversation, LineInput& input, bool kept, const Session& session) {
  bool heard = true;
  for (std::string line; input.next(line);) {
    const LineSession::Reply reply = conversation.take(line);
    if (heard && !reply.text.empty()) {
      write_stdout(reply.refused ? in_command_line_words(reply.text) : reply.text);
      heard = !stdout_reader_is_gone();
      if (!heard && !kept) return;
      if (!heard) session.note("the reader of the answers is gone; the stream is taken to its end");
    }
    if (reply.quit) return;
  }
  if (!input.rest().empty()) {
    session.note(fmt::format("the last line has no end, and was not taken: '{}'",
                             input.rest().substr(0, 40)));
  }
}

/// What a journal has given, as a sentence.
std::string restored(Conversation& conversation) {
  std::string answer = conversation.restore();
  answer.pop_back();  // the end of its line
  return answer;
}

bool is_marginalized(const Graph& graph) {
  return std::ranges::any_of(graph.factor_pools(), [](const FactorPool& pool) {
    return pool.size() > 0 && pool.type->tag() == MarginalPrior::kTag;
  });
}

/// What marginalization leaves is in no format of graphs: the poses alone go to a file beside the
/// map that cannot be written, unless there is one of that name already.
void write_map(const Graph& graph, const std::string& file, Session& session) {
  try {
    write_graph(graph, file, session.registry());
  } catch (const Error&) {
    const std::string beside = file + ".tum";
    std::error_code ignored;
    if (is_marginalized(graph)) {
      if (std::filesystem::exists(beside, ignored)) {
        session.note(fmt::format("{} is there already: the poses are not written", beside));
      } else {
        write_graph(graph, beside, session.registry(), "tum");
        session.note(fmt::format("the poses alone are in {}", beside));
      }
    }
    throw;
  }
}

/// Of a map without variables.
std::string why_empty(const Conversation::Counts& counts, const LineSession& lines) {
  if (counts.lines == 0 && counts.restored == 0) return "nothing was sent";
  const std::string waiting = lines.waiting();
  return fmt::format("nothing was estimated, since {}",
                     waiting.empty() ? "no variable came, or all were removed" : waiting);
}

int run(OnlineOptions options, Session& session) {
  check(options, session);
  session.use_threads();
  if (options.policy.empty() && options.estimator.empty()) options.estimator = kDefaultEstimator;
  const ProblemSetup setup(options.problem, session.registry());
  const Listener listener = options.policy.empty() ? follow_graph(options, setup, session)
                                                   : follow_policy(options, setup, session);
  LineSession& lines = *listener.lines;
  std::optional<Journal> journal;
  if (!options.journal.empty()) {
    journal.emplace(options.journal, listener.identity, sync_of(options.sync));
    session.note(journal->note());
    lines.protect(options.journal, "the journal");
  }
  Conversation conversation(lines, journal ? &*journal : nullptr);
  std::optional<LineServer> server;  // who connects from here on waits until all is restored
  if (!options.listen.empty()) {
    server.emplace(options.listen, conversation,
                   LineServerSettings{.rephrase = in_command_line_words});
    lines.protect(options.listen, "the socket");
    listener.format->add_other_words(LineServer::words());
  }
  if (journal) server ? session.note(restored(conversation)) : write_stdout(conversation.restore());

  const InterruptGuard guard;
  LineInput input(guard.flag());
  const bool kept = !options.output.empty() || journal;
  std::exception_ptr failure;  // which costs the rest of the stream, not the map so far
  bool within_a_line = false;
  try {
    call_plugin([&] { return listener.name; },
                [&] {
                  server ? server->serve(guard.flag())
                         : converse(conversation, input, kept, session);
                  conversation.finish();
                });
  } catch (const Error& error) {
    failure = std::current_exception();
    within_a_line = error.code() == ErrorCode::plugin;
  } catch (...) {  // of memory
    failure = std::current_exception();
    within_a_line = true;
  }
  try {
    const bool nothing_came = server && lines.variable_count() == 0;
    if (nothing_came && !options.output.empty()) {
      session.note(fmt::format("{}: {} is not written", why_empty(conversation.counts(), lines),
                               options.output));
    } else if (const std::string waiting = lines.waiting(); !waiting.empty()) {
      session.note(waiting + ": not in the estimate");
    }
    if (!options.output.empty() && !nothing_came) {
      const Graph graph = lines.estimator().graph();
      write_map(graph, options.output, session);
      if (const std::string lost = losses_not_written(graph); !lost.empty()) session.note(lost);
      if (!failure) {  // within an update it may have been left in part
        std::vector<std::string> notes = notes_on_estimate(graph, chi2(graph)).notes;
        note_what_is_free(graph, notes);
        for (const std::string& note : notes) session.note(note);
      }
    }
  } catch (const std::exception& error) {
    if (!failure) throw;
    session.note(error.what());  // the reason comes last, as the error
  }
  try {
    if (!options.trajectory.empty()) {
      write_graph(lines.trajectory(), options.trajectory, session.registry(),
                  output_format(options.trajectory, ""));
    }
  } catch (const std::exception& error) {
    if (!failure) throw;
    session.note(error.what());
  }
  if (within_a_line && !options.output.empty())
    session.note("the line that failed may be in the map in part, and is not in the journal");
  if (failure) std::rethrow_exception(failure);
  json::object report = report_json(options, conversation.counts(), lines);
  if (server) report["clients"] = clients_json(server->counts());
  session.write_json(report);
  if (guard.interrupted() && !server) return kExitInterrupted;  // a service ends in no other way
  for (const std::string& sentence : lines.unread_notes()) session.note(sentence);
  return lines.succeeded() ? 0 : static_cast<int>(ErrorCode::numerical);
}

}  // namespace

void add_online(Registrar& registrar) {
  add_command<OnlineOptions>(
      registrar, "online",
      "Lines are those of g2o files and SOLVE, FULL, NEW, REMOVE, CHANGE, MARGINALIZE, SPARSIFY,\n"
      "COVARIANCE, ESTIMATE, CHI2, SAVE, HELP and QUIT; with --policy NEXT, NOMATCH and DONE; "
      "with\n"
      "--listen WRITE, FOLLOW and JSON: docs/online.md.\n\n"
      "Example:\n"
      "  robot | cairn online --marginals last --journal today.journal\n"
      "  cairn online --listen /run/cairn/robot.socket --journal today.journal -o map.g2o",
      run);
}

}  // namespace cairn::app
