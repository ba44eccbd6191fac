// SPDX-License-Identifier: BSD-3-Clause
// cairn plugins --check FILE…: the conformance suite over somebody's plugin. A child process runs
// it and sends each result as a line of JSON; where it ends early, the finding is what it was
// calling, and another child goes on with the next group of checks.
#include "plugin_check.hpp"

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdlib>
#include <filesystem>
#include <optional>
#include <string_view>
#include <system_error>
#include <utility>

#include <fmt/core.h>
#include <boost/json.hpp>

#include "cairn/conformance/conformance.hpp"
#include "cairn/plugin/plugin_search.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/program/json_report.hpp"
#include "cairn/program/table.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/timed.hpp"
#include "isolated_work.hpp"
#include "unlinked_symbols.hpp"

namespace cairn::app {
namespace {

namespace fs = std::filesystem;
namespace json = boost::json;
using Clock = std::chrono::steady_clock;

constexpr const char* kRegistration = "registration";
constexpr const char* kEnd = "end";
/// Seconds that loading a plugin and registering what it offers may take: those of cairn's own need
/// milliseconds, of which a busy machine makes no second.
constexpr double kLoadingSeconds = 2.0;

// Results between the processes
// -------------------------------------------------------------------------

json::object result_json(const ConformanceResult& result) {
  json::array findings;
  for (const ConformanceFinding& finding : result.findings) {
    findings.push_back({{"law", printable(finding.law)},
                        {"problem", printable(finding.problem)},
                        {"input", text_json(printable(finding.input))},
                        {"times", finding.times}});
  }
  std::vector<std::string> notes;
  for (const std::string& note : result.notes) notes.push_back(printable(note));
  return {{"kind", result.checked.kind},
          {"name", result.checked.name},
          {"group", result.checked.group},
          {"checks", result.checks},
          {"ok", result.ok()},
          {"findings", std::move(findings)},
          {"notes", strings_json(notes)}};
}

std::string text_at(const json::object& object, std::string_view key) {
  const json::value& value = object.at(key);
  return value.is_string() ? std::string(value.as_string()) : std::string();
}

ConformanceCase case_of(const json::object& object) {
  return {text_at(object, "kind"), text_at(object, "name"), text_at(object, "group")};
}

ConformanceResult result_of(const json::object& object) {
  ConformanceResult result{case_of(object), object.at("checks").to_number<std::int64_t>(), {}, {}};
  for (const json::value& value : object.at("findings").as_array()) {
    const json::object& finding = value.as_object();
    result.findings.push_back({text_at(finding, "law"), text_at(finding, "problem"),
                               text_at(finding, "input"),
                               finding.at("times").to_number<std::int64_t>()});
  }
  for (const json::value& note : object.at("notes").as_array())
    result.notes.emplace_back(note.as_string());
  return result;
}

// The child
// ----------------------------------------------------------------------------------------

class CallsToParent final : public ConformanceObserver {
 public:
  explicit CallsToParent(const IsolatedWork::Sender& sender) : sender_(sender) {}
  void on_call(std::string_view callback, std::string_view input) override {
    sender_.calling(callback, input);
  }

 private:
  const IsolatedWork::Sender& sender_;
};

/// What the file offers; sorted as the registry has it.
std::vector<Offer> offers_of(const Registry& registry, const fs::path& file) {
  std::vector<Offer> own = registry.offers();
  std::error_code error;
  const fs::path canonical = fs::canonical(file, error);
  std::erase_if(own, [&](const Offer& offer) { return offer.file != canonical; });
  return own;
}

/// Has the plugin register the name.
void ask_for(const Offer& offer, Registry& registry) {
  if (offer.kind == "variable")
    registry.variable_type(offer.name);
  else if (offer.kind == "factor")
    registry.factor_type(offer.name);
  else
    registry.options(offer.kind, offer.name);
}

/// That everything on offer is registered, and that listings find the plugin. It is being loaded
/// since `begin`.
ConformanceResult check_registration(const fs::path& file, const std::vector<Offer>& offers,
                                     Registry& registry, Clock::time_point begin) {
  ConformanceResult result;
  result.checked = {"plugin", offers.empty() ? file.stem().string() : offers.front().plugin,
                    kRegistration};
  const auto check = [&](const char* law, const std::string& input, const auto& work) {
    ++result.checks;
    try {
      work();
    } catch (const Error& error) {
      result.findings.push_back({law, error.what(), input, 1});
    }
  };
  check("the plugin offers something", "", [&] {
    if (offers.empty()) throw Error(ErrorCode::plugin, "its manifest names nothing");
  });
  const fs::path sidecar = fs::path(file).replace_extension(".json");
  check("the file that listings read is beside it", "", [&] {
    if (!fs::exists(sidecar))
      throw Error(ErrorCode::plugin, sidecar.filename().string() + " is missing");
  });
  for (const Offer& offer : offers) {
    check("what the manifest declares is registered", fmt::format("{} {}", offer.kind, offer.name),
          [&] { ask_for(offer, registry); });
  }
  check("it is linked with every library that it uses", "", [&] {
    const std::vector<std::string> symbols = unlinked_symbols(file);
    if (symbols.empty()) return;
    throw Error(
        ErrorCode::plugin,
        fmt::format("not with {}{}; programs that have not loaded it, such as Python, "
                    "cannot load the plugin: LIBRARIES cairn::slam in cairn_add_plugin() "
                    "links it",
                    symbols.front(),
                    symbols.size() > 1 ? fmt::format(" and {} more", symbols.size() - 1) : ""));
  });
  check("it is loaded quickly", "", [&] {
    const double seconds = seconds_since(begin);
    if (seconds <= kLoadingSeconds) return;
    throw Error(ErrorCode::plugin,
                fmt::format("that takes {:.2g} s, and every command that asks for one of its names "
                            "waits for it",
                            seconds));
  });
  if (!registry.unoptimized().empty())
    result.notes.emplace_back("compiled without optimisation: right, but many times slower");
  return result;
}

PluginSearch search_of(const fs::path& file, const CommonOptions& common) {
  PluginSearch search{{file}, false, false, true};
  search.files.insert(search.files.end(), common.plugins.begin(), common.plugins.end());
  return search;
}

/// Loads the plugin, has everything registered, and ends the process as programs do: by `exit`,
/// which destroys what is static in the plugin.
void load_and_exit(const fs::path& file, const CommonOptions& common,
                   const IsolatedWork::Sender& sender) {
  static const IsolatedWork::Sender* last = nullptr;
  last = &sender;
  // What is registered first is called last: what was static in the plugin is gone then, and what
  // is static in this program, which the child has only a copy of, stays.
  const auto finished = [] {
    last->send("");
    std::_Exit(0);
  };
  if (std::atexit(finished) != 0) std::_Exit(0);
  {
    sender.calling("loading", "");
    Registry registry(search_of(file, common));
    for (const Offer& offer : offers_of(registry, file)) ask_for(offer, registry);
    sender.calling("the destructor of its types", "");
  }
  sender.calling("exit", "");
  std::exit(0);
}

struct Child {
  const fs::path& file;
  const PluginCheckOptions& options;
  const CommonOptions& common;
  std::size_t first;  ///< the group of checks to begin with

  void run(const IsolatedWork::Sender& sender) const {
    sender.calling("loading", "");
    const Clock::time_point begin = Clock::now();
    const PluginSearch search = search_of(file, common);
    std::optional<Registry> registry;
    ConformanceResult registration;
    std::vector<Offer> offers;
    try {
      registry.emplace(search);
      sender.calling("register_plugin", "");
      for (const std::string& types : common.types)
        registry->set_type_options(parse_component(types));
      offers = offers_of(*registry, file);
      registration = check_registration(file, offers, *registry, begin);
    } catch (const Error& error) {
      registration.checked = {"plugin", file.stem().string(), kRegistration};
      registration.checks = 1;
      registration.findings.push_back({"the plugin can be loaded", error.what(), "", 1});
    }
    std::vector<ConformanceCase> cases;
    if (registration.ok()) cases = conformance_cases(offers, *registry);
    json::array names;
    for (const ConformanceCase& one : cases)
      names.push_back({{"kind", one.kind}, {"name", one.name}, {"group", one.group}});
    json::object head{{"cases", std::move(names)}, {"registration", result_json(registration)}};
    if (!offers.empty()) head["version"] = offers.front().version;
    sender.send(json::serialize(head));

    CallsToParent calls(sender);
    for (std::size_t k = first; k < cases.size(); ++k) {
      const ConformanceResult result =
          check_conformance(cases[k], *registry, {.seed = options.seed}, &calls);
      sender.send(json::serialize(result_json(result)));
    }
  }
};

// The parent
// ---------------------------------------------------------------------------------------

/// Results of one file, as they come.
class FileCheck {
 public:
  FileCheck(std::string file, const PluginCheckOptions& options, Session& session)
      : file_(std::move(file)), options_(options), session_(session) {}

  void run() {
    session_.print(printable(file_) + "\n");
    while (run_child()) {
    }
    if (results_.front().ok()) run_end();
    std::int64_t checks = 0, bad = 0;
    for (const ConformanceResult& result : results_) {
      checks += result.checks;
      if (!result.ok()) ++bad;
    }
    session_.print(bad == 0 ? fmt::format("  all {} checks hold\n", checks)
                            : fmt::format("  groups of checks with findings: {} of {}\n", bad,
                                          results_.size()) +
                                  summary_of_findings());
  }

  /// "    format 'xyz': round trip, memory", a line for each component with findings.
  std::string summary_of_findings() const {
    std::string text, last;
    for (const ConformanceResult& result : results_) {
      if (result.ok()) continue;
      const std::string name =
          printable(fmt::format("{} '{}'", result.checked.kind, result.checked.name));
      text += name == last ? ", " : fmt::format("{}    {}: ", text.empty() ? "" : "\n", name);
      text += result.checked.group;
      last = name;
    }
    return text + "\n";
  }

  bool ok() const {
    return std::ranges::all_of(results_, [](const ConformanceResult& r) { return r.ok(); });
  }

  json::object report() const {
    json::array results;
    for (const ConformanceResult& result : results_) results.push_back(result_json(result));
    return {{"file", file_},
            {"version", text_json(version_)},
            {"ok", ok()},
            {"results", std::move(results)}};
  }

 private:
  void add(ConformanceResult result) {
    std::string text = "  " + to_text(result);
    for (std::size_t at = 0; (at = text.find('\n', at)) != std::string::npos; at += 3)
      text.insert(at + 1, "  ");
    session_.print(printable(text, true) + "\n");
    results_.push_back(std::move(result));
  }

  /// One child, from the group of checks `next_` on; whether another must go on after it.
  bool run_child() {
    const fs::path path(file_);
    const Child child{path, options_, session_.common, next_};
    IsolatedWork work([&](const IsolatedWork::Sender& sender) { child.run(sender); });
    bool registered = false;
    while (const std::optional<std::string> line = work.next_line(options_.seconds)) {
      const json::object message = json::parse(*line).as_object();
      if (!message.contains("cases")) {
        add(result_of(message));
        ++next_;
        continue;
      }
      registered = true;
      cases_.clear();
      for (const json::value& one : message.at("cases").as_array())
        cases_.push_back(case_of(one.as_object()));
      if (results_.empty()) {
        if (message.contains("version")) version_ = text_at(message, "version");
        add(result_of(message.at("registration").as_object()));
      }
    }
    const std::string failure = work.failure();
    if (failure.empty()) return false;
    add(failed(work, failure, registered));
    if (!registered) return false;
    const std::string name = cases_[next_].kind + cases_[next_].name;
    ++next_;
    // What does not return once would use up the time of each of its other groups.
    while (work.timed_out() && next_ < cases_.size() &&
           cases_[next_].kind + cases_[next_].name == name) {
      ConformanceResult skipped;
      skipped.checked = cases_[next_++];
      skipped.notes.emplace_back("not run, since a call did not return before");
      add(std::move(skipped));
    }
    return next_ < cases_.size();
  }

  /// That the process can end as it should, once the plugin is loaded.
  void run_end() {
    const fs::path path(file_);
    IsolatedWork work(
        [&](const IsolatedWork::Sender& sender) { load_and_exit(path, session_.common, sender); });
    while (work.next_line(options_.seconds)) {
    }
    ConformanceResult result;
    const std::string failure = work.failure();
    if (!failure.empty()) result = failed(work, failure, false);
    result.checked = {"plugin", results_.front().checked.name, kEnd};
    result.checks = 1;
    add(std::move(result));
  }

  /// The finding of a child that ended early.
  ConformanceResult failed(const IsolatedWork& work, const std::string& failure,
                           bool registered) const {
    ConformanceResult result;
    result.checked = {"plugin", fs::path(file_).stem().string(), kRegistration};
    if (registered && next_ < cases_.size()) result.checked = cases_[next_];
    result.checks = 1;
    std::string problem = "it " + failure;
    const std::string printed = work.printed();
    if (!printed.empty()) {
      const std::size_t last = printed.rfind('\n');
      problem += "; printed last: " + printed.substr(last == std::string::npos ? 0 : last + 1);
    }
    const char* const law =
        work.wrote_elsewhere() ? "{} writes to its own files alone" : "{} returns";
    result.findings.push_back({fmt::format(fmt::runtime(law), work.function()), printable(problem),
                               printable(work.arguments()), 1});
    return result;
  }

  std::string file_;
  const PluginCheckOptions& options_;
  Session& session_;
  std::string version_;
  std::vector<ConformanceCase> cases_;
  std::vector<ConformanceResult> results_;
  std::size_t next_ = 0;
};

}  // namespace

int check_plugins(const PluginCheckOptions& options, Session& session) {
  json::object report = begin_report("plugins");
  json::array files;
  bool ok = true;
  for (const std::string& file : options.files) {
    std::error_code ignored;
    if (fs::is_directory(file, ignored)) {
      throw Error(ErrorCode::usage,
                  fmt::format("{} is a folder; give the plugin's .so file", file));
    }
    session.files.add_input(file);
    FileCheck check(file, options, session);
    check.run();
    ok = ok && check.ok();
    files.push_back(check.report());
  }
  report["checked"] = std::move(files);
  report["ok"] = ok;
  session.write_json(report);
  return ok ? 0 : static_cast<int>(ErrorCode::plugin);
}

}  // namespace cairn::app
