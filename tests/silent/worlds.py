# SPDX-License-Identifier: BSD-3-Clause
"""Random graphs with a known truth, drawn from all generators, and what is done to them.

A world is drawn from its kind and seed alone, so that a finding can be repeated. All are small: what matters is
the number of different ones."""
from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Callable, Dict, List, Tuple

import numpy as np

import cairn
from cairn import Point2, Point3, Pose2, Pose3, Rot3

VARIABLES: Dict[str, Any] = {"VERTEX_SE2": Pose2, "VERTEX_SE3:QUAT": Pose3, "VERTEX_XY": Point2, "VERTEX_TRACKXYZ": Point3}
RELATIVE = {"EDGE_SE2": Pose2, "EDGE_SE3:QUAT": Pose3}


@dataclass
class World:
    """A graph as a user would have it, and what is known of it."""

    name: str
    graph: cairn.Graph
    truth: cairn.Graph
    loss: str | None = None
    loss_on: str = "all"
    """chi2 of a good model is about this times its degrees of freedom."""
    expected: float = 1.0
    """What is wrong with the measurements on purpose: a note that doubts the estimate is right then."""
    defects: List[str] = field(default_factory=list)
    """Relative measurements that are wrong on purpose."""
    wrong: int = 0


def parts(graph: cairn.Graph) -> Tuple[Dict[str, Tuple[np.ndarray, np.ndarray]], Dict[str, List[np.ndarray]]]:
    """States by type and measurements by type as arrays."""
    variables = {tag: (graph.ids(tag), graph.states(tag)) for tag in graph.variable_types}
    factors = {tag: [graph.factor_ids(tag), graph.measurements(tag), graph.information(tag)] for tag in graph.factor_types}
    return variables, factors


def joined(variables: Dict[str, Tuple[np.ndarray, np.ndarray]], factors: Dict[str, List[np.ndarray]]) -> cairn.Graph:
    graph = cairn.Graph()
    for tag, (ids, states) in variables.items():
        graph.add_variables(tag, ids, states)
    for tag, (ids, measurements, information) in factors.items():
        if len(ids) > 0:
            graph.add_factors(tag, ids, measurements, information)
    return graph


def with_states(graph: cairn.Graph, other: cairn.Graph) -> cairn.Graph:
    """A copy of the graph with the states of another that has all of its variables."""
    copy = graph.copy()
    for tag in graph.variable_types:
        at = {int(i): state for i, state in zip(other.ids(tag), other.states(tag))}
        copy.set_states(tag, np.array([at[int(i)] for i in graph.ids(tag)]), graph.ids(tag))
    return copy


def is_odometry(ids: np.ndarray) -> np.ndarray:
    return np.abs(ids[:, 1] - ids[:, 0]) == 1


def stays_connected(count: int, edges: np.ndarray) -> bool:
    parent = list(range(count))

    def root(v: int) -> int:
        while parent[v] != v:
            parent[v] = parent[parent[v]]
            v = parent[v]
        return v

    left = count
    for a, b in edges:
        a, b = root(int(a)), root(int(b))
        if a != b:
            parent[a] = b
            left -= 1
    return left == 1


# ---- what is drawn -------------------------------------------------------------------------------------


def base(rng: np.random.Generator, noise: float, rotation: float | None, outliers: int) -> World:
    """One of the generators, small, with that multiple of its noise (and information to match), rotation noise [rad] and wrong loop closures."""
    n = int(rng.integers(20, 200))
    small = int(rng.integers(3, 7))
    options: Dict[str, Dict[str, Any]] = {
        "manhattan": {"poses": n, "block": int(rng.integers(2, 6)), "loop_density": float(rng.uniform(0.1, 1))},
        "city": {"poses": n, "loop_density": float(rng.uniform(0.1, 1))},
        "ring": {"poses": n, "laps": float(rng.uniform(1.05, 4))},
        "ellipse3d": {"poses": n},
        "ellipse_n": {"laps": int(rng.integers(2, 5)), "poses_per_lap": int(rng.integers(8, 40))},
        "sphere": {"turns": small, "poses_per_turn": int(rng.integers(5, 25)), "loop_density": float(rng.uniform(0.2, 1))},
        "torus": {"turns": small, "poses_per_turn": int(rng.integers(5, 25)), "loop_density": float(rng.uniform(0.2, 1))},
        "grid3d": {"nx": small, "ny": int(rng.integers(2, 5)), "nz": int(rng.integers(2, 4)), "loop_density": float(rng.uniform(0.3, 1))},
        "landmarks2d": {"poses": n, "sensor": str(rng.choice(["cartesian", "bearing_range"]))},
    }
    name = str(rng.choice(list(options)))
    chosen = dict(options[name])
    chosen["noise"] = noise
    if rotation is not None:
        chosen["rotation_sigma"] = rotation
    if outliers > 0:
        chosen["outliers"] = outliers
    seed = int(rng.integers(1, 2**31))
    try:
        graph, truth = cairn.generate(name, seed=seed, **chosen)
    except cairn.Error as error:
        if "outliers" not in str(error):
            raise
        return base(rng, noise, rotation, outliers)  # that world is too small for wrong loop closures
    text = ",".join(f"{key}={value:.4g}" if isinstance(value, float) else f"{key}={value}" for key, value in chosen.items())
    world = World(f"@{name}:{text} --seed {seed}", graph, truth)
    world.wrong = int(chosen.get("outliers", 0))
    if world.wrong:
        world.defects.append(f"{world.wrong} wrong loop closures")
    return world


def change(world: World, what: str, graph: cairn.Graph, truth: cairn.Graph | None = None) -> None:
    world.graph = graph
    if truth is not None:
        world.truth = truth
    world.name += f"; {what}"


def with_gaps(rng: np.random.Generator, world: World) -> None:
    """Some odometry is missing, where the graph stays in one part without it."""
    variables, factors = parts(world.graph)
    if len(variables) > 1:
        return
    order = {int(i): k for k, i in enumerate(next(iter(variables.values()))[0])}
    for tag in RELATIVE:
        if tag not in factors:
            continue
        ids, measurements, information = factors[tag]
        keep = np.ones(len(ids), bool)
        for k in rng.permutation(np.flatnonzero(is_odometry(ids)))[: max(1, len(ids) // 20)]:
            keep[k] = False
            if not stays_connected(len(order), [(order[int(a)], order[int(b)]) for a, b in ids[keep]]):
                keep[k] = True
        factors[tag] = [ids[keep], measurements[keep], information[keep]]
        change(world, f"{int((~keep).sum())} gaps", joined(variables, factors))


def with_few_loops(rng: np.random.Generator, world: World) -> None:
    variables, factors = parts(world.graph)
    for tag in RELATIVE:
        if tag not in factors:
            continue
        ids, measurements, information = factors[tag]
        loops = rng.permutation(np.flatnonzero(~is_odometry(ids)))
        keep = np.ones(len(ids), bool)
        keep[loops[int(rng.integers(1, 4)):]] = False
        order = {int(i): k for k, i in enumerate(np.concatenate([v[0] for v in variables.values()]))}
        if not stays_connected(len(order), [(order[int(a)], order[int(b)]) for t, f in factors.items()
                                            for a, b in (f[0][keep] if t == tag else f[0])[:, :2]]):
            return
        factors[tag] = [ids[keep], measurements[keep], information[keep]]
        world.wrong = min(world.wrong, int((keep & ~is_odometry(ids)).sum()))
        change(world, "few loop closures", joined(variables, factors))


def with_other_states(rng: np.random.Generator, world: World) -> None:
    """None at all (the identity), random ones, or near the truth."""
    how = str(rng.choice(["no", "random", "near"]))
    graph = world.graph.copy()
    for tag in graph.variable_types:
        ids = graph.ids(tag)
        kind = VARIABLES[tag]
        at = {int(i): s for i, s in zip(world.truth.ids(tag), world.truth.states(tag))}
        states = []
        for i in ids:
            if how == "no":
                states.append(np.asarray(kind().state))
            elif kind in (Pose2, Pose3):
                size = 3 if kind is Pose2 else 6
                turn = size // 2 if size == 6 else 2
                if how == "random":
                    delta = np.concatenate([rng.normal(0, 20, turn), rng.uniform(-3, 3, size - turn)])
                    states.append(np.asarray(kind().retract(delta).state))
                else:
                    delta = np.concatenate([rng.normal(0, 0.3, turn), rng.normal(0, 0.1, size - turn)])
                    states.append(np.asarray(kind.from_state(at[int(i)]).retract(delta).state))
            else:
                spread = 20.0 if how == "random" else 0.3
                center = at[int(i)] if how == "near" else np.zeros(len(at[int(i)]))
                states.append(center + rng.normal(0, spread, len(center)))
        graph.set_states(tag, np.array(states), ids)
    change(world, f"{how} states", graph)


def with_scaled_information(rng: np.random.Generator, world: World) -> None:
    scale = float(10.0 ** rng.uniform(-6, 4))
    variables, factors = parts(world.graph)
    for part in factors.values():
        part[2] = part[2] * scale
    world.expected *= scale
    if not 0.01 < world.expected < 4.0:  # sigmas less than half of what is right: χ² rejects them
        world.defects.append("information of another scale")
    change(world, f"information times {scale:.3g}", joined(variables, factors))


def with_shuffled_ids(rng: np.random.Generator, world: World) -> None:
    variables, factors = parts(world.graph)
    ids = np.concatenate([v[0] for v in variables.values()])
    new = dict(zip(ids.tolist(), rng.permutation(len(ids) * 3)[: len(ids)].tolist()))

    def renamed(values: np.ndarray) -> np.ndarray:
        return np.vectorize(lambda i: new[int(i)], otypes=[np.int64])(values)

    for tag, (old, states) in variables.items():
        variables[tag] = (renamed(old), states)
    for part in factors.values():
        part[0] = renamed(part[0])
    truth_variables, truth_factors = parts(world.truth)
    for tag, (old, states) in truth_variables.items():
        truth_variables[tag] = (renamed(old), states)
    for part in truth_factors.values():
        part[0] = renamed(part[0])
    change(world, "ids shuffled", joined(variables, factors), joined(truth_variables, truth_factors))


def with_slips(rng: np.random.Generator, world: World) -> None:
    """Odometry that says that the robot has not moved, though it has."""
    variables, factors = parts(world.graph)
    for tag, kind in RELATIVE.items():
        if tag not in factors:
            continue
        ids, measurements, information = factors[tag]
        slipped = rng.permutation(np.flatnonzero(is_odometry(ids)))[: int(rng.integers(1, 4))]
        measurements[slipped] = np.asarray(kind().state)
        world.defects.append(f"{len(slipped)} slips")
        world.wrong += len(slipped)
        change(world, f"{len(slipped)} slips", joined(variables, factors))


def with_priors(rng: np.random.Generator, world: World) -> None:
    """Priors of a part of the poses: position, the whole pose, or (in the plane) heading; in a world that is turned and far off."""
    tag = next((t for t in ("VERTEX_SE2", "VERTEX_SE3:QUAT") if t in world.graph.variable_types), None)
    if tag is None or len(world.graph.variable_types) > 1:
        return
    planar = tag == "VERTEX_SE2"
    shift = rng.normal(0, 1000, 2 if planar else 3)
    placed = Pose2(*shift, float(rng.uniform(-3, 3))) if planar else Pose3(Rot3.exp(rng.normal(0, 1, 3)), shift)
    kind = VARIABLES[tag]
    truth = world.truth.copy()
    moved = [placed * kind.from_state(s) for s in truth.states(tag)]
    truth.set_states(tag, np.array([np.asarray(p.state) for p in moved]), truth.ids(tag))
    graph = world.graph.copy()
    chosen = rng.permutation(len(moved))[: int(rng.integers(1, max(2, len(moved) // 4)))]
    what = str(rng.choice(["position", "pose", "heading"] if planar else ["position", "pose"]))
    sigma = float(rng.choice([0.05, 0.5]))
    for k in chosen:
        size = 3 if planar else 6
        turn = size - (1 if planar else 3)
        sigmas = np.full(size, sigma)
        sigmas[turn:] = 0.05
        delta = sigmas * rng.standard_normal(size)
        if what == "position":
            delta[turn:] = rng.uniform(-3, 3, size - turn) if planar else 0.0
            sigmas[turn:] = np.inf
        if what == "heading":
            sigmas[:turn] = np.inf
        graph.add(cairn.Prior(int(truth.ids(tag)[k]), moved[k].retract(delta)), sigmas=sigmas)
    change(world, f"{len(chosen)} priors of {what}", graph, truth)


# ---- kinds ---------------------------------------------------------------------------------------------


def vary(rng: np.random.Generator, world: World, *, states: bool = True) -> None:
    """What does not make a graph harder for a good back end, each with some probability."""
    ways: List[Tuple[float, Callable[[np.random.Generator, World], None]]] = [(0.2, with_gaps), (0.2, with_few_loops)]
    if states:
        ways.append((0.5, with_other_states))
    ways += [(0.2, with_scaled_information), (0.15, with_shuffled_ids)]
    for probability, way in ways:
        if rng.uniform() < probability:
            way(rng, world)


def ordinary(rng: np.random.Generator) -> World:
    world = base(rng, float(rng.choice([1.0, 1.0, 2.0, 3.0])), None, 0)
    vary(rng, world)
    return world


def rotation(rng: np.random.Generator) -> World:
    world = base(rng, float(rng.choice([1.0, 2.0, 3.0])), float(rng.choice([0.03, 0.05, 0.1])), 0)
    vary(rng, world)
    return world


def priors(rng: np.random.Generator) -> World:
    world = base(rng, float(rng.choice([1.0, 2.0, 3.0])), float(rng.choice([0.01, 0.03, 0.1])), 0)
    with_priors(rng, world)
    return world


def hard(rng: np.random.Generator) -> World:
    outliers = int(rng.integers(1, 11)) if rng.uniform() < 0.6 else 0
    turning = float(rng.choice([0.03, 0.1, 0.3])) if rng.uniform() < 0.5 else None
    noise = float(rng.choice([1.0, 5.0, 20.0]))
    world = base(rng, noise, turning, outliers)
    if rng.uniform() < 0.3:
        with_slips(rng, world)
    vary(rng, world)
    return world


LOSSES = ["huber", "cauchy", "dcs", "geman_mcclure", "tukey", "welsch"]


def robust_clean(rng: np.random.Generator) -> World:
    world = base(rng, 1.0, None, 0)
    if rng.uniform() < 0.5:
        with_other_states(rng, world)
    world.loss = str(rng.choice(LOSSES))
    world.loss_on = "loops" if rng.uniform() < 0.5 else "all"
    return world


def robust(rng: np.random.Generator) -> World:
    world = base(rng, 1.0, None, int(rng.integers(2, 21)))
    if rng.uniform() < 0.3:
        with_other_states(rng, world)
    world.loss = str(rng.choice(LOSSES))
    world.loss_on = "loops" if rng.uniform() < 0.5 else "all"
    return world


"""Each kind, and its share of a search."""
KINDS: Dict[str, Tuple[Callable[[np.random.Generator], World], float]] = {
    "ordinary": (ordinary, 0.3),
    "rotation": (rotation, 0.15),
    "priors": (priors, 0.15),
    "hard": (hard, 0.2),
    "robust_clean": (robust_clean, 0.1),
    "robust": (robust, 0.1),
}


def draw(kind: str, seed: int) -> World:
    return KINDS[kind][0](np.random.default_rng([seed, list(KINDS).index(kind)]))
