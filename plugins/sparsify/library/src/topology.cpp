// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/sparsification/topology.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <string>

#include <fmt/core.h>

#include "cairn/runtime/error.hpp"

namespace cairn {
namespace {

[[noreturn]] void refuse(const std::string& text) {
  throw Error(ErrorCode::usage, "population '" + text +
                                    "': expected tree:γ with γ ≥ 1, such as tree:2; fill:α with 0 "
                                    "< α ≤ 1, such as fill:0.5; or loss:KLD in nats, such as "
                                    "loss:0.01");
}

}  // namespace

Topology::~Topology() = default;

Population Population::parse(const std::string& text) {
  const std::size_t colon = text.find(':');
  if (colon == std::string::npos) refuse(text);
  const std::string kind = text.substr(0, colon);
  Population population;
  const char* const end = text.data() + text.size();
  const auto [at, problem] = std::from_chars(text.data() + colon + 1, end, population.value);
  if (problem != std::errc{} || at != end || !std::isfinite(population.value)) refuse(text);
  if (kind == "tree" && population.value >= 1.0) {
    population.kind = Kind::tree;
  } else if (kind == "fill" && population.value > 0.0 && population.value <= 1.0) {
    population.kind = Kind::fill;
  } else if (kind == "loss" && population.value >= 0.0) {
    population.kind = Kind::loss;
  } else {
    refuse(text);
  }
  return population;
}

std::string Population::text() const {
  const char* const name = kind == Kind::tree ? "tree" : kind == Kind::fill ? "fill" : "loss";
  return fmt::format("{}:{}", name, value);
}

int Population::count(int nodes) const {
  const int tree = nodes - 1, all = nodes * (nodes - 1) / 2;
  double wanted = tree;
  if (kind == Kind::tree) wanted = value * tree;
  if (kind == Kind::fill) wanted = value * all;
  return static_cast<int>(
      std::clamp(std::ceil(wanted - 1e-9), static_cast<double>(tree), static_cast<double>(all)));
}

}  // namespace cairn
