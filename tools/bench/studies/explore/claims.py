# SPDX-License-Identifier: BSD-3-Clause
"""The claims of the thesis about a part ("cave", "freiburg", "action"), and whether the runs show them. A claim is the whole
sentence of the thesis (5.3.3 and 5.4.5): what it says in passing or in brackets is a part of it."""
from __future__ import annotations

from itertools import permutations

from ...intervals import MeanInterval
from ...pages import table
from ...reports import Json, text
from .runs import MAP_ERROR_AT_COVERAGE, WRONG_AT_SEEN, difference_of, mean_of

# (measure, less, more, factor): `less` has less of a measure than `factor` times what `more` has, on average. If `less` is a
# number, `more` has more than it.
Inequality = tuple[str, str | float, str, float]


def less(measure: str, *pairs: str, factor: float = 1.0) -> list[Inequality]:
    """Of pairs "a < b"."""
    return [(measure, *pair.split(" < "), factor) for pair in pairs]  # type: ignore[misc]


def more_than(measure: str, least: float, *methods: str) -> list[Inequality]:
    return [(measure, least, method, 1.0) for method in methods]


def similar(measure: str, methods: list[str], factor: float) -> list[Inequality]:
    """None has `factor` times what another has."""
    return [(measure, a, b, factor) for a, b in permutations(methods, 2)]


IN_CAVE = ["frontier", "ede_gradient", "ede_rrt_star"]
FULL_CAVE = 285.0  # [m²] 95 % of the floor that the body can cover
BOTH_EDE = ["ede_gradient < frontier", "ede_rrt_star < frontier"]
CLAIMS: dict[str, dict[str, list[Inequality]]] = {
    "cave": {
        "all three end with similar map entropy (within 10 %)": similar("map_entropy", IN_CAVE, 1.1),
        "… and with full coverage (285 of the 300 m² seen)": more_than("seen", FULL_CAVE, *IN_CAVE),
        "both EDE have a significantly lower trajectory entropy": less("trajectory_entropy", *BOTH_EDE),
        "all three close a similar number of loops (within 50 %)": similar("loops", IN_CAVE, 1.5),
        "… and the frontier-based map is of worse quality (error at equal coverage)": less(MAP_ERROR_AT_COVERAGE, *BOTH_EDE),
        "frontier-based exploration collides most": less("collisions", *BOTH_EDE),
        "… which is many collisions (at least one per run)": more_than("collisions", 1.0, "frontier"),
        "both EDE take less time": less("seconds", *BOTH_EDE),
    },
    "freiburg": {
        "gradient descent is trapped at doors (covers less than 70 %)":
            less("coverage", "ede_gradient < frontier", "ede_gradient < ede_rrt_star", factor=0.7),
        "EDE with RRT* has lower entropies of map and trajectory than frontier":
            less("map_entropy", "ede_rrt_star < frontier") + less("trajectory_entropy", "ede_rrt_star < frontier"),
        "EDE with RRT* has a larger and more accurate map than frontier (coverage; error at equal coverage)":
            less("coverage", "frontier < ede_rrt_star") + less(MAP_ERROR_AT_COVERAGE, "ede_rrt_star < frontier"),
        "EDE with RRT* takes longest": less("seconds", "frontier < ede_rrt_star", "ede_gradient < ede_rrt_star"),
    },
    "action": {
        "EDE has a lower trajectory entropy than dRRT* and eRRT*, these have a lower map entropy":
            less("trajectory_entropy", "ede_rrt_star < drrt_star", "ede_rrt_star < errt_star")
            + less("map_entropy", "drrt_star < ede_rrt_star", "errt_star < ede_rrt_star"),
        "dRRT* and frontier have the lowest map entropy":
            less("map_entropy", "drrt_star < errt_star", "drrt_star < ede_rrt_star", "frontier < errt_star",
                 "frontier < ede_rrt_star"),
        "the heuristic has the highest map entropy and covers least":
            less("map_entropy", "frontier < heuristic", "ede_rrt_star < heuristic", "drrt_star < heuristic",
                 "errt_star < heuristic") + less("coverage", "heuristic < errt_star", "heuristic < ede_rrt_star"),
        "the heuristic has the lowest trajectory entropy":
            less("trajectory_entropy", "heuristic < frontier", "heuristic < ede_rrt_star", "heuristic < drrt_star",
                 "heuristic < errt_star"),
        "frontier has the highest trajectory entropy":
            less("trajectory_entropy", "ede_rrt_star < frontier", "drrt_star < frontier", "errt_star < frontier"),
        "… after closing as many loops as EDE and dRRT* (within 50 %)":
            similar("loops", ["frontier", "ede_rrt_star", "drrt_star"], 1.5),
        "the heuristic closes most loops, eRRT* nearly twice as many as dRRT* (1.5 times)":
            less("loops", "errt_star < heuristic") + less("loops", "drrt_star < errt_star", factor=1.0 / 1.5),
        "EDE takes as long as frontier (within 50 %)": similar("seconds", ["frontier", "ede_rrt_star"], 1.5),
        "dRRT* takes longer than frontier, eRRT* than dRRT*, the heuristic longest":
            less("seconds", "frontier < drrt_star", "drrt_star < errt_star", "errt_star < heuristic"),
        "at equal coverage dRRT* and eRRT* have less map error than the rest: frontier":
            less(MAP_ERROR_AT_COVERAGE, "drrt_star < frontier", "errt_star < frontier"),
        "… and the heuristic and EDE":
            less(MAP_ERROR_AT_COVERAGE, "drrt_star < heuristic", "errt_star < heuristic", "drrt_star < ede_rrt_star",
                 "errt_star < ede_rrt_star"),
        "eRRT* has slightly less map error than dRRT*, dRRT* covers more":
            less("map_error", "errt_star < drrt_star") + less("coverage", "errt_star < drrt_star"),
        "… and eRRT* covers significantly more than the heuristic, with less error":
            less("coverage", "heuristic < errt_star") + less("map_error", "errt_star < heuristic"),
        "not the thesis's: one of dRRT* and eRRT*, dRRT*, has fewer wrong cells than frontier at equal parts seen":
            less(WRONG_AT_SEEN, "drrt_star < frontier"),
        "and the other, eRRT*": less(WRONG_AT_SEEN, "errt_star < frontier"),
    },
}


def row_of(claim: str, inequalities: list[Inequality], methods: dict[str, Json]) -> list[str]:
    """A claim is seen if all of its inequalities hold between means; clear of zero if every paired difference has an interval
    clear of zero as well."""
    known = clear = True
    against: list[str] = []
    in_favour: list[str] = []
    for measure, low, high, factor in inequalities:
        if isinstance(low, float):
            mean = mean_of(methods.get(high), measure)
            difference = MeanInterval(mean.count, low - mean.mean, mean.half_width)
        else:
            difference = difference_of(methods.get(low), methods.get(high), measure, factor)
        if difference.count == 0:
            known = False
            continue
        low = f"{low:g}" if isinstance(low, float) else low
        scale = "" if factor == 1.0 else f"{factor:.2f} · "
        (in_favour if difference.mean < 0.0 else against).append(
            f"{measure}: {low} − {scale}{high} = {difference.text(sign=True)}")
        clear = clear and difference.mean + difference.half_width < 0.0
    verdict = "not seen" if against else "not measured" if not known else "seen, clear of zero" if clear else "seen"
    return [claim, verdict, "; ".join(against), "; ".join(in_favour)]


def claim_verdicts(part: str, methods: list[Json]) -> dict[str, str]:
    """Of each claim: "seen, clear of zero", "seen", "not seen", "not measured"."""
    by_name = {text(method, "method"): method for method in reversed(methods)}
    return {claim: row_of(claim, inequalities, by_name)[1] for claim, inequalities in CLAIMS[part].items()}


def claims_table(part: str, methods: list[Json]) -> str:
    by_name = {text(method, "method"): method for method in reversed(methods)}
    return table(["claim", "seen?", "differences that speak against it", "and for it"],
                 [row_of(claim, inequalities, by_name) for claim, inequalities in CLAIMS[part].items()])
