// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/graph/free_directions.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numeric>
#include <optional>
#include <utility>

#include <Eigen/Core>

#include "cairn/types/factor_call.hpp"
#include "dense/eigenvalues.hpp"
#include "free_alone.hpp"

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
/// A direction is free where its eigenvalue of the scaled H is below this.
constexpr double kFree = 1e-13;
/// A number below this part of the largest of its row is rounding.
constexpr double kNothing = 1e-14;
/// The squares of smaller numbers vanish.
constexpr double kVanishing = 1e-150;
/// What a factor says of a direction is rounding below this part of what all say of its variables.
constexpr double kBarely = 1e-18;
/// Of scaled Gram matrices: what is smaller is rounding.
constexpr double kRounding = 1e-14;
/// So many parameters that depend on each other are followed.
constexpr int kMostParameters = 100;
/// What a basis vector has below this part of its largest number is rounding.
constexpr double kNoMove = 1e-9;

/// Divides each row by its largest number: how much a row weighs says nothing of what it leaves
/// free, and where rows differ by many orders of magnitude the weak ones are measurements still.
void equilibrate(MatrixXd& J) {
  for (Eigen::Index row = 0; row < J.rows(); ++row) {
    const double largest = J.row(row).cwiseAbs().maxCoeff();
    if (largest > kVanishing) {
      J.row(row) =
          (J.row(row).array().abs() > kNothing * largest).select(J.row(row).array() / largest, 0.0);
    } else {
      J.row(row).setZero();
    }
  }
}

/// How a variable moves with one parameter.
struct Column {
  int parameter;
  VectorXd delta;
};

/// What the factors whose other variables are known say of one that is not: H δ = −b α.
struct Accumulated {
  MatrixXd H;
  std::vector<Column> b;
};

/// Parameters that rows have in common, and the sum S = Σ RᵀR of these rows, R = Σ J T over the
/// variables of a factor; `size`, by parameter: what that is at most, Σ Σ Tᵀ D T, D the squared
/// norms of the columns of J, the largest of each unit.
struct Part {
  std::vector<int> parameters;
  MatrixXd S;
  VectorXd size;
  int added = 0;      ///< factors
  bool dead = false;  ///< all of its parameters are determined
};

void add_to(std::vector<Column>& columns, int parameter, const VectorXd& delta) {
  const auto at = std::ranges::find(columns, parameter, &Column::parameter);
  if (at != columns.end()) {
    at->delta += delta;
  } else {
    columns.push_back({parameter, delta});
  }
}

/// 1 / √d, 1 for what is zero.
VectorXd inverse_root(const VectorXd& diagonal) {
  return diagonal.unaryExpr([](double d) { return d > 0.0 ? 1.0 / std::sqrt(d) : 1.0; });
}

MatrixXd scaled(const MatrixXd& A, const VectorXd& scale) {
  return scale.asDiagonal() * A * scale.asDiagonal();
}

class Search {
 public:
  Search(const LinearRows& rows, const FreeSearch& search)
      : rows_(rows),
        sizes_(search.sizes),
        of_one_unit_(search.of_one_unit),
        factors_(search.factors) {
    unknown_.resize(sizes_.size());
    for (std::size_t v = 0; v < sizes_.size(); ++v) unknown_[v] = !search.determined[v];
  }

  FreeDirections run() {
    list_factors();
    while (go_on() && introduce_parameters()) {
    }
    FreeDirections found;
    found.everywhere = !evaluated_ && rows_.constant();
    if (complete_) collect(found);
    found.complete = complete_;
    found.finite = finite_;
    return found;
  }

 private:
  bool known(std::int32_t v) const { return !unknown_[static_cast<std::size_t>(v)]; }
  int size(std::int32_t v) const { return sizes_[static_cast<std::size_t>(v)]; }

  /// Each number of a variable's tangent space replaced by the largest of the same unit.
  VectorXd largest_of_unit(std::int32_t v, VectorXd numbers) const {
    const Eigen::Index n = numbers.size(), first = of_one_unit_[static_cast<std::size_t>(v)];
    numbers.head(first).setConstant(numbers.head(first).maxCoeff());
    if (first < n) numbers.tail(n - first).setConstant(numbers.tail(n - first).maxCoeff());
    return numbers;
  }

  /// The factors of each variable that is not known, one after the other, and of each factor how
  /// many such variables it has.
  void list_factors() {
    begin_.assign(sizes_.size() + 1, 0);
    missing_.assign(factors_.size(), 0);
    for (std::size_t k = 0; k < factors_.size(); ++k) {
      for (const std::int32_t v : rows_.variables(factors_[k])) {
        if (known(v)) continue;
        ++missing_[k];
        ++begin_[static_cast<std::size_t>(v) + 1];
      }
      if (missing_[k] == 1) queue_.push_back(static_cast<std::int32_t>(k));
    }
    std::partial_sum(begin_.begin(), begin_.end(), begin_.begin());
    factors_of_.resize(static_cast<std::size_t>(begin_.back()));
    std::vector<std::int32_t> next(begin_.begin(), begin_.end() - 1);
    for (std::size_t k = 0; k < factors_.size(); ++k) {
      if (missing_[k] == 0) continue;
      for (const std::int32_t v : rows_.variables(factors_[k])) {
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
      const auto on = rows_.variables(factors_[static_cast<std::size_t>(k)]);
      const auto unknown = std::ranges::find_if(on, [&](std::int32_t v) { return !known(v); });
      if (unknown == on.end()) continue;
      const bool moving = is_moving(on);
      if (!moving && rows_.determines_each(factors_[static_cast<std::size_t>(k)])) {
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

  /// J of a factor, each row divided by its largest number. False if it has numbers that are not
  /// finite: then the search is given up.
  bool evaluate(std::int32_t k) {
    const int factor = factors_[static_cast<std::size_t>(k)];
    int columns = 0;
    evaluated_ = true;
    for (const std::int32_t v : rows_.variables(factor)) columns += size(v);
    J_.resize(rows_.rows(factor), columns);
    rows_.jacobian(factor, {J_.data(), static_cast<std::size_t>(J_.size())});
    finite_ = J_.allFinite();
    complete_ = complete_ && finite_;
    if (complete_) equilibrate(J_);
    return complete_;
  }

  /// What a factor with one unknown variable says of it.
  void accumulate(std::int32_t k, std::int32_t unknown) {
    if (!evaluate(k)) return;
    if (accumulated_.empty()) accumulated_.resize(sizes_.size());
    std::optional<Accumulated>& of = accumulated_[static_cast<std::size_t>(unknown)];
    if (!of) {
      of = Accumulated{MatrixXd::Zero(size(unknown), size(unknown)), {}};
      touched_.push_back(unknown);
    }
    const auto on = rows_.variables(factors_[static_cast<std::size_t>(k)]);
    Eigen::Index at = 0, of_unknown = 0;
    for (const std::int32_t v : on) {
      if (v == unknown) of_unknown = at;
      at += size(v);
    }
    const MatrixXd J_unknown = J_.middleCols(of_unknown, size(unknown));
    of->H.noalias() += J_unknown.transpose() * J_unknown;
    at = 0;
    for (const std::int32_t v : on) {
      if (v != unknown) {
        for (const Column& column : moves(v))
          add_to(of->b, column.parameter,
                 J_unknown.transpose() * (J_.middleCols(at, size(v)) * column.delta));
      }
      at += size(v);
    }
    settle(unknown, *of, /*with_parameters=*/false);
  }

  /// The variable becomes known if its information has full rank, or if what it lacks becomes
  /// parameters.
  void settle(std::int32_t v, Accumulated& of, bool with_parameters) {
    const VectorXd scale = inverse_root(largest_of_unit(v, of.H.diagonal()));
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
    if (!of.b.empty() || weak > 0) moves_.resize(sizes_.size());
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
      if (left == 0 && is_moving(rows_.variables(factors_[static_cast<std::size_t>(k)])))
        constrain(k);
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
    if (accumulated_.empty()) accumulated_.resize(sizes_.size());
    std::optional<Accumulated>& of = accumulated_[static_cast<std::size_t>(best)];
    if (!of) of = Accumulated{MatrixXd::Zero(size(best), size(best)), {}};
    settle(best, *of, /*with_parameters=*/true);
    return complete_;
  }

  /// Variables that are not known, the largest and of these the first one last.
  void list_rest() {
    listed_ = true;
    for (std::size_t v = sizes_.size(); v-- > 0;)
      if (unknown_[v]) rest_.push_back(static_cast<std::int32_t>(v));
    std::ranges::stable_sort(rest_, {}, [&](std::int32_t v) { return size(v); });
  }

  /// All of a factor's variables are known: what its rows are must be zero.
  void constrain(std::int32_t k) {
    if (!evaluate(k)) return;
    std::vector<Column> R, sizes;
    Eigen::Index at = 0;
    for (const std::int32_t v : rows_.variables(factors_[static_cast<std::size_t>(k)])) {
      const auto J = J_.middleCols(at, size(v));
      const VectorXd D = largest_of_unit(v, J.colwise().squaredNorm().transpose());
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
    if (parameters_.empty()) return;
    find_movers();
    if (!complete_) return;
    int number = 0;
    for (std::size_t p = 0; p < parts_.size(); ++p) {
      if (parts_[p].dead) continue;
      const MatrixXd basis = null_space(parts_[p], movers_of_[p]);
      for (Eigen::Index j = 0; j < basis.cols(); ++j) {
        FreeDirection direction = direction_of(parts_[p], movers_of_[p], basis.col(j));
        direction.part = number;
        if (!direction.moves.empty()) found.directions.push_back(std::move(direction));
      }
      number += basis.cols() > 0;
    }
  }

  /// The variables that move with each part, and the diagonal of their blocks of H.
  void find_movers() {
    movers_of_.resize(parts_.size());
    diagonal_.resize(sizes_.size());
    double largest = 0.0;
    for (std::size_t v = 0; v < moves_.size() && complete_; ++v) {
      const std::vector<Column>& columns = moves(static_cast<std::int32_t>(v));
      if (columns.empty()) continue;
      const auto variable = static_cast<std::int32_t>(v);
      movers_of_[static_cast<std::size_t>(part_of(columns.front().parameter))].push_back(variable);
      diagonal_[v] = VectorXd::Zero(size(variable));
      for (const std::int32_t k : factors_of(variable)) {
        if (!evaluate(k)) return;
        Eigen::Index at = 0;
        for (const std::int32_t w : rows_.variables(factors_[static_cast<std::size_t>(k)])) {
          if (w == variable)
            diagonal_[v] += J_.middleCols(at, size(w)).colwise().squaredNorm().transpose();
          at += size(w);
        }
      }
      diagonal_[v] = largest_of_unit(variable, diagonal_[v]);
      largest = std::max(largest, diagonal_[v].maxCoeff());
    }
    for (VectorXd& of : diagonal_)
      of = of.unaryExpr([&](double d) { return d > 0.0 ? d : largest > 0.0 ? largest : 1.0; });
  }

  /// Those α of a part that no row sees, each with as many zeros as elimination gives it.
  MatrixXd null_space(const Part& part, std::span<const std::int32_t> movers) {
    const auto n = static_cast<Eigen::Index>(part.parameters.size());
    MatrixXd G = MatrixXd::Zero(n, n);  // Tᵀ D T
    for (const std::int32_t v : movers) {
      const std::vector<Column>& columns = moves(v);
      for (const Column& a : columns)
        for (const Column& b : columns)
          G(place(part, a), place(part, b)) +=
              a.delta.dot(diagonal_[static_cast<std::size_t>(v)].cwiseProduct(b.delta));
    }
    // S a = q G a, with unit diagonal of G, and its inverse root by eigenvectors.
    const VectorXd scale = inverse_root(G.diagonal());
    const Eigen::SelfAdjointEigenSolver<MatrixXd> of_G(scaled(G, scale));
    const VectorXd root = of_G.eigenvalues().cwiseMax(kRounding).cwiseSqrt().cwiseInverse();
    const MatrixXd W = scale.asDiagonal() * of_G.eigenvectors() * root.asDiagonal();
    const MatrixXd S = W.transpose() * part.S * W;
    const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(S);
    Eigen::Index free = 0;
    while (free < n && eigen.eigenvalues()[free] <= kFree) ++free;
    MatrixXd A = unseen(movers, part, W * eigen.eigenvectors().leftCols(free));
    // In units of the scaled parameters, so that numbers can be compared.
    A = scale.cwiseInverse().asDiagonal() * A;
    eliminate(A);
    return scale.asDiagonal() * A;
  }

  /// Of those α that rows hardly see beside all that moves with them, the ones that no row sees
  /// beside what it could see of the variables that it is on: one prior at the end of a long chain
  /// is little, and no rounding.
  MatrixXd unseen(std::span<const std::int32_t> movers, const Part& part, const MatrixXd& A) {
    if (A.cols() == 0) return A;
    std::vector<std::int32_t> factors;
    for (const std::int32_t v : movers) {
      const auto of = factors_of(v);
      factors.insert(factors.end(), of.begin(), of.end());
    }
    std::ranges::sort(factors);
    factors.erase(std::unique(factors.begin(), factors.end()), factors.end());
    MatrixXd S = MatrixXd::Zero(A.cols(), A.cols());
    for (const std::int32_t k : factors) {
      if (!evaluate(k)) return MatrixXd(A.rows(), 0);
      MatrixXd R = MatrixXd::Zero(J_.rows(), A.cols());
      double most = 0.0, of_all = 0.0;
      Eigen::Index at = 0;
      for (const std::int32_t v : rows_.variables(factors_[static_cast<std::size_t>(k)])) {
        MatrixXd moved = MatrixXd::Zero(size(v), A.cols());
        for (const Column& column : moves(v)) moved += column.delta * A.row(place(part, column));
        const auto J = J_.middleCols(at, size(v));
        const VectorXd D = largest_of_unit(v, J.colwise().squaredNorm().transpose());
        const VectorXd& diagonal = diagonal_[static_cast<std::size_t>(v)];
        if (diagonal.size() > 0) of_all += (diagonal.asDiagonal() * moved.cwiseAbs2()).sum();
        R += J * moved;
        most += (D.asDiagonal() * moved.cwiseAbs2()).sum();
        at += size(v);
      }
      most = std::max(most, kBarely * of_all);
      if (most > 0.0) S += R.transpose() * R / most;
    }
    const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(S);
    Eigen::Index free = 0;
    while (free < A.cols() && eigen.eigenvalues()[free] <= kFree) ++free;
    return A * eigen.eigenvectors().leftCols(free);
  }

  static Eigen::Index place(const Part& part, const Column& column) {
    return std::ranges::find(part.parameters, column.parameter) - part.parameters.begin();
  }

  /// Gauss-Jordan elimination of columns with complete pivoting.
  static void eliminate(MatrixXd& A) {
    std::vector<bool> used(static_cast<std::size_t>(A.rows()), false);
    for (Eigen::Index j = 0; j < A.cols(); ++j) {
      Eigen::Index row = -1, column = j;
      for (Eigen::Index c = j; c < A.cols(); ++c) {
        for (Eigen::Index r = 0; r < A.rows(); ++r) {
          if (used[static_cast<std::size_t>(r)]) continue;
          if (row < 0 || std::abs(A(r, c)) > std::abs(A(row, column))) row = r, column = c;
        }
      }
      if (row < 0 || A(row, column) == 0.0) return;
      used[static_cast<std::size_t>(row)] = true;
      A.col(j).swap(A.col(column));
      A.col(j) /= A(row, j);
      for (Eigen::Index c = 0; c < A.cols(); ++c) {
        if (c == j) continue;
        const double factor = A(row, c);
        A.col(c) -= factor * A.col(j);
        A(row, c) = 0.0;
      }
    }
    for (Eigen::Index j = 0; j < A.cols(); ++j) {
      const double least = kNoMove * A.col(j).cwiseAbs().maxCoeff();
      A.col(j) = A.col(j).unaryExpr([&](double a) { return std::abs(a) > least ? a : 0.0; });
    }
  }

  FreeDirection direction_of(const Part& part, std::span<const std::int32_t> movers,
                             const VectorXd& alpha) {
    FreeDirection direction;
    double largest = 0.0;
    for (const std::int32_t v : movers) {
      VectorXd delta = VectorXd::Zero(size(v));
      for (const Column& column : moves(v)) delta += alpha[place(part, column)] * column.delta;
      const VectorXd weighed =
          delta.cwiseProduct(diagonal_[static_cast<std::size_t>(v)].cwiseSqrt());
      largest = std::max(largest, weighed.cwiseAbs().maxCoeff());
      direction.moves.push_back({v, {delta.data(), delta.data() + delta.size()}});
    }
    std::erase_if(direction.moves, [&](const FreeMove& move) {
      const VectorXd weighed =
          Eigen::Map<const VectorXd>(move.delta.data(), std::ssize(move.delta))
              .cwiseProduct(diagonal_[static_cast<std::size_t>(move.variable)].cwiseSqrt());
      return !(weighed.cwiseAbs().maxCoeff() > kNoMove * largest);
    });
    std::ranges::sort(direction.moves, {}, &FreeMove::variable);
    return direction;
  }

  const LinearRows& rows_;
  std::span<const std::int32_t> sizes_, of_one_unit_;
  std::span<const std::int32_t> factors_;
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
  std::vector<std::vector<std::int32_t>> movers_of_;  // by part
  std::vector<VectorXd> diagonal_;                    // by variable
  MatrixXd J_;
  bool complete_ = true;
  bool finite_ = true;
  bool evaluated_ = false;
};

bool is_whole_relative_pose(const Graph& graph, int factor) {
  const FactorType& type = graph.factor_type(factor);
  const int n = type.residual_size();
  return type.is_relative() && type.tangent_size(0) == n && graph.information_rank(factor) == n;
}

/// A graph's factors at some states.
class GraphRows final : public LinearRows {
 public:
  GraphRows(const Graph& graph, const Values& values) : graph_(graph), values_(values) {}

  std::span<const std::int32_t> variables(int factor) const override {
    return graph_.factor_variables(factor);
  }
  int rows(int factor) const override { return graph_.factor_type(factor).residual_size(); }
  bool constant() const override { return !graph_.has_losses(); }
  bool determines_each(int factor) const override {
    const FactorType& type = graph_.factor_type(factor);
    if (!is_whole_relative_pose(graph_, factor)) return false;
    if (!graph_.loss(factor)) return true;
    std::vector<double> r(static_cast<std::size_t>(type.residual_size()));
    call_factor(type, [&] { evaluate(type, factor, r.data(), nullptr); });
    return weight(factor, r) > 0.0;
  }
  void jacobian(int factor, std::span<double> J) const override {
    const FactorType& type = graph_.factor_type(factor);
    std::vector<double> r(static_cast<std::size_t>(type.residual_size()));
    std::vector<double*> blocks;
    double* next = J.data();
    for (int k = 0; k < type.arity(); ++k) {
      blocks.push_back(next);
      next += r.size() * static_cast<std::size_t>(type.tangent_size(k));
    }
    call_factor(type, [&] { evaluate(type, factor, r.data(), blocks.data()); });
    if (!std::ranges::all_of(r, [](double each) { return std::isfinite(each); }))
      std::ranges::fill(J, std::numeric_limits<double>::quiet_NaN());
    if (!graph_.loss(factor)) return;
    const double root = std::sqrt(weight(factor, r));
    for (double& entry : J) entry *= root;
  }

 private:
  void evaluate(const FactorType& type, int factor, double* r, double* const* J) const {
    std::vector<const double*> x;
    for (const std::int32_t v : graph_.factor_variables(factor)) {
      x.push_back(values_.pools[static_cast<std::size_t>(graph_.pool(v))].data() +
                  std::ptrdiff_t{graph_.slot(v)} * graph_.type(v).ambient_size());
    }
    type.evaluate(x.data(), graph_.measurement(factor).data(),
                  graph_.sqrt_information(factor).data(), r, J);
  }
  double weight(int factor, std::span<const double> r) const {
    const double norm = std::inner_product(r.begin(), r.end(), r.begin(), 0.0);
    double weight = 1.0;
    const FactorRef at = graph_.ref(factor);
    graph_.weigh(at.pool, static_cast<std::size_t>(at.entry), {&norm, 1}, {}, {&weight, 1});
    return weight;
  }

  const Graph& graph_;
  const Values& values_;
};

/// What hangs together with a constant variable by fully measured relative poses without a loss: in
/// most graphs all poses.
std::vector<bool> determined_by_whole_relative_poses(const Graph& graph,
                                                     const std::vector<bool>& held) {
  std::vector<std::int32_t> parent(held.size());
  std::iota(parent.begin(), parent.end(), 0);
  const auto root = [&](std::int32_t v) {
    while (parent[static_cast<std::size_t>(v)] != v) {
      std::int32_t& up = parent[static_cast<std::size_t>(v)];
      v = up = parent[static_cast<std::size_t>(up)];
    }
    return v;
  };
  for (const FactorPool& pool : graph.factor_pools()) {
    const int n = pool.type->residual_size();
    if (!pool.type->is_relative() || pool.type->tangent_size(0) != n) continue;
    for (std::size_t f = 0; f < pool.size(); ++f) {
      if (pool.ranks[static_cast<std::size_t>(pool.noises[f])] < n || pool.losses[f] != 0) continue;
      const std::int32_t a = root(pool.variables[2 * f]), b = root(pool.variables[2 * f + 1]);
      parent[static_cast<std::size_t>(std::max(a, b))] = std::min(a, b);
    }
  }
  std::vector<bool> determined(held.size(), false);
  for (std::size_t v = 0; v < held.size(); ++v)
    if (held[v]) determined[static_cast<std::size_t>(root(static_cast<std::int32_t>(v)))] = true;
  for (std::size_t v = 0; v < held.size(); ++v)
    determined[v] =
        held[v] || determined[static_cast<std::size_t>(root(static_cast<std::int32_t>(v)))];
  return determined;
}

/// Whether all factors are fully measured relative poses without a loss.
bool all_are_whole_relative_poses(const Graph& graph) {
  if (graph.has_losses()) return false;
  for (const FactorPool& pool : graph.factor_pools()) {
    const int n = pool.type->residual_size();
    if (pool.size() > 0 && (!pool.type->is_relative() || pool.type->tangent_size(0) != n ||
                            std::ranges::any_of(pool.ranks, [n](int rank) { return rank < n; })))
      return false;
  }
  return true;
}

/// And whether every component has a constant variable: then nothing is free, as in most graphs of
/// poses.
bool all_are_whole_relative_poses(const Graph& graph, const Gauge& gauge) {
  if (!all_are_whole_relative_poses(graph)) return false;
  std::vector<bool> has_constant(static_cast<std::size_t>(gauge.components), false);
  for (std::size_t v = 0; v < gauge.held.size(); ++v)
    if (gauge.held[v]) has_constant[static_cast<std::size_t>(gauge.component[v])] = true;
  return std::ranges::find(has_constant, false) == has_constant.end();
}

/// Positions of the factors that have a variable which is not determined, rising.
std::vector<std::int32_t> factors_on_others(const Graph& graph,
                                            const std::vector<bool>& determined) {
  std::vector<std::int32_t> factors;
  for (const FactorPool& pool : graph.factor_pools()) {
    const auto arity = static_cast<std::size_t>(pool.type->arity());
    for (std::size_t f = 0; f < pool.size(); ++f) {
      for (std::size_t k = f * arity; k < (f + 1) * arity; ++k) {
        if (determined[static_cast<std::size_t>(pool.variables[k])]) continue;
        factors.push_back(pool.sequence[f]);
        break;
      }
    }
  }
  std::ranges::sort(factors);
  return factors;
}

}  // namespace

int numbers_of_one_unit(const VariableType& type) {
  const Placement* placement = type.placement();
  return placement ? std::min(placement->dimension(), type.tangent_size()) : 1;
}

bool determines_each(const Graph& graph, int factor) {
  return is_whole_relative_pose(graph, factor) && !graph.loss(factor);
}

FreeDirections find_free_directions(const LinearRows& rows, const FreeSearch& search) {
  return Search(rows, search).run();
}

namespace {

/// Cameras with unknown intrinsics and the points that they see: pixels, metres and coefficients of
/// distortion span so many orders of magnitude that what is free cannot be told from what is weak,
/// but of each variable alone.
bool has_cameras(const Graph& graph) {
  return std::ranges::any_of(graph.variable_pools(), [](const VariablePool& pool) {
    const Placement* placement = pool.type->placement();
    if (pool.variables.empty() || !placement || !placement->has_orientation()) return false;
    const int rigid = placement->dimension() == 2 ? 3 : 6;
    return pool.type->lie_group() == nullptr && pool.type->tangent_size() > rigid;
  });
}

}  // namespace

FreeDirections find_free_directions(const Graph& graph, const Gauge& gauge, const Values& values) {
  if (has_cameras(graph)) return free_alone(graph, gauge, values, GraphRows(graph, values));
  if (all_are_whole_relative_poses(graph, gauge)) return {};
  const std::vector<bool> determined = determined_by_whole_relative_poses(graph, gauge.held);
  const std::vector<std::int32_t> factors = factors_on_others(graph, determined);
  if (factors.empty()) return {};
  std::vector<std::int32_t> sizes, units;
  for (int v = 0; v < graph.variable_count(); ++v) {
    sizes.push_back(graph.type(v).tangent_size());
    units.push_back(numbers_of_one_unit(graph.type(v)));
  }
  return find_free_directions(GraphRows(graph, values), {sizes, units, determined, factors});
}

FreeDirections find_free_directions(const Graph& graph) {
  // Of relative poses alone the gauge holds one in every component.
  if (all_are_whole_relative_poses(graph)) return {};
  return find_free_directions(graph, resolve_gauge(graph), graph.values());
}

}  // namespace cairn
