// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/runtime/api.hpp"
#include "cairn/types/evaluated_factor.hpp"
#include "cairn/types/never_throws.hpp"
#include "cairn/types/variable_type.hpp"

namespace cairn {

/// A dense Gaussian on any number of nodes as one factor: the generic linear constraint of
/// Carlevaris-Bianco, Kaess and Eustice (Generic node removal for factor-graph SLAM, T-RO 2014).
///
/// Its residual is r = G e − b. The coordinates e are those of the nodes in the frame of the first
/// one (root shift): e_k = local(z_k, x_0⁻¹ x_k) of a pose, z_k being x_0⁻¹ x_k where the
/// constraint was made, and the residual of an observation of a landmark from x_0. If it is
/// absolute, local(z_0, x_0) comes before these. So it stays right where the whole map moves. G has
/// as many rows as the Gaussian's information matrix GᵀG has rank, and the factor's own information
/// is the identity; b is the mean, zero where the Gaussian's is where it was linearised.
///
/// Measurement: z_0 if it is absolute, z_1, z_2, …; b; G column by column. One object serves all
/// factors of that rank on the same kinds of nodes. It cannot be written to files.
class CAIRN_API LinearConstraint final : public EvaluatedFactorType, public NeverThrows {
 public:
  static constexpr std::string_view kTag = "LINEAR_CONSTRAINT";

  /// What it is on: poses of one type, then landmarks.
  struct Nodes {
    std::shared_ptr<const VariableType> pose;
    int poses = 1;
    /// Measures the position of a landmark in the frame of a pose; null: no landmarks.
    std::shared_ptr<const FactorType> observation = nullptr;
    int landmarks = 0;
    int absolute_size = 0;  ///< see `FactorType`; 0: relative

    bool operator==(const Nodes&) const = default;
  };

  /// `rank`: rows of G. Throws `Error` (usage) if that is not 1 to the number of coordinates, or if
  /// there is no observation of these poses for the landmarks.
  LinearConstraint(Nodes nodes, int rank);

  const Nodes& nodes() const { return nodes_; }
  /// The number of coordinates e that there are on such nodes.
  static int coordinates_of(const Nodes& nodes);
  /// The measurement that is linearised at states of its variables, with these b (rank) and G
  /// (rank × coordinates, column-major).
  std::vector<double> measurement_at(const double* const* x, std::span<const double> b,
                                     std::span<const double> G) const;

  std::string_view tag() const override { return kTag; }
  int arity() const override { return nodes_.poses + nodes_.landmarks; }
  std::span<const std::string_view> variable_tags() const override { return tags_; }
  int residual_size() const override { return rank_; }
  int measurement_size() const override { return numbers_.back() + rank_ * (1 + rows_.back()); }
  int tangent_size(int variable) const override;
  int ambient_size(int variable) const override;
  std::string normalize(double* measurement) const override;
  void evaluate(const double* const* x, const double* measurement, const double* sqrt_information,
                double* residual, double* const* jacobians) const override;
  bool propagate(int, const double* const*, const double*, double*) const override { return false; }
  bool is_relative() const override { return false; }
  int absolute_size() const override { return nodes_.absolute_size; }
  bool takes_loss() const override { return false; }

 private:
  struct Coordinates;
  Coordinates coordinates(const double* const* x, const double* measurement,
                          bool with_jacobians) const;
  int coordinate_count() const { return rows_.back(); }
  bool is_landmark(int variable) const { return variable >= nodes_.poses; }

  Nodes nodes_;
  int rank_;
  std::vector<std::string_view> tags_;
  std::vector<int> rows_{0};     ///< first coordinate of each node, and their number
  std::vector<int> numbers_{0};  ///< first number of each z, and of b
  std::vector<double> unit_;     ///< information of the observation that whitens nothing
};

}  // namespace cairn
