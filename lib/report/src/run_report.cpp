// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/report/run_report.hpp"

#include <initializer_list>
#include <stdexcept>
#include <utility>

#include <fmt/core.h>
#include <boost/json/parse.hpp>

#include "cairn/report/scene_json.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn {
namespace {

namespace json = boost::json;

/// A text within objects, or an empty one.
std::string text_at(const json::object& object, std::initializer_list<const char*> path) {
  const json::value* value = nullptr;
  const json::object* at = &object;
  for (const char* member : path) {
    value = at ? at->if_contains(member) : nullptr;
    at = value && value->is_object() ? &value->get_object() : nullptr;
  }
  return value && value->is_string() ? std::string(value->get_string()) : std::string();
}

BenchReport read_bench(const json::object& report, std::string_view text) {
  BenchReport bench{std::string(text), {}};
  const json::value& graphs = report.at("graphs");
  if (!graphs.is_array()) return bench;
  for (const json::value& graph : graphs.get_array()) {
    if (graph.is_object()) bench.graphs.push_back(text_at(graph.get_object(), {"graph", "file"}));
  }
  return bench;
}

std::vector<ReportedCovariance> read_covariances(const json::value& covariance,
                                                 const std::string& where) {
  const auto refuse = [&](const std::string& why) {
    return Error(
        ErrorCode::input,
        fmt::format("{}: member 'covariance' is not as cairn optimize writes it: {}", where, why));
  };
  std::vector<ReportedCovariance> all;
  try {
    for (const json::value& block : covariance.at("blocks").as_array()) {
      ReportedCovariance& one = all.emplace_back();
      one.id = block.at("id").to_number<Id>();
      for (const json::value& row : block.at("covariance").as_array()) {
        for (const json::value& number : row.as_array())
          one.covariance.push_back(number.to_number<double>());
      }
    }
  } catch (const boost::system::system_error& error) {
    throw refuse(error.code().message());
  } catch (const std::logic_error& error) {  // of Boost 1.81: a member that is missing, or no array
    throw refuse(error.what());
  }
  return all;
}

}  // namespace

std::variant<RunReport, BenchReport> read_report(std::string_view text, const std::string& where) {
  json::error_code error;
  const json::value value = json::parse({text.data(), text.size()}, error);
  if (error || !value.is_object()) {
    throw Error(ErrorCode::input,
                fmt::format("{}: begins like JSON but is not: {}", where, error.message()));
  }
  const json::object& report = value.get_object();
  const json::value* command = report.if_contains("command");
  if (command && *command == "bench" && report.contains("graphs")) return read_bench(report, text);
  RunReport run{.run = read_run(text, where),
                .graph = text_at(report, {"graph", "file"}),
                .output = text_at(report, {"output"}),
                .covariances = {}};
  const json::value* covariance = report.if_contains("covariance");
  run.has_covariances = covariance && covariance->is_object();
  if (run.has_covariances) run.covariances = read_covariances(*covariance, where);
  return run;
}

}  // namespace cairn
