// SPDX-License-Identifier: BSD-3-Clause
#include <memory>
#include <string>

#include "cairn/plugin/registry.hpp"
#include "recovery.hpp"
#include "selections.hpp"
#include "sparsify.hpp"
#include "topologies.hpp"

namespace {

using namespace cairn;
using namespace cairn::sparsify;

// Topologies --------------------------------------------------------------------------------------

OptionTable with_mutual_information(OptionTable table = {}) {
  table
      .choice("regularization", "covariance", {"covariance", "information"},
              "mutual information where Λ is singular: of (Λ + εI)⁻¹, or with εI in each "
              "determinant of Λ's marginals")
      .real("epsilon", 0.01, 1e-12, 1e3, "ε, as a fraction of Λ's mean diagonal");
  return table;
}

TopologyOptions topology_options(const Options& options) {
  TopologyOptions chosen;
  chosen.regularization = options.text("regularization") == "covariance"
                              ? Regularization::covariance
                              : Regularization::information;
  chosen.epsilon = options.real("epsilon");
  return chosen;
}

template <class Which>
std::unique_ptr<Topology> make_topology(const Options& options, Registry& /*registry*/) {
  return std::make_unique<Which>(topology_options(options));
}

void add_topologies(Registrar& registrar) {
  registrar.add<Topology>("clt", with_mutual_information(), make_topology<ChowLiuTree>);
  registrar.add<Topology>("mi", with_mutual_information(), make_topology<MutualInformation>);
  registrar.add<Topology>("ekld", with_mutual_information(), make_topology<ExpectedDivergence>);
  registrar.add<Topology>("cliquey", with_mutual_information(), make_topology<Cliquey>);
  OptionTable downdate = with_mutual_information();
  downdate.choice(
      "downdate", "sum", {"sum", "exact"},
      "the information of the tree is subtracted by the sum of equation 4.23, or exactly");
  registrar.add<Topology>("dmi", downdate, [](const Options& options, Registry&) {
    TopologyOptions chosen = topology_options(options);
    chosen.exact_downdate = options.text("downdate") == "exact";
    return std::unique_ptr<Topology>(std::make_unique<DowndatedInformation>(chosen));
  });
  registrar.add<Topology>("odd", {}, [](const Options&, Registry&) {
    return std::unique_ptr<Topology>(std::make_unique<OffDiagonalDeterminant>());
  });
  OptionTable l1 = with_mutual_information();
  l1.real("weight", 0.1, 0.0, 1.0,
          "of the sum of absolute values, as a fraction of the largest correlation");
  registrar.add<Topology>("l1", l1, [](const Options& options, Registry&) {
    TopologyOptions chosen = topology_options(options);
    chosen.l1_weight = options.real("weight");
    return std::unique_ptr<Topology>(std::make_unique<SparseInverse>(chosen));
  });
  OptionTable best = with_mutual_information();
  best.integer("most", 200000, 1, 1000000000,
               "topologies to try; where there are more, it refuses");
  registrar.add<Topology>("best", best, [](const Options& options, Registry&) {
    TopologyOptions chosen = topology_options(options);
    chosen.most = options.integer("most");
    return std::unique_ptr<Topology>(std::make_unique<Exhaustive>(chosen));
  });
}

// Factor recovery ---------------------------------------------------------------------------------

OptionTable iterative_table() {
  OptionTable table;
  table
      .choice("initial", kInitialNames.front(), kInitialNames,
              "begin at off-diagonal blocks of Λ, at each factor's optimum alone (scaled), at "
              "identity matrices, or at these after a cycle of factor descent")
      .real("tolerance", 1e-3, 0.0, 1.0,
            "largest element of the gradient at the end, each factor in units of its own optimum")
      .integer("iterations", 10000, 0, 1000000000, "at most; 0: see how good the beginning is")
      .real("seconds", 0.0, 0.0, 1e6, "for one problem, at most; 0: no limit");
  return table;
}

RecoveryOptions recovery_options(const Options& options) {
  return {.initial = initial_information(options.text("initial")),
          .tolerance = options.real("tolerance"),
          .iterations = static_cast<int>(options.integer("iterations")),
          .seconds = options.real("seconds")};
}

void add_recoveries(Registrar& registrar) {
  registrar.add<FactorRecovery>("closed_form", {}, [](const Options&, Registry&) {
    return std::unique_ptr<FactorRecovery>(std::make_unique<ClosedForm>());
  });
  registrar.add<FactorRecovery>("fd", iterative_table(), [](const Options& options, Registry&) {
    return std::unique_ptr<FactorRecovery>(
        std::make_unique<FactorDescent>(recovery_options(options), false));
  });
  registrar.add<FactorRecovery>("ncfd", iterative_table(), [](const Options& options, Registry&) {
    return std::unique_ptr<FactorRecovery>(
        std::make_unique<FactorDescent>(recovery_options(options), true));
  });
  OptionTable interior = iterative_table();
  interior.real("start", 0.1, 0.0, 1e6, "ω: the barrier's weight, in proportion to the gradients")
      .real("decrease", 0.1, 1e-6, 0.999, "the weight is multiplied by this")
      .boolean("conservative", false,
               "keep the approximation conservative: at most the information Λ");
  registrar.add<FactorRecovery>("ip", interior, [](const Options& options, Registry&) {
    return std::unique_ptr<FactorRecovery>(std::make_unique<InteriorPoint>(
        recovery_options(options),
        InteriorPointOptions{.start = options.real("start"),
                             .decrease = options.real("decrease"),
                             .conservative = options.boolean("conservative")}));
  });
  OptionTable newton = iterative_table();
  newton.integer("memory", 10, 1, 1000, "steps that the quadratic model remembers");
  registrar.add<FactorRecovery>("pqn", newton, [](const Options& options, Registry&) {
    return std::unique_ptr<FactorRecovery>(std::make_unique<ProjectedQuasiNewton>(
        recovery_options(options), static_cast<int>(options.integer("memory"))));
  });
}

// Selections --------------------------------------------------------------------------------------

template <class Which>
void add_by_part(Registrar& registrar, const char* name) {
  OptionTable table;
  table.real("part", 0.5, 0.0, 1.0, "of the nodes that may leave");
  registrar.add<NodeSelection>(name, table, [](const Options& options, Registry&) {
    return std::unique_ptr<NodeSelection>(std::make_unique<Which>(options.real("part")));
  });
}

void add_selections(Registrar& registrar) {
  OptionTable every;
  every.integer("every", 2, 1, 1000000000, "one of so many nodes stays");
  registrar.add<NodeSelection>("keep_every", every, [](const Options& options, Registry&) {
    return std::unique_ptr<NodeSelection>(
        std::make_unique<KeepEvery>(static_cast<int>(options.integer("every"))));
  });
  add_by_part<LeastLoss>(registrar, "least_loss");
  add_by_part<SmallestBlanket>(registrar, "smallest_blanket");
  add_by_part<Oldest>(registrar, "oldest");
  OptionTable coverage;
  coverage.real("distance", 1.0, 1e-9, 1e9, "a node that stays is nearer than this [m]")
      .real("angle", 0.7, 0.0, 3.15, "and turned by less than this [rad]");
  registrar.add<NodeSelection>("coverage", coverage, [](const Options& options, Registry&) {
    return std::unique_ptr<NodeSelection>(
        std::make_unique<Coverage>(options.real("distance"), options.real("angle")));
  });
}

// The sparsifier ----------------------------------------------------------------------------------

OptionTable sparsify_table() {
  OptionTable table;
  table.component("topology", Topology::kKind.data(), "ekld", "which nodes new factors relate")
      .text("population", "tree:2",
            "how many: tree:γ times as many as a tree, fill:α of all pairs, loss:KLD as few as "
            "keep the divergence below that [nats]")
      .component("recovery", FactorRecovery::kKind.data(), "ncfd",
                 "method that finds their information")
      .choice("scheme", "single", {"single", "runs", "multi"},
              "nodes leave one by one, those that follow each other together, or all that are "
              "connected together")
      .choice("projection", "node", {"node", "eigen"},
              "coordinates where Λ is singular: relative to a node, or its eigenvectors")
      .boolean("resolve", true, "solve the cropped problem by itself first")
      .integer("largest_group", 50, 1, 100000, "nodes that leave together, at most");
  return table;
}

std::unique_ptr<Sparsifier> make_sparsify(const Options& options, Registry& registry) {
  return std::make_unique<Sparsify>(
      registry.make<Topology>(options.text("topology")),
      registry.make<FactorRecovery>(options.text("recovery")),
      SparsifyOptions{.population = Population::parse(options.text("population")),
                      .projection = options.text("projection") == "eigen" ? Projection::eigen
                                                                          : Projection::node,
                      .scheme = options.text("scheme") == "single" ? Scheme::single
                                : options.text("scheme") == "runs" ? Scheme::runs
                                                                   : Scheme::multi,
                      .resolve = options.boolean("resolve"),
                      .largest_group = static_cast<int>(options.integer("largest_group"))});
}

}  // namespace

void cairn_register(Registrar& registrar) {
  add_topologies(registrar);
  add_recoveries(registrar);
  add_selections(registrar);
  registrar.add<Sparsifier>("sparsify", sparsify_table(), make_sparsify);
}
