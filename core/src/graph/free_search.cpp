// SPDX-License-Identifier: BSD-3-Clause
// The search for free directions along factors.
#include <algorithm>
#include <cstddef>
#include <numeric>
#include <optional>
#include <utility>

#include <Eigen/Core>

#include "cairn/graph/free_directions.hpp"
#include "dense/eigenvalues.hpp"
#include "equilibrated_rows.hpp"
#include "free_null_space.hpp"

namespace cairn {

LinearRows::~LinearRows() = default;

namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

/// A variable is determined where the eigenvalues of its information, scaled by the largest
/// diagonal entries of each unit, are above this; weaker directions become parameters, about which
/// all rows together decide.
constexpr double kSure = 1e-6;
/// Parameters are determined for good where the eigenvalues of RᵀR of their rows R, beside what
/// moves of this size in the factors' strongest directions would give, are above this: rounding is
/// far below.
constexpr double kResolved = 1e-6;
/// So many parameters that depend on each other are followed.
constexpr int kMostParameters = 100;

/// What the factors whose other variables are known say of one that is not: H δ = −b α.
struct Accumulated {
  MatrixXd H;
  std::vector<Column> b;
};

void add_to(std::vector<Column>& columns, int parameter, const VectorXd& delta) {
  const auto at = std::ranges::find(columns, parameter, &Column::parameter);
  if (at != columns.end()) {
    at->delta += delta;
  } else {
    columns.push_back({parameter, delta});
  }
}

class Search {
 public:
  Search(const LinearRows& rows, const FreeSearch& search)
      : rows_(rows, search), unknown_(search.sizes.size()) {
    for (std::size_t v = 0; v < unknown_.size(); ++v) unknown_[v] = !search.determined[v];
  }

  FreeDirections run() {
    list_factors();
    while (go_on() && introduce_parameters()) {
    }
    FreeDirections found;
    found.everywhere = rows_.constant();
    if (complete_ && !parameters_.empty()) collect(found);
    found.complete = complete_;
    found.finite = rows_.finite();
    return found;
  }

 private:
  bool known(std::int32_t v) const { return !unknown_[static_cast<std::size_t>(v)]; }
  int size(std::int32_t v) const { return rows_.size(v); }

  /// The factors of each variable that is not known, one after the other, and of each factor how
  /// many such variables it has.
  void list_factors() {
    begin_.assign(unknown_.size() + 1, 0);
    missing_.assign(static_cast<std::size_t>(rows_.factors()), 0);
    for (std::size_t k = 0; k < static_cast<std::size_t>(rows_.factors()); ++k) {
      for (const std::int32_t v : rows_.variables(static_cast<std::int32_t>(k))) {
        if (known(v)) continue;
        ++missing_[k];
        ++begin_[static_cast<std::size_t>(v) + 1];
      }
      if (missing_[k] == 1) queue_.push_back(static_cast<std::int32_t>(k));
    }
    std::partial_sum(begin_.begin(), begin_.end(), begin_.begin());
    factors_of_.resize(static_cast<std::size_t>(begin_.back()));
    std::vector<std::int32_t> next(begin_.begin(), begin_.end() - 1);
    for (std::size_t k = 0; k < static_cast<std::size_t>(rows_.factors()); ++k) {
      if (missing_[k] == 0) continue;
      for (const std::int32_t v : rows_.variables(static_cast<std::int32_t>(k))) {
        if (!known(v))
          factors_of_[static_cast<std::size_t>(next[static_cast<std::size_t>(v)]++)] =
              static_cast<std::int32_t>(k);
      }
    }
  }

  std::span<const std::int32_t> factors_of(std::int32_t v) const {
    const auto begin = static_cast<std::size_t>(begin_[static_cast<std::size_t>(v)]);
    const auto end = static_cast<std::size_t>(begin_[static_cast<std::size_t>(v) + 1]);
    return std::span(factors_of_).subspan(begin, end - begin);
  }

  // Going on ---------------------------------------------------------------------------------

  /// From factors with one unknown variable to the next. False if the search was given up.
  bool go_on() {
    while (next_ < queue_.size() && complete_) {
      const std::int32_t k = queue_[next_++];
      const auto on = rows_.variables(k);
      const auto unknown = std::ranges::find_if(on, [&](std::int32_t v) { return !known(v); });
      if (unknown == on.end()) continue;
      const bool moving = is_moving(on);
      if (!moving && rows_.determines_each(k)) {
        now_known(*unknown);
      } else {
        accumulate(k, *unknown);
      }
    }
    return complete_;
  }

  bool is_moving(std::span<const std::int32_t> on) {
    if (parameters_.empty()) return false;
    return std::ranges::any_of(on, [&](std::int32_t v) { return !moves(v).empty(); });
  }

  /// The columns of a variable whose parameters are not determined yet.
  std::vector<Column>& moves(std::int32_t v) {
    if (moves_.empty()) return no_moves_;
    std::vector<Column>& columns = moves_[static_cast<std::size_t>(v)];
    std::erase_if(columns, [&](const Column& column) {
      return parts_[static_cast<std::size_t>(part_of(column.parameter))].dead;
    });
    return columns;
  }

  /// `rows_.J()` of a factor. False if it is not finite: then the search is given up.
  bool evaluate(std::int32_t k) {
    complete_ = rows_.evaluate(k) && complete_;
    return complete_;
  }

  /// What a factor with one unknown variable says of it.
  void accumulate(std::int32_t k, std::int32_t unknown) {
    if (!evaluate(k)) return;
    if (accumulated_.empty()) accumulated_.resize(unknown_.size());
    std::optional<Accumulated>& of = accumulated_[static_cast<std::size_t>(unknown)];
    if (!of) {
      of = Accumulated{MatrixXd::Zero(size(unknown), size(unknown)), {}};
      touched_.push_back(unknown);
    }
    const auto on = rows_.variables(k);
    Eigen::Index at = 0, of_unknown = 0;
    for (const std::int32_t v : on) {
      if (v == unknown) of_unknown = at;
      at += size(v);
    }
    const MatrixXd J_unknown = rows_.J().middleCols(of_unknown, size(unknown));
    of->H.noalias() += J_unknown.transpose() * J_unknown;
    at = 0;
    for (const std::int32_t v : on) {
      if (v != unknown) {
        for (const Column& column : moves(v))
          add_to(of->b, column.parameter,
                 J_unknown.transpose() * (rows_.J().middleCols(at, size(v)) * column.delta));
      }
      at += size(v);
    }
    settle(unknown, *of, /*with_parameters=*/false);
  }

  /// The variable becomes known if its information has full rank, or if what it lacks becomes
  /// parameters.
  void settle(std::int32_t v, Accumulated& of, bool with_parameters) {
    const VectorXd scale = inverse_root(rows_.largest_of_unit(v, of.H.diagonal()));
    const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(scaled(of.H, scale));
    const VectorXd& values = eigen.eigenvalues();
    const int n = size(v);
    int weak = 0;
    while (weak < n && !(values[weak] > kSure)) ++weak;
    if (weak > 0 && !with_parameters) return;
    const MatrixXd strong = scale.asDiagonal() * eigen.eigenvectors().rightCols(n - weak);
    std::erase_if(of.b, [&](const Column& column) {
      return parts_[static_cast<std::size_t>(part_of(column.parameter))].dead;
    });
    if (!of.b.empty() || weak > 0) moves_.resize(unknown_.size());
    std::vector<Column> columns;
    for (const Column& column : of.b) {
      columns.push_back(
          {column.parameter,
           -(strong * (strong.transpose() * column.delta).cwiseQuotient(values.tail(n - weak)))});
    }
    for (int j = 0; j < weak; ++j)
      columns.push_back({new_parameter(), scale.asDiagonal() * eigen.eigenvectors().col(j)});
    if (!columns.empty()) moves_[static_cast<std::size_t>(v)] = std::move(columns);
    now_known(v);
  }

  void now_known(std::int32_t v) {
    unknown_[static_cast<std::size_t>(v)] = false;
    for (const std::int32_t k : factors_of(v)) {
      const std::int32_t left = --missing_[static_cast<std::size_t>(k)];
      if (left == 1) queue_.push_back(k);
      if (left == 0 && is_moving(rows_.variables(k))) constrain(k);
      if (!complete_) return;
    }
  }

  // Parameters -------------------------------------------------------------------------------

  int new_parameter() {
    const int parameter = static_cast<int>(parameters_.size());
    parameters_.push_back(static_cast<int>(parts_.size()));
    parts_.push_back({{parameter}, MatrixXd::Zero(1, 1), VectorXd::Zero(1)});
    return parameter;
  }

  int part_of(int parameter) const { return parameters_[static_cast<std::size_t>(parameter)]; }

  /// Where nothing more follows from what is known: a variable that moves by parameters, of those
  /// that some row joins with what is known the largest, or of all. False if all are known.
  bool introduce_parameters() {
    for (std::size_t p = 0; p < parts_.size(); ++p) resolve(parts_[p]);
    std::int32_t best = -1;
    std::erase_if(touched_, [&](std::int32_t v) { return known(v); });
    for (const std::int32_t v : touched_)
      if (best < 0 || size(v) > size(best)) best = v;
    if (best < 0) {
      if (rest_.empty() && !listed_) list_rest();
      while (!rest_.empty() && known(rest_.back())) rest_.pop_back();
      if (rest_.empty()) return false;
      best = rest_.back();
    }
    if (accumulated_.empty()) accumulated_.resize(unknown_.size());
    std::optional<Accumulated>& of = accumulated_[static_cast<std::size_t>(best)];
    if (!of) of = Accumulated{MatrixXd::Zero(size(best), size(best)), {}};
    settle(best, *of, /*with_parameters=*/true);
    return complete_;
  }

  /// Variables that are not known, the largest and of these the first one last.
  void list_rest() {
    listed_ = true;
    for (std::size_t v = unknown_.size(); v-- > 0;)
      if (unknown_[v]) rest_.push_back(static_cast<std::int32_t>(v));
    std::ranges::stable_sort(rest_, {}, [&](std::int32_t v) { return size(v); });
  }

  /// All of a factor's variables are known: what its rows are must be zero.
  void constrain(std::int32_t k) {
    if (!evaluate(k)) return;
    std::vector<Column> R, sizes;
    Eigen::Index at = 0;
    for (const std::int32_t v : rows_.variables(k)) {
      const auto J = rows_.J().middleCols(at, size(v));
      const VectorXd D = rows_.largest_of_unit(v, J.colwise().squaredNorm().transpose());
      for (const Column& column : moves(v)) {
        add_to(R, column.parameter, J * column.delta);
        const double most = column.delta.dot(D.cwiseProduct(column.delta));
        add_to(sizes, column.parameter, VectorXd::Constant(1, most));
      }
      at += size(v);
    }
    if (R.empty()) return;
    Part& part = united(R);
    if (!complete_) return;
    std::vector<Eigen::Index> place;
    for (const Column& column : R)
      place.push_back(std::ranges::find(part.parameters, column.parameter) -
                      part.parameters.begin());
    for (std::size_t a = 0; a < R.size(); ++a) {
      part.size[place[a]] += sizes[a].delta[0];
      for (std::size_t b = 0; b < R.size(); ++b)
        part.S(place[a], place[b]) += R[a].delta.dot(R[b].delta);
    }
    ++part.added;
    if ((part.added & (part.added - 1)) == 0) resolve(part);
  }

  /// The part with all of these parameters.
  Part& united(const std::vector<Column>& columns) {
    const int into = part_of(columns.front().parameter);
    for (const Column& column : columns) {
      const int from = part_of(column.parameter);
      if (from == into) continue;
      Part& a = parts_[static_cast<std::size_t>(into)];
      Part& b = parts_[static_cast<std::size_t>(from)];
      const Eigen::Index n = a.S.rows(), m = b.S.rows();
      if (n + m > kMostParameters) {
        complete_ = false;
        return a;
      }
      MatrixXd S = MatrixXd::Zero(n + m, n + m);
      S.topLeftCorner(n, n) = a.S;
      S.bottomRightCorner(m, m) = b.S;
      a.S = std::move(S);
      a.size.conservativeResize(n + m);
      a.size.tail(m) = b.size;
      a.added += b.added;
      for (const int parameter : b.parameters) {
        a.parameters.push_back(parameter);
        parameters_[static_cast<std::size_t>(parameter)] = into;
      }
      b = {};
      b.dead = true;
    }
    return parts_[static_cast<std::size_t>(into)];
  }

  static void resolve(Part& part) {
    if (part.dead || part.added == 0) return;
    if (!(part.S.diagonal().array() > kResolved * part.size.array()).all()) return;
    const MatrixXd S = scaled(part.S, inverse_root(part.size));
    part.dead = Eigen::SelfAdjointEigenSolver<MatrixXd>(S, Eigen::EigenvaluesOnly)
                    .eigenvalues()
                    .minCoeff() > kResolved;
  }

  // What is left -----------------------------------------------------------------------------

  void collect(FreeDirections& found) {
    moves_.resize(unknown_.size());
    for (std::size_t v = 0; v < moves_.size(); ++v) moves(static_cast<std::int32_t>(v));
    found.directions = free_null_space(
        {rows_, parts_, parameters_, moves_, [this](std::int32_t v) { return factors_of(v); }});
    complete_ = rows_.finite();
    if (!complete_) found.directions.clear();
  }

  EquilibratedRows rows_;
  std::vector<char> unknown_;        // by variable
  std::vector<std::int32_t> begin_;  // by variable: its first place in …
  std::vector<std::int32_t> factors_of_;
  std::vector<std::int32_t> missing_;                    // by factor: variables that are not known
  std::vector<std::int32_t> queue_;                      // factors that came to miss one
  std::size_t next_ = 0;                                 // of these
  std::vector<std::optional<Accumulated>> accumulated_;  // by variable
  std::vector<std::int32_t> touched_;                    // those that have it
  std::vector<std::int32_t> rest_;
  bool listed_ = false;
  std::vector<std::vector<Column>> moves_;  // by variable, of those that are known
  std::vector<Column> no_moves_;            // of what does not move
  std::vector<int> parameters_;             // the part of each
  std::vector<Part> parts_;
  bool complete_ = true;
};

}  // namespace

FreeDirections find_free_directions(const LinearRows& rows, const FreeSearch& search) {
  return Search(rows, search).run();
}

}  // namespace cairn
