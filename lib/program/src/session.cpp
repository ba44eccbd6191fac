// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/program/session.hpp"

#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <latch>
#include <stdexcept>
#include <thread>
#include <vector>

#include <fmt/core.h>

#include "cairn/io/format.hpp"
#include "cairn/plugin/plugin_search.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/program/json_text.hpp"
#include "cairn/program/option_words.hpp"
#include "cairn/program/table.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/threads.hpp"

namespace cairn::app {
namespace {

/// Starts as many threads as there will be, and ends them: where the system refuses one now, that
/// is an error, and later the end of the process. Throws `std::system_error`.
void try_threads(int count) {
  if (count == 0) count = static_cast<int>(std::thread::hardware_concurrency());
  std::latch all_started(1);
  std::vector<std::jthread> threads;
  threads.reserve(static_cast<std::size_t>(std::max(count, 1)));
  struct Release {
    std::latch& latch;
    ~Release() { latch.count_down(); }
  } const release{all_started};  // before they are joined, whatever happens
  for (int k = 1; k < count; ++k) threads.emplace_back([&] { all_started.wait(); });
}

}  // namespace

OptionFields<CommonOptions> CommonOptions::fields() {
  return OptionFields<CommonOptions>()
      .text("json", &CommonOptions::json, "write a report as JSON; - is standard output")
      .placeholder("FILE")
      .integer("threads", &CommonOptions::threads, 0, kMostThreads,
               "threads; 0 is all cores. Never changes a result")
      .text("plugin", &CommonOptions::plugins, "load this plugin too (may be given repeatedly)")
      .placeholder("FILE")
      .component("types", &CommonOptions::types, {"types"},
                 "options of types, such as slam3d:metric=g2o (repeatedly)")
      .placeholder("NAME:K=V")
      .boolean("quiet", &CommonOptions::quiet,
               "no progress, and no notes but those that stand in results");
}

Session::Session() = default;
Session::~Session() = default;

Registry& Session::registry() {
  if (!registry_) {
    PluginSearch search;
    search.files.assign(common.plugins.begin(), common.plugins.end());
    registry_ = std::make_unique<Registry>(search);
    types_are_set_ = false;
  }
  if (!types_are_set_) {
    for (const std::string& types : common.types)
      registry_->set_type_options(parse_component(types));
    types_are_set_ = true;
  }
  return *registry_;
}

void Session::set_common(CommonOptions given) {
  if (given.plugins != common.plugins) registry_.reset();
  types_are_set_ = false;
  common = std::move(given);
}

void Session::use_threads() const {
  try {
    try_threads(common.threads);
    set_threads(common.threads);
  } catch (const std::runtime_error& error) {  // of the standard library, and of oneTBB
    throw Error(
        ErrorCode::numerical,
        fmt::format("the threads cannot be started ({}); give fewer with --threads", error.what()));
  }
}

void Session::write_file_to_stdout() {
  if (common.json == "-") {
    throw Error(ErrorCode::usage,
                "both --json and an output file are '-', but there is one standard output; name a "
                "file for one of them");
  }
  if (stdout_is_file_) {
    throw Error(ErrorCode::usage,
                "two output files are '-', but there is one standard output; name a file for one "
                "of them");
  }
  stdout_is_file_ = true;
}

void Session::print(std::string_view text) const {
  if (common.json == "-") return;
  if (!stdout_is_file_) return write_stdout(text);
  if (!common.quiet && !stdout_reader_is_gone()) std::fwrite(text.data(), 1, text.size(), stderr);
}

bool Session::colour() const { return use_colour(stdout_is_file_ ? stderr : stdout); }

void Session::note(std::string_view text) const {
  if (common.quiet || text.empty()) return;
  const std::string line =
      fmt::format("note: {}\n", printable(in_command_line_words(std::string(text)), true));
  std::fwrite(line.data(), 1, line.size(), stderr);
}

void Session::write_json(const boost::json::object& report) const {
  if (!wants_json()) return;
  const std::string text = json_text(report) + "\n";
  if (common.json == "-") {
    write_stdout(text);
  } else {
    write_file(common.json, text);
  }
}

void write_stdout(std::string_view text) { write_file("-", text); }

bool stdout_reader_is_gone() {
  pollfd descriptor{STDOUT_FILENO, POLLOUT, 0};
  return ::poll(&descriptor, 1, 0) == 1 && (descriptor.revents & (POLLERR | POLLHUP)) != 0;
}

}  // namespace cairn::app
