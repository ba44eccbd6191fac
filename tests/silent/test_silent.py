# SPDX-License-Identifier: BSD-3-Clause
"""The search for silent failures finds those that are there, and none in ordinary graphs."""
import os
import sys

import numpy as np
import pytest

sys.path.insert(0, os.path.dirname(__file__))

import search
from trial import judge
from worlds import KINDS, draw, is_odometry, stays_connected


@pytest.mark.parametrize("kind", KINDS)
def test_a_world_is_the_same_again(kind):
    first, second = draw(kind, 7), draw(kind, 7)
    assert first.name == second.name
    assert first.graph.chi2() == second.graph.chi2()
    assert draw(kind, 8).name != first.name


def test_the_truth_fits_the_measurements():
    for seed in range(1, 20):
        world = draw("ordinary", seed)
        verdict = judge("ordinary", seed, world, alone=True)
        assert verdict.best < 3.0 * world.expected * sum(
            np.prod(world.graph.information(tag).shape[:2]) for tag in world.graph.factor_types), world.name


def test_ordinary_graphs_have_no_finding():
    verdicts = [judge("ordinary", seed, draw("ordinary", seed)) for seed in range(1, 25)]
    assert [search.shown(v) for v in verdicts if v.finding] == []


@pytest.mark.parametrize("seed", [1000112, 1000188, 1000450, 1000505, 1000570])
def test_rounding_is_no_other_minimum(seed):
    """What fits exactly does so everywhere within its uncertainty, but for rounding."""
    verdict = judge("priors", seed, draw("priors", seed))
    assert verdict.chi2 < 1e-20 and verdict.doubts == []


def test_a_bounded_loss_that_outvotes_measurements_is_searched():
    """No factor is rejected here, but four have less than a quarter of their weight, and another minimum is lower."""
    verdict = judge("robust_clean", 1000709, draw("robust_clean", 1000709))
    assert verdict.finding == "", search.shown(verdict)


def test_a_landmark_where_a_pose_is_has_no_bearing():
    """A noisy short range pulls the landmark onto the pose, where the bearing jumps: no optimizer finds the way from there."""
    verdict = judge("ordinary", 5000401, draw("ordinary", 5000401))
    assert any("the landmark is where the pose is" in doubt for doubt in verdict.doubts) and verdict.finding == "", search.shown(verdict)


def test_a_bad_start_is_found():
    """From the states that are given, random ones among them, some graphs end elsewhere in silence."""
    verdicts = (judge("rotation", seed, draw("rotation", seed), initial=None) for seed in range(1, 60))
    silent = next(v for v in verdicts if v.finding == "silent")
    assert silent.chi2 > silent.best
    assert "silent" in search.shown(silent) and "--kind rotation" in search.shown(silent)


def test_a_table_counts_every_kind(capsys):
    code = search.main(["6", "--alone", "--jobs", "1", "--seed", "3", "--data", "", "--quiet"])
    rows = capsys.readouterr().out.splitlines()
    assert [row.split(" | ")[0].strip("| ") for row in rows[2:]] == list(KINDS)
    assert code in (0, 1)


def test_connected_or_not():
    assert stays_connected(3, np.array([[0, 1], [1, 2]]))
    assert not stays_connected(3, np.array([[0, 1]]))
    assert is_odometry(np.array([[3, 4], [4, 3], [2, 9]])).tolist() == [True, True, False]
