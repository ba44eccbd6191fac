// SPDX-License-Identifier: BSD-3-Clause
#include "reading.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <functional>

#include "cairn/runtime/error.hpp"

namespace cairn::test {
namespace {

std::vector<double> copy_of(std::span<const double> numbers) {
  return {numbers.begin(), numbers.end()};
}

std::string refusal_of(const std::function<void()>& call) {
  try {
    call();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::input) << error.what();
    return error.what();
  }
  return "";
}

bool same_bits(std::span<const double> a, std::span<const double> b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size_bytes()) == 0;
}

}  // namespace

std::vector<double> Reading::state(Id id) const {
  const auto index = graph.find(id);
  EXPECT_TRUE(index) << "no variable " << id;
  return index ? copy_of(graph.state(*index)) : std::vector<double>();
}
std::vector<double> Reading::measurement(int factor) const {
  return copy_of(graph.measurement(factor));
}
std::vector<double> Reading::information(int factor) const {
  return copy_of(graph.information(factor));
}
std::vector<Id> Reading::ids(int factor) const {
  std::vector<Id> ids;
  for (const int v : graph.factor_variables(factor)) ids.push_back(graph.id(v));
  return ids;
}
std::string Reading::factor_tag(int factor) const {
  return std::string(graph.factor_type(factor).tag());
}
std::string Reading::variable_tag(Id id) const {
  const auto index = graph.find(id);
  return index ? std::string(graph.type(*index).tag()) : "";
}

Registry& registry() {
  static Registry instance;
  return instance;
}

Reading read(std::string_view format, std::string_view text, const ReadOptions& options) {
  Reading reading;
  reading.graph =
      registry().make<Format>(format)->read(text, "file", registry(), options, reading.report);
  return reading;
}

std::string refusal(std::string_view format, std::string_view text, const ReadOptions& options) {
  return refusal_of([&] { read(format, text, options); });
}

std::string write(std::string_view format, const Graph& graph) {
  return registry().make<Format>(format)->write(graph);
}

std::string write_refusal(std::string_view format, const Graph& graph) {
  return refusal_of([&] { write(format, graph); });
}

std::string detected(std::string_view text) {
  int best = 0;
  std::string surest;
  for (const std::string& name : registry().names(Format::kKind)) {
    const int score = registry().make<Format>(name)->detect(text);
    if (score > best) {
      best = score;
      surest = name;
    }
  }
  return surest;
}

std::string difference(const Graph& a, const Graph& b) {
  if (a.variable_count() != b.variable_count()) return "number of variables";
  if (a.factor_count() != b.factor_count()) return "number of factors";
  for (int v = 0; v < a.variable_count(); ++v) {
    const bool same = a.id(v) == b.id(v) && a.type(v).tag() == b.type(v).tag() &&
                      a.fixed(v) == b.fixed(v) && same_bits(a.state(v), b.state(v));
    if (!same) return a.describe_variable(v);
  }
  for (int f = 0; f < a.factor_count(); ++f) {
    const bool same = a.describe_factor(f) == b.describe_factor(f) &&
                      std::ranges::equal(a.factor_variables(f), b.factor_variables(f)) &&
                      same_bits(a.measurement(f), b.measurement(f)) &&
                      same_bits(a.information(f), b.information(f));
    if (!same) return a.describe_factor(f);
  }
  return "";
}

}  // namespace cairn::test
