// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <initializer_list>
#include <span>
#include <utility>
#include <variant>
#include <vector>

#include "cairn/graph/graph.hpp"
#include "cairn/graph/update.hpp"
#include "cairn/update/elimination.hpp"

namespace cairn::incremental {

/// What updates have asked for that they cannot compute again: what factors of plugins have
/// answered, an optimizer, and the clock. Recorded while updates are carried out, and given in the
/// same order where they are repeated, without asking anyone: they then come to the same bits.
class Answers {
 public:
  /// How far the record goes.
  struct Place {
    std::size_t numbers = 0, objects = 0;
  };
  Place end() const { return {numbers_.size(), objects_.size()}; }
  /// Forgets what came after a place.
  void cut(Place place) {
    numbers_.resize(place.numbers);
    objects_.resize(place.objects);
  }
  /// From here on answers are those of the record, from its beginning; or recorded again.
  void repeat(bool repeats) {
    repeats_ = repeats;
    next_ = {};
  }
  bool repeats() const { return repeats_; }
  std::size_t bytes() const {
    return numbers_.size() * sizeof(double) + objects_.size() * sizeof(Object);
  }

  /// ask() writes these arrays.
  template <class Ask>
  void write(std::initializer_list<std::span<double>> arrays, const Ask& ask) {
    if (repeats_) {
      for (const std::span<double> array : arrays) {
        std::copy_n(numbers_.begin() + static_cast<std::ptrdiff_t>(next_.numbers), array.size(),
                    array.begin());
        next_.numbers += array.size();
      }
      return;
    }
    ask();
    for (const std::span<double> array : arrays)
      numbers_.insert(numbers_.end(), array.begin(), array.end());
  }
  template <class Ask>
  double number(const Ask& ask) {
    double answer = 0.0;
    write({{&answer, 1}}, [&] { answer = ask(); });
    return answer;
  }
  /// A `GraphUpdate`, `Elimination` or `Values`.
  template <class Ask>
  auto object(const Ask& ask) {
    using Answer = decltype(ask());
    if (repeats_) return std::get<Answer>(objects_.at(next_.objects++));
    Answer answer = ask();
    objects_.push_back(answer);
    return answer;
  }

 private:
  using Object = std::variant<GraphUpdate, Elimination, Values>;
  std::vector<double> numbers_;
  std::vector<Object> objects_;
  bool repeats_ = false;
  Place next_;
};

/// Where answers are kept, if anywhere: a copy of whatever has this keeps none, and an assignment
/// leaves it.
class AnswersKept {
 public:
  AnswersKept() = default;
  AnswersKept(const AnswersKept&) {}
  // NOLINTNEXTLINE(bugprone-unhandled-self-assignment): nothing is assigned
  AnswersKept& operator=(const AnswersKept&) { return *this; }
  ~AnswersKept() = default;

  void in(Answers* answers) { answers_ = answers; }
  explicit operator bool() const { return answers_ != nullptr; }
  Answers* get() const { return answers_; }
  Answers* operator->() const { return answers_; }

 private:
  Answers* answers_ = nullptr;
};

}  // namespace cairn::incremental
