// SPDX-License-Identifier: BSD-3-Clause
// The losses of a graph's factors, and chi2, which they enter.
#include <algorithm>
#include <limits>
#include <string>
#include <string_view>
#include <utility>

#include "cairn/graph/graph.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/threads.hpp"
#include "cairn/types/factor_call.hpp"
#include "cairn/types/loss_by_size.hpp"

namespace cairn {

std::int16_t Graph::loss_index(const FactorType& type, const std::shared_ptr<const Loss>& loss) {
  if (!loss || !type.takes_loss()) return 0;
  const auto at = std::ranges::find(losses_, loss) - losses_.begin();
  if (at > std::numeric_limits<std::int16_t>::max())
    throw Error(ErrorCode::usage, "a graph holds at most 32767 different losses");
  if (at == std::ssize(losses_)) losses_.push_back(loss);
  return static_cast<std::int16_t>(at);
}

std::int16_t Graph::loss_of(int position) const {
  return factor_pools_[factors_[position].pool].losses[factors_[position].entry];
}

void Graph::set_loss(int position, std::shared_ptr<const Loss> loss) {
  const FactorRef at = factors_[position];
  if (loss) loss = for_size(std::move(loss), information_rank(position));
  factor_pools_[at.pool].losses[at.entry] = loss_index(factor_type(position), loss);
}

void Graph::set_loss(const std::shared_ptr<const Loss>& loss, const FactorSelector& which) {
  const std::vector<bool> selected = select(*this, which);
  if (!loss && !has_losses()) return;
  losses_.resize(1);
  for (int f = 0; f < factor_count(); ++f) set_loss(f, selected[f] ? loss : nullptr);
}

const Loss* Graph::loss(int position) const { return losses_[loss_of(position)].get(); }

bool Graph::any_loss(int factor_pool, std::size_t begin, std::size_t end) const {
  if (!has_losses()) return false;
  const std::int16_t* of = factor_pools_[factor_pool].losses.data();
  return std::any_of(of + begin, of + end, [](std::int16_t k) { return k != 0; });
}

void Graph::weigh(int factor_pool, std::size_t begin, std::span<const double> norms,
                  std::span<double> rho, std::span<double> weights) const {
  const std::int16_t* of = factor_pools_[factor_pool].losses.data() + begin;
  // Neighbours mostly have one loss: a call for each run of them.
  for (std::size_t first = 0, last = 0; first < norms.size(); first = last) {
    while (last < norms.size() && of[last] == of[first]) ++last;
    const std::size_t count = last - first;
    const auto part = [&](std::span<double> all) {
      return all.empty() ? all : all.subspan(first, count);
    };
    if (const Loss* loss = losses_[of[first]].get()) {
      call_plugin(
          [&] {
            const std::string_view tag = factor_pools_[factor_pool].type->tag();
            return "the loss of factor '" + std::string(tag) + "'";
          },
          [&] { loss->evaluate(norms.subspan(first, count), part(rho), part(weights)); });
    } else {
      std::ranges::copy(norms.subspan(first, rho.empty() ? 0 : count), part(rho).begin());
      std::ranges::fill(part(weights), 1.0);
    }
  }
}

std::vector<double> squared_norms(const Graph& graph) {
  std::vector<double> result(graph.factor_count());
  std::vector<const double*> states;
  std::vector<double> norms;
  for (std::size_t p = 0; p < graph.factor_pools().size(); ++p) {
    const FactorPool& pool = graph.factor_pools()[p];
    const FactorView view = graph.view(static_cast<int>(p), graph.values(), states);
    norms.resize(pool.size());
    for_each_range(pool.size(), 512, [&](std::size_t begin, std::size_t end) {
      call_factor(*pool.type,
                  [&] { pool.type->squared_norms(view, begin, end, norms.data() + begin); });
    });
    for (std::size_t k = 0; k < pool.size(); ++k) result[pool.sequence[k]] = norms[k];
  }
  return result;
}

double chi2(const Graph& graph) {
  const std::vector<double> norms = squared_norms(graph);
  double sum = 0.0;
  for (int f = 0; f < graph.factor_count(); ++f) {
    const FactorRef at = graph.ref(f);
    double rho = 0.0;
    graph.weigh(at.pool, static_cast<std::size_t>(at.entry), {&norms[f], 1}, {&rho, 1}, {});
    sum += rho;
  }
  return sum;
}

}  // namespace cairn
