// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/program/json_report.hpp"

#include <filesystem>
#include <thread>

#include <fmt/core.h>

#include "cairn/io/format.hpp"
#include "cairn/program/error_metric.hpp"
#include "cairn/program/graph_labels.hpp"
#include "cairn/program/peak_memory.hpp"
#include "cairn/runtime/version.hpp"

namespace cairn::app {
namespace {

namespace json = boost::json;

std::string compiler() {
#if defined(__clang__)
  return fmt::format("clang {}.{}.{}", __clang_major__, __clang_minor__, __clang_patchlevel__);
#else
  return fmt::format("gcc {}.{}.{}", __GNUC__, __GNUC_MINOR__, __GNUC_PATCHLEVEL__);
#endif
}

/// The widest instruction set that this processor offers to kernels that choose theirs when loaded.
std::string simd() {
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx512f")) return "avx512";
  if (__builtin_cpu_supports("avx2")) return "avx2";
  return "sse2";
#elif defined(__aarch64__)
  return "neon";
#else
  return "none";
#endif
}

}  // namespace

json::object begin_report(std::string_view command) {
  return {{"cairn", CAIRN_VERSION}, {"command", command}};
}

void end_report(json::object& report) {
  report["peak_memory_bytes"] = peak_memory_bytes();
  report["machine"] = {{"cpu", cpu_name()}, {"cores", std::thread::hardware_concurrency()}};
  report["build"] = {{"compiler", compiler()}, {"flags", CAIRN_BUILD_FLAGS}, {"simd", simd()}};
}

json::object graph_json(const Graph& graph, const std::string& file, const std::string& name) {
  return {{"file", file},
          {"name", name.empty() ? graph_label(file) : name},
          {"variables", graph.variable_count()},
          {"factors", graph.factor_count()},
          {"residual_size", graph.residual_size()},
          {"tangent_size", graph.tangent_size()},
          {"metric", text_json(metric_of(graph))}};
}

json::value text_json(const std::string& text) {
  return text.empty() ? json::value(nullptr) : json::value(text);
}

json::value number_json(double number) {
  return std::isfinite(number) ? json::value(number) : json::value(nullptr);
}

json::array strings_json(const std::vector<std::string>& strings) {
  return json::array(strings.begin(), strings.end());
}

std::string cpu_name() {
  // Not by a stream, which takes the lack of memory for the end of the file.
  const std::filesystem::path file = "/proc/cpuinfo";
  const std::string info = std::filesystem::exists(file) ? read_file(file) : "";
  const std::size_t line = info.find("model name");
  const std::size_t colon = line == std::string::npos ? line : info.find(": ", line);
  if (colon == std::string::npos) return "unknown";
  return info.substr(colon + 2, info.find('\n', colon) - colon - 2);
}

}  // namespace cairn::app
