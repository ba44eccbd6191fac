// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "cairn/runtime/api.hpp"
#include "cairn/sparsification/blanket.hpp"
#include "cairn/sparsification/interruptible.hpp"

// (T n) is equation or section n of the thesis that sparsification.hpp names.

namespace cairn {

/// Chooses which models become factors (T 4.4).
class CAIRN_API Topology : public Interruptible {
 public:
  static constexpr std::string_view kKind = "topology";
  ~Topology() override;

  /// At most `population` factors that connect all nodes, the most important first; at least as
  /// many as a spanning tree has; with `parts` more, of as many rows. One of them is a prior where
  /// the blanket is absolute. Throws `Error` (usage) for a blanket that it does not know how to
  /// connect.
  virtual std::vector<FactorChoice> choose(const DenseBlanket& blanket, int population) = 0;

  /// Whether its factor is one on all nodes of a blanket: that is the only model which it gets, and
  /// its information is the identity.
  virtual bool whole() const { return false; }
  /// Whether it also chooses from models of a part of what a factor measures, as of a position
  /// without the orientation. These then come after the whole one on the same nodes.
  virtual bool parts() const { return false; }
  /// Whether the last `choose` did something else than was asked for, and what: a sentence that is
  /// the same for every blanket to which it happens, so that these can be counted. Empty: it did
  /// not.
  virtual std::string note() const { return {}; }
  /// What its factors are that no format of graphs expresses, for messages; empty: none.
  virtual std::string_view unwritable() const { return {}; }
};

/// How many factors a topology gets (T 4.4.1).
struct CAIRN_API Population {
  enum class Kind {
    tree,  ///< γ times as many as a spanning tree (T 4.21)
    fill,  ///< the fraction α of all pairs (T 4.22)
    loss,  ///< as few as keep the KLD of the blanket below a bound [nats]
  };
  Kind kind = Kind::tree;
  double value = 2.0;

  /// "tree:2", "fill:0.5", "loss:0.01". Throws `Error` (usage) for anything else.
  static Population parse(const std::string& text);
  /// What `parse` reads back as the same.
  std::string text() const;

  /// Factors for a blanket of n nodes, rounded up and clipped to [n − 1, n (n − 1) / 2] (T 4.20);
  /// of `loss` the least.
  int count(int nodes) const;
};

}  // namespace cairn
