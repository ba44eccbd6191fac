# SPDX-License-Identifier: BSD-3-Clause
import copy
import threading

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import cairn
import dense
from graphs import from_dense


def feed(estimator, walk, until=None):
    """Pose by pose, each placed by its first measurement; returns the reports."""
    reports = []
    for k in range(len(walk.poses)):
        if until is not None and k >= until:
            break
        if k == 0:
            estimator.add(0, cairn.Pose2(), fixed=True)
        else:
            estimator.add(k, cairn.Pose2)
        for i, j, z, information in walk.edges:
            if max(i, j) == k:
                estimator.add(cairn.Between(i, j, cairn.Pose2(*z)), information=information)
        reports.append(estimator.update())
    return reports


@pytest.mark.parametrize("name", ["batch", "periodic_batch:every=1"])
def test_converged_is_what_has_converged(name):
    walk = dense.loop()
    separator = "," if ":" in name else ":"
    short = feed(cairn.Estimator(f"{name}{separator}iterations=1"), walk)
    assert not short[-1].converged
    assert sum("not converged: max_iterations after 1 iteration" in note for report in short for note in report.notes) == 1
    assert all(report.converged for report in feed(cairn.Estimator(name), walk))


@pytest.mark.parametrize("name", ["incremental_cholesky", "batch", "periodic_batch:every=5", "incremental_qr"])
def test_the_estimate_is_that_of_dense_gauss_newton(name):
    walk = dense.loop()
    estimator = cairn.Estimator(name)
    reports = feed(estimator, walk)
    reports.append(estimator.update(full=True))
    assert all(report.ok for report in reports) and reports[-1].converged
    least = walk.optimize()
    assert_allclose(estimator.chi2(), least, rtol=1e-8)
    assert_array_equal(estimator.ids(), np.arange(len(walk.poses)))
    assert_allclose(estimator.states(cairn.Pose2), walk.poses, atol=1e-5)
    assert_allclose(estimator.estimate(7).state, walk.poses[7], atol=1e-5)


@pytest.mark.parametrize("keep", ["none", "last", "diagonal"])
def test_covariances_are_those_of_the_dense_inverse(keep):
    walk = dense.loop()
    estimator = cairn.Estimator("incremental_cholesky", keep=keep)
    feed(estimator, walk)
    estimator.update(full=True)
    walk.optimize()
    ids = [24, 3, 11]
    for k, sigma in zip(ids, estimator.covariance(ids)):
        assert_allclose(sigma, walk.covariance(k, k), rtol=1e-5, atol=1e-8)
    assert estimator.covariance(24).shape == (3, 3) and estimator.covariance([24]).shape == (1, 3, 3)
    assert_allclose(estimator.cross_covariances([[24, 3]])[0], walk.covariance(24, 3), rtol=1e-5, atol=1e-8)
    assert not estimator.covariance(0).any()  # fixed


def test_a_marginalised_variable_leaves_its_information():
    walk = dense.loop()
    estimator = cairn.Estimator()
    feed(estimator, walk)
    estimator.update(full=True)
    before = estimator.covariance([20, 24])
    estimator.marginalize([5, 6])
    estimator.marginalize(7)
    report = estimator.update()
    assert 5 not in estimator and 6 not in estimator and 7 not in estimator and 8 in estimator
    assert len(report.priors) >= 1
    assert_allclose(estimator.covariance([20, 24]), before, rtol=1e-4)


def test_factors_are_changed_and_removed_by_number():
    walk = dense.loop()
    estimator = cairn.Estimator()
    reports = feed(estimator, walk)
    assert estimator.factors == list(range(len(walk.edges)))
    first = reports[-1].first_factor  # of pose 24: its odometry, then the loop closure
    i, j, z, information = walk.edges[first + 1]
    estimator.change(first + 1, z + [0.1, 0, 0], information=2 * information)
    estimator.remove(factors=first - 1)
    estimator.update(full=True)
    walk.edges[first + 1] = (i, j, z + [0.1, 0, 0], 2 * information)
    del walk.edges[first - 1]
    assert_allclose(estimator.chi2(), walk.optimize(), rtol=1e-8)
    estimator.remove(variables=[24])
    estimator.update()
    assert estimator.variable_count == 24 and estimator.factor_count == len(walk.edges) - 2


def test_a_copy_is_independent_and_takes_along_what_is_pending():
    walk = dense.loop()
    estimator = cairn.Estimator()
    feed(estimator, walk)
    chi2 = estimator.chi2()
    estimator.add(99, cairn.Pose2(1, 1, 1))
    for other in [estimator.copy(), copy.copy(estimator), copy.deepcopy(estimator)]:
        other.add(cairn.Between(24, 99, cairn.Pose2(1, 0, 0)), sigmas=0.1)
        other.add(cairn.Between(99, 3, cairn.Pose2(5, 0, 0)), sigmas=0.1)
        other.update()
        assert 99 in other and other.chi2() > chi2 + 1
    assert 99 not in estimator and estimator.chi2() == chi2


def test_its_graph_is_an_ordinary_one():
    walk = dense.loop()
    estimator = cairn.Estimator()
    feed(estimator, walk)
    graph = estimator.graph()
    assert_allclose(graph.chi2(), estimator.chi2(), rtol=1e-12)
    graph.fix(0)
    assert_allclose(cairn.optimize(graph, initial=None).chi2, cairn.optimize(from_dense(walk), initial=None).chi2, rtol=1e-9)


ESTIMATORS = ["incremental_cholesky", "incremental_qr", "batch", "periodic_batch:every=3", "ekf", "eif", "seif"]


@pytest.mark.parametrize("name", ESTIMATORS)
@pytest.mark.parametrize("what", ["add", "add_after_another", "change", "remove", "marginalise", "full"])
def test_a_factor_that_raises_once_leaves_it_as_it_was(name, what):
    """At one call after the other, as long as the update makes another: as a copy that never saw a failure."""
    calls_left = [0]

    def ranges(pose, point, measured):
        calls_left[0] -= 1
        if calls_left[0] == 0:
            raise ValueError("no answer of the sensor")
        return np.hypot(*(point - pose[:, :2]).T)[:, None] - measured

    ranging = cairn.FactorType("EDGE_RANGING", [cairn.Pose2, cairn.Point2], ranges, residual_size=1, measurement_size=1)
    estimator = cairn.Estimator(name)
    estimator.add(0, cairn.Pose2(), fixed=True)
    estimator.add(100, cairn.Point2(3.0, 4.0))
    estimator.add(cairn.Observation(0, 100, cairn.Point2(3.0, 4.0)), sigmas=0.2)
    for k in range(1, 5):
        estimator.add(k, cairn.Pose2(k, 0.1, 0))
        estimator.add(cairn.Between(k - 1, k, cairn.Pose2(1, 0, 0.05)), sigmas=0.1)
        estimator.add(cairn.Measurement(ranging, [k, 100], [4.5]), sigmas=0.1)
        estimator.update()

    def ask(of):
        if what == "add_after_another":
            of.add(cairn.Between(0, 2, cairn.Pose2(2.1, 0, 0.1)), sigmas=0.1)
        if what in ("add", "add_after_another"):
            of.add(cairn.Measurement(ranging, [1, 100], [4.4]), sigmas=0.1)
        if what == "change":
            of.change(2, [9.0])
        if what == "remove":
            of.remove(factors=2)
        if what == "marginalise":
            of.marginalize(2)
        return of.update(full=what == "full")

    def held(of):
        arrays = of.states(cairn.Pose2), of.states(cairn.Point2), of.covariance(of.ids(cairn.Pose2)), of.covariance(100)
        return of.factors, of.chi2(), [array.tolist() for array in arrays]

    for _ in range(2):
        twin = estimator.copy()
        failures, at = 0, 0
        while True:
            at += 1
            calls_left[0] = at
            try:
                report = ask(estimator)
            except cairn.Error as error:
                assert "EDGE_RANGING" in str(error) and "no answer of the sensor" in str(error)
                assert error.kind == "plugin"
                failures += 1
            else:
                break
            finally:
                calls_left[0] = 0
            assert held(estimator) == held(twin)
        expected = ask(twin)
        assert held(estimator) == held(twin) and report.ok == expected.ok
        assert failures > 0 or what in ("remove", "marginalise") or name in ("ekf", "eif", "seif")
        if what in ("remove", "marginalise"):
            break


def test_an_error_leaves_it_as_it_was_and_forgets_the_update():
    walk = dense.loop()
    estimator = cairn.Estimator()
    feed(estimator, walk)
    chi2 = estimator.chi2()
    estimator.add(50, cairn.Pose2)
    estimator.add(cairn.Between(24, 51, cairn.Pose2()), sigmas=0.1)
    with pytest.raises(cairn.Error, match="51") as raised:
        estimator.update()
    assert raised.value.kind == "input"
    assert estimator.chi2() == chi2 and 50 not in estimator
    assert estimator.update().ok and estimator.chi2() == chi2  # nothing is left of it
    for call, message in [
        (lambda: estimator.estimate(77), "77"),
        (lambda: estimator.covariance([77]), "77"),
        (lambda: estimator.states("VERTEX_XY"), "there is no VERTEX_XY in the estimator"),
        (lambda: estimator.update(max_seconds=-1), "max_seconds"),
        (lambda: cairn.Estimator("incremental_cholesky", keep="all"), "expected 'none', 'last' or 'diagonal'"),
        (lambda: cairn.Estimator("isam2"), "incremental_cholesky"),
        (lambda: cairn.Estimator("periodic_batch", evry=3), "every"),
        (lambda: estimator.add(52), "a type is given by its tag"),
    ]:
        with pytest.raises(cairn.Error, match=message):
            call()


def test_a_loss_holds_a_wrong_loop_closure_off():
    walk = dense.loop()
    estimators = [cairn.Estimator(), cairn.Estimator()]
    estimators[1].set_loss("cauchy:scale=1", on="loops")
    for estimator in estimators:
        feed(estimator, walk)
        estimator.add(cairn.Between(3, 9, cairn.Pose2(9, 9, 0)), sigmas=0.1)
        estimator.update(full=True)
    walk.optimize()
    errors = [np.abs(estimator.states(cairn.Pose2) - walk.poses)[:, :2].max() for estimator in estimators]
    assert errors[1] < 0.3 and errors[0] > 2


def test_other_threads_run_during_an_update():
    graph, _ = cairn.generate("manhattan", seed=1, poses=3000)
    estimator = cairn.Estimator("batch")
    ids, states = graph.ids(cairn.Pose2), graph.states(cairn.Pose2)
    for id, state in zip(ids, states):
        estimator.add(id, state, type=cairn.Pose2)
    for pair, z, omega in zip(graph.factor_ids("EDGE_SE2"), graph.measurements("EDGE_SE2"), graph.information("EDGE_SE2")):
        estimator.add(cairn.Measurement("EDGE_SE2", pair, z), information=omega)
    done, refused, ticks = threading.Event(), [], [0]

    def work():
        estimator.update(full=True)
        done.set()

    thread = threading.Thread(target=work)
    thread.start()
    while not done.is_set():
        ticks[0] += 1
        try:
            estimator.variable_count
        except cairn.Error as error:
            refused.append(str(error))
        done.wait(1e-4)
    thread.join()
    assert ticks[0] > 1 and any("in use by a call in another thread" in message for message in refused)
    assert estimator.variable_count == 3000


def circle(poses, name="incremental_cholesky", **options):
    """Odometry around a circle that does not close, pose by pose."""
    estimator = cairn.Estimator(name, **options)
    turn = 2 * np.pi / poses
    for k in range(poses):
        estimator.add(k, cairn.Pose2() if k == 0 else cairn.Pose2, fixed=k == 0)
        if k:
            estimator.add(cairn.Between(k - 1, k, cairn.Pose2(1, 0, turn + 0.03)), sigmas=[0.1, 0.1, 0.05])
        estimator.update()
    return estimator, cairn.Between(poses - 1, 0, cairn.Pose2(1, 0, turn))


@pytest.mark.parametrize("leaves", [5, 39])
def test_what_is_new_is_placed_after_a_solution_that_a_time_limit_has_left(leaves):
    ends = []
    for name, limit in [("batch", 0), ("incremental_cholesky", 0), ("incremental_cholesky", 1e-9)]:
        estimator, loop = circle(40, name)
        estimator.add(loop, sigmas=0.001)
        report = estimator.update(max_seconds=limit)
        assert (report.owed > 0) == (limit > 0)
        estimator.add(40, cairn.Pose2)
        estimator.add(cairn.Between(39, 40, cairn.Pose2(1, 0, 0.1)), sigmas=0.1)
        estimator.marginalize(leaves)
        estimator.update(max_seconds=limit)
        assert estimator.update(full=True).converged
        ends.append(estimator.estimate(40).state)
    assert_allclose(ends[1:], [ends[0]] * 2, atol=1e-6)


@pytest.mark.parametrize("keep", ["none", "diagonal"])
def test_covariances_are_those_of_the_end_of_a_solution_that_a_time_limit_has_left(keep):
    estimator, loop = circle(12, keep=keep)
    estimator.add(loop, sigmas=0.001)
    closure = estimator.update().first_factor
    estimator.remove(factors=closure)
    assert estimator.update(max_seconds=1e-9).owed > 0
    finished = estimator.copy()
    finished.update(full=True)
    assert_allclose(estimator.covariance(11), finished.covariance(11), rtol=1e-3)
