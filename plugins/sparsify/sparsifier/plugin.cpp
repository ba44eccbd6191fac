// SPDX-License-Identifier: BSD-3-Clause
#include <memory>

#include "cairn/plugin/registry.hpp"
#include "cairn/sparsification/map_sparsifier.hpp"
#include "recovery.hpp"
#include "selections.hpp"
#include "sparsify.hpp"
#include "topologies.hpp"

namespace {

using namespace cairn;
using namespace cairn::sparsify;

/// A component made of its options and nothing else.
template <class Interface, class Struct, class Which>
void add(Registrar& registrar, const char* name) {
  registrar.add<Interface, Struct>(
      name, [](const Struct& options) { return std::make_unique<Which>(options); });
}

void add_topologies(Registrar& registrar) {
  add<Topology, TopologyOptions, ChowLiuTree>(registrar, "clt");
  add<Topology, TopologyOptions, MutualInformation>(registrar, "mi");
  add<Topology, TopologyOptions, ExpectedDivergence>(registrar, "ekld");
  add<Topology, TopologyOptions, MixedParts>(registrar, "mixed");
  add<Topology, TopologyOptions, Cliquey>(registrar, "cliquey");
  add<Topology, DowndatedInformationOptions, DowndatedInformation>(registrar, "dmi");
  add<Topology, SparseInverseOptions, SparseInverse>(registrar, "l1");
  add<Topology, ExhaustiveOptions, Exhaustive>(registrar, "best");
  registrar.add<Topology>("odd", {}, [](const Options&, Registry&) {
    return std::make_unique<OffDiagonalDeterminant>();
  });
  registrar.add<Topology>(
      "glc", {}, [](const Options&, Registry&) { return std::make_unique<DenseConstraint>(); });
}

void add_recoveries(Registrar& registrar) {
  registrar.add<FactorRecovery>(
      "closed_form", {}, [](const Options&, Registry&) { return std::make_unique<ClosedForm>(); });
  registrar.add<FactorRecovery, FactorDescentOptions>("fd", [](const FactorDescentOptions& chosen) {
    return std::make_unique<FactorDescent>(chosen.recovery, /*greedy=*/false, chosen.conservative);
  });
  registrar.add<FactorRecovery, FactorDescentOptions>(
      "ncfd", [](const FactorDescentOptions& chosen) {
        return std::make_unique<FactorDescent>(chosen.recovery, /*greedy=*/true,
                                               chosen.conservative);
      });
  add<FactorRecovery, InteriorPointOptions, InteriorPoint>(registrar, "ip");
  add<FactorRecovery, ProjectedQuasiNewtonOptions, ProjectedQuasiNewton>(registrar, "pqn");
}

template <class Which>
void add_by_part(Registrar& registrar, const char* name) {
  registrar.add<NodeSelection, PartOptions>(
      name, [](const PartOptions& options) { return std::make_unique<Which>(options.part); });
}

void add_selections(Registrar& registrar) {
  registrar.add<NodeSelection, KeepEveryOptions>("keep_every", [](const KeepEveryOptions& options) {
    return std::make_unique<KeepEvery>(options.every);
  });
  add_by_part<LeastLoss>(registrar, "least_loss");
  add_by_part<SmallestBlanket>(registrar, "smallest_blanket");
  add_by_part<Oldest>(registrar, "oldest");
  add<NodeSelection, NearestOptions, Nearest>(registrar, "nearest");
  registrar.add<NodeSelection, CoverageOptions>("coverage", [](const CoverageOptions& options) {
    return std::make_unique<Coverage>(options.distance, options.angle);
  });
}

}  // namespace

void cairn_register(Registrar& registrar) {
  add_topologies(registrar);
  add_recoveries(registrar);
  add_selections(registrar);
  registrar.add<Sparsifier, SparsifyOptions>("sparsify", [](const SparsifyOptions& options,
                                                            Registry& registry) {
    return std::make_unique<Sparsify>(
        registry.make<Topology>(options.topology), registry.make<FactorRecovery>(options.recovery),
        options,
        options.fit == Fit::blanket ? nullptr : registry.make<LinearSolver>(options.linear_solver));
  });
  registrar.add<PoseRemover, MapSparsifierOptions>(
      "sparsify", [](const MapSparsifierOptions& options, Registry& registry) {
        const ComponentSpec sparsifier = parse_component(options.sparsifier);
        if (options.savable) expect_savable(sparsifier, registry);
        auto remover = std::make_unique<MapSparsifier>(registry, sparsifier,
                                                       parse_component(options.selection));
        remover->prepare();  // it asks the registry for nothing later
        return remover;
      });
}
