// SPDX-License-Identifier: BSD-3-Clause
#include "sparsify_records.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <limits>
#include <map>
#include <memory>
#include <stdexcept>

#include <fmt/core.h>
#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <boost/json/parse.hpp>
#include <boost/json/serialize.hpp>
#include <boost/json/value_to.hpp>

#include "cairn/graph/packed.hpp"
#include "cairn/io/format.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/program/json_text.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/timed.hpp"

namespace cairn::app {
namespace {

namespace json = boost::json;
using Clock = std::chrono::steady_clock;

template <class Numbers>
json::array array_of(const Numbers& numbers) {
  return json::array(numbers.begin(), numbers.end());
}

/// The upper triangle of a symmetric matrix that is stored column by column.
std::vector<double> upper(const std::vector<double>& square, int n) {
  return pack(Eigen::Map<const Eigen::MatrixXd>(square.data(), n, n));
}

/// The inverse of `upper`. Throws `std::invalid_argument` if the numbers are too few or too many.
std::vector<double> square(const std::vector<double>& upper, int n) {
  if (upper.size() != packed_size(n)) {
    throw std::invalid_argument(fmt::format("an information matrix of {} numbers, expected {}",
                                            upper.size(), packed_size(n)));
  }
  const Eigen::MatrixXd A = unpack(upper, n);
  return {A.data(), A.data() + A.size()};
}

/// First column of each node.
std::vector<int> begins(const std::vector<int>& sizes) {
  std::vector<int> begin{0};
  for (const int n : sizes) begin.push_back(begin.back() + n);
  return begin;
}

json::object model_json(const FactorModel& model, const std::vector<int>& begin) {
  json::array numbers;
  for (const int node : model.nodes) {
    for (int k = begin[node] * model.size; k < begin[node + 1] * model.size; ++k)
      numbers.emplace_back(model.jacobian[k]);
  }
  return {{"nodes", array_of(model.nodes)}, {"size", model.size}, {"jacobian", std::move(numbers)}};
}

FactorModel read_model(const json::object& from, const std::vector<int>& begin) {
  FactorModel model;
  model.nodes = json::value_to<std::vector<int>>(from.at("nodes"));
  model.size = json::value_to<int>(from.at("size"));
  model.jacobian.resize(static_cast<std::size_t>(model.size) * begin.back());
  const auto numbers = json::value_to<std::vector<double>>(from.at("jacobian"));
  std::size_t at = 0;
  for (const int node : model.nodes) {
    for (int k = begin.at(node) * model.size; k < begin.at(node + 1) * model.size; ++k)
      model.jacobian.at(k) = numbers.at(at++);
  }
  return model;
}

/// The sums of one row.
struct Tally {
  ReplayRow row;
  double squares = 0.0;
  std::vector<double> times;

  void note(const std::string& text) {
    if (!text.empty()) ++row.notes[text];
  }
  void add(const RecoveryResult& result, double factors, double topology_seconds, bool positive) {
    ++row.problems;
    row.kld += result.kld;
    squares += result.kld * result.kld;
    row.factors += factors;
    row.topology_seconds += topology_seconds;
    row.recovery_seconds += result.seconds;
    times.push_back(result.seconds);
    row.iterations += result.iterations;
    row.not_converged += !result.converged;
    row.not_positive += !positive;
  }
  ReplayRow finish() {
    const double n = std::max(1, row.problems);
    for (double* sum :
         {&row.kld, &row.factors, &row.topology_seconds, &row.recovery_seconds, &row.iterations}) {
      *sum /= n;
    }
    row.kld_deviation = std::sqrt(std::max(0.0, squares / n - row.kld * row.kld));
    if (!times.empty()) {
      const auto middle = times.begin() + std::ssize(times) / 2;
      std::ranges::nth_element(times, middle);
      row.recovery_median = *middle;
    }
    return row;
  }
};

bool positive(const RecoveryResult& result) {
  return std::ranges::all_of(result.information, [](const std::vector<double>& numbers) {
    const auto m = static_cast<Eigen::Index>(std::lround(std::sqrt(std::ssize(numbers))));
    const Eigen::Map<const Eigen::MatrixXd> information(numbers.data(), m, m);
    return Eigen::LLT<Eigen::MatrixXd>(information).info() == Eigen::Success;
  });
}

}  // namespace

void ProblemRecorder::add(const SparsificationRecord& record) {
  if (!record.dense) return;
  const std::vector<int> begin = begins(record.dense->node_sizes);
  json::array states, models;
  for (const std::vector<double>& x : record.states) states.push_back(array_of(x));
  for (const FactorModel& model : record.dense->models) models.push_back(model_json(model, begin));
  problems_.push_back({{"removed", array_of(record.removed)},
                       {"blanket", array_of(record.blanket)},
                       {"variable", record.variable_type},
                       {"factor", record.factor_type},
                       {"states", std::move(states)},
                       {"sizes", array_of(record.dense->node_sizes)},
                       {"information", array_of(upper(record.dense->information, begin.back()))},
                       {"absolute", record.dense->absolute},
                       {"models", std::move(models)},
                       {"kld", record.recovery ? record.recovery->kld : 0.0}});
}

std::string ProblemRecorder::text() const {
  return json::serialize(json::object{{"problems", problems_}}) + "\n";
}

std::vector<DenseBlanket> read_problems(const std::string& file) {
  const std::string text = read_file(file);
  std::vector<DenseBlanket> problems;
  try {
    const json::value all = json::parse(text);
    for (const json::value& value : all.as_object().at("problems").as_array()) {
      const json::object& from = value.as_object();
      DenseBlanket blanket;
      blanket.node_sizes = json::value_to<std::vector<int>>(from.at("sizes"));
      const std::vector<int> begin = begins(blanket.node_sizes);
      blanket.information =
          square(json::value_to<std::vector<double>>(from.at("information")), begin.back());
      if (const json::value* absolute = from.if_contains("absolute"))
        blanket.absolute = absolute->as_bool();
      for (const json::value& model : from.at("models").as_array())
        blanket.models.push_back(read_model(model.as_object(), begin));
      problems.push_back(std::move(blanket));
    }
  } catch (const std::exception& error) {
    throw Error(ErrorCode::input,
                fmt::format("{}: no sparsification problems; expected what cairn study "
                            "sparsify --record writes ({})",
                            file, error.what()));
  }
  return problems;
}

std::vector<ReplayRow> replay_problems(const std::vector<DenseBlanket>& problems,
                                       const std::vector<std::string>& topologies,
                                       const std::string& population,
                                       const std::vector<std::string>& recoveries,
                                       const std::function<bool(std::size_t)>& step,
                                       Registry& registry, RecoveryCurves* curves) {
  std::vector<std::unique_ptr<Topology>> choosers;
  std::vector<std::unique_ptr<FactorRecovery>> methods;
  for (const std::string& name : topologies) choosers.push_back(registry.make<Topology>(name));
  for (const std::string& name : recoveries) methods.push_back(registry.make<FactorRecovery>(name));
  for (const auto& method : methods) method->trace(curves != nullptr);
  const Population rule = Population::parse(population);
  std::map<std::array<std::size_t, 3>, Tally> tallies;  // topology, recovery, nodes
  const auto both = [&](std::size_t t, std::size_t r, int nodes, const auto& change) {
    for (const int n : {0, nodes}) {
      Tally& tally = tallies[{t, r, static_cast<std::size_t>(n)}];
      tally.row.topology = topologies[t];
      tally.row.recovery = recoveries[r];
      tally.row.nodes = n;
      change(tally);
    }
  };
  for (std::size_t p = 0; p < problems.size(); ++p) {
    const DenseBlanket& blanket = problems[p];
    const int nodes = static_cast<int>(std::ssize(blanket.node_sizes));
    const BlanketProjection projection = project(blanket, Projection::node);
    const int count = rule.count(nodes) + (blanket.absolute ? 1 : 0);
    for (std::size_t t = 0; t < choosers.size(); ++t) {
      std::vector<FactorChoice> chosen;
      const auto begin = Clock::now();
      try {
        chosen = choosers[t]->choose(blanket, count);
      } catch (const Error&) {
        for (std::size_t r = 0; r < methods.size(); ++r)
          both(t, r, nodes, [](Tally& tally) { ++tally.row.refused; });
        continue;
      }
      const double seconds = seconds_since(begin);
      const std::string note = choosers[t]->note();
      const RecoveryProblem problem = projection.problem(blanket, chosen);
      double least = std::numeric_limits<double>::infinity();
      std::vector<double> klds(methods.size(), least);
      for (std::size_t r = 0; r < methods.size(); ++r) {
        try {
          const RecoveryResult result = methods[r]->recover(problem);
          klds[r] = result.kld;
          if (curves)
            curves->add(choosers.size() == 1 ? recoveries[r]
                                             : fmt::format("{} {}", topologies[t], recoveries[r]),
                        nodes, result.trace);
          least = std::min(least, result.kld);
          both(t, r, nodes, [&](Tally& tally) {
            tally.note(note);
            tally.add(result, static_cast<double>(chosen.size()), seconds, positive(result));
          });
        } catch (const Error&) {
          both(t, r, nodes, [](Tally& tally) { ++tally.row.refused; });
        }
      }
      for (std::size_t r = 0; r < methods.size(); ++r) {
        if (!std::isfinite(klds[r])) continue;
        both(t, r, nodes, [&](Tally& tally) {
          tally.row.largest_excess = std::max(tally.row.largest_excess, klds[r] - least);
        });
      }
    }
    if (step && !step(p + 1)) break;
  }
  std::vector<ReplayRow> rows;
  for (auto& [key, tally] : tallies) rows.push_back(tally.finish());
  return rows;
}

}  // namespace cairn::app
