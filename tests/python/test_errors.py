# SPDX-License-Identifier: BSD-3-Clause
"""Errors are cairn.Error, and of Python's own kinds beside it."""
import copy
import errno
import os
import pickle
import subprocess
import sys

import numpy as np
import pytest

import cairn


def pair():
    graph = cairn.Graph()
    graph.add(0, cairn.Pose2(), fixed=True)
    graph.add(1, cairn.Pose2(1, 0, 0))
    graph.add(cairn.Between(0, 1, cairn.Pose2(1, 0, 0)), sigmas=0.1)
    return graph


def raised(call):
    with pytest.raises(cairn.Error) as caught:
        call()
    return caught.value


@pytest.mark.parametrize("call", [
    lambda folder: cairn.read(folder / "none.g2o"),
    lambda folder: cairn.read(str(folder / "none.g2o"), format="toro"),
    lambda folder: pair().write(folder / "nowhere" / "x.g2o"),
    lambda folder: cairn.write(pair(), folder / "nowhere" / "x.g2o"),
    lambda folder: cairn.read_floor(folder / "none.yaml"),
    lambda folder: cairn.read_floor(str(folder / "none.png") + ":resolution=0.05"),
])
def test_a_file_that_is_not_there(tmp_path, call):
    error = raised(lambda: call(tmp_path))
    assert isinstance(error, FileNotFoundError) and error.kind == "input"
    assert str(tmp_path) in error.filename and error.errno == 2
    assert str(error) == error.args[0] and str(tmp_path) in str(error)


def test_a_file_that_is_there_and_wrong(tmp_path):
    (tmp_path / "wrong.g2o").write_text("VERTEX_SE2 0 0 0\n")
    error = raised(lambda: cairn.read(tmp_path / "wrong.g2o"))
    assert isinstance(error, ValueError) and not isinstance(error, OSError) and error.kind == "input"


@pytest.mark.parametrize("call", [
    lambda graph, estimator: graph.at(9),
    lambda graph, estimator: graph.fix(9),
    lambda graph, estimator: graph.remove(variables=[9]),
    lambda graph, estimator: graph.remove(factors=[9]),
    lambda graph, estimator: graph.factor(9),
    lambda graph, estimator: graph.set_states(cairn.Pose2, np.zeros((1, 3)), ids=[9]),
    lambda graph, estimator: graph.add_factors("EDGE_SE2", [[0, 9]], [[0, 0, 0]], sigmas=1),
    lambda graph, estimator: graph.add_factors(cairn.Between, [[9, 0]], [[0, 0, 0]], sigmas=1),
    lambda graph, estimator: cairn.marginals(graph, [1, 9]),
    lambda graph, estimator: cairn.cross_covariances(graph, [[1, 9]]),
    lambda graph, estimator: estimator.estimate(9),
    lambda graph, estimator: estimator.covariance(9),
    lambda graph, estimator: estimator.cross_covariances([[9, 0]]),
])
def test_an_id_that_is_not_there(call):
    estimator = cairn.Estimator("batch")
    error = raised(lambda: call(pair(), estimator))
    assert isinstance(error, KeyError) and error.kind == "usage"
    assert "there is no" in str(error) and "9" in str(error)
    assert not str(error).startswith("'")  # a KeyError shows the representation of its text


@pytest.mark.parametrize("call", [
    lambda graph: graph.add_variables(cairn.Pose2, [5], np.zeros((1, 2))),
    lambda graph: graph.add(-1, cairn.Pose2()),
    lambda graph: graph.add(cairn.Between(0, 1, cairn.Pose2()), sigmas=[1, 2]),
    lambda graph: cairn.marginals(graph, [[1]]),
    lambda graph: cairn.Pose2.from_state([1, 2]),
])
def test_a_value_that_does_not_fit(call):
    assert isinstance(raised(lambda: call(pair())), ValueError)


@pytest.mark.parametrize("call, number, kind", [
    (lambda folder: cairn.read(folder), errno.EISDIR, IsADirectoryError),
    (lambda folder: pair().write(folder, format="g2o"), errno.EISDIR, IsADirectoryError),
    (lambda folder: cairn.read(folder / "locked" / "x.g2o"), errno.ENOTDIR, OSError),
    (lambda folder: pair().write("/dev/full", format="g2o"), errno.ENOSPC, OSError),
])
def test_what_the_system_refuses_about_a_file(tmp_path, call, number, kind):
    (tmp_path / "locked").write_text("")
    error = raised(lambda: call(tmp_path))
    assert isinstance(error, cairn.FileError) and isinstance(error, kind) and not isinstance(error, ValueError)
    assert error.errno == number and error.filename and error.kind == "input"
    assert str(error) == error.args[0] and error.filename in str(error)


@pytest.mark.parametrize("call", [
    lambda graph: cairn.optimize(graph, "doglegs"),
    lambda graph: cairn.optimize(graph, linear_solver="nope"),
    lambda graph: cairn.optimize(graph, initial="nope"),
    lambda graph: cairn.optimize(graph, loss="nope"),
    lambda graph: cairn.Estimator("nope"),
    lambda graph: cairn.marginals(graph, [1], linear_solver="nope"),
    lambda graph: graph.add_factors("EDGE_NOPE", [[0, 1]], [[0, 0, 0]], sigmas=1),
])
def test_a_name_that_is_not_on_offer(call):
    error = raised(lambda: call(pair()))
    assert isinstance(error, ValueError) and error.kind == "plugin" and "there is no" in str(error)


def test_the_others_are_of_no_other_kind():
    def broken(pose, measured):
        raise ValueError("broken")

    graph = pair()
    graph.add(cairn.Measurement(cairn.FactorType("EDGE_BROKEN", [cairn.Pose2], broken, residual_size=3, measurement_size=3),
                                [1], [0, 0, 0]), sigmas=1)
    error = raised(graph.chi2)
    assert type(error) is cairn.Error and error.kind == "plugin"


def test_errors_pass_to_other_processes(tmp_path):
    for call in (lambda: pair().at(9), lambda: cairn.read(tmp_path / "none"), lambda: cairn.read(tmp_path), lambda: pair().add(-1, cairn.Pose2())):
        error = raised(call)
        again = pickle.loads(pickle.dumps(error))
        assert type(again) is type(error) and str(again) == str(error) and again.kind == error.kind


def test_one_id_gives_one_covariance():
    graph = pair()
    several = cairn.marginals(graph, [1])
    for one in (1, np.int64(1), np.uint8(1)):
        assert np.array_equal(cairn.marginals(graph, one), several[0])
    assert several.shape == (1, 3, 3)


def test_what_is_masked_or_no_number_is_refused():
    graph = pair()
    masked = np.ma.array([[0.0, 0.0, 0.0]], mask=[[False, True, False]])
    times = np.array([["2026-01-01"] * 3], dtype="datetime64[s]")
    for states, message in ((masked, "masked"), (times, "times"), (list(times), "numbers"), (times - times, "times"),
                            (np.zeros((1, 3), dtype=complex), "complex")):
        with pytest.raises(cairn.Error, match=message):
            graph.add_variables(cairn.Pose2, [7], states)
    with pytest.raises(cairn.Error, match="masked"):
        graph.add_variables(cairn.Pose2, np.ma.array([7], mask=[True]), np.zeros((1, 3)))
    assert graph.variable_count == 2
    graph.add_variables(cairn.Pose2, [7], np.ma.array(np.zeros((1, 3))))  # with nothing masked


def test_a_type_that_no_file_or_memory_can_hold_is_refused():
    for arguments, message in ((dict(tag="EDGE\nX"), "blank or a control"), (dict(tag="EDGE X"), "blank or a control"),
                               (dict(residual_size=10**9), "at most 1000"), (dict(measurement_size=10**9), "at most 1000")):
        all = dict(dict(tag="EDGE_X", residual_size=1, measurement_size=1), **arguments)
        with pytest.raises(cairn.Error, match=message):
            cairn.FactorType(all.pop("tag"), [cairn.Pose2], lambda *x: x, **all)


def test_a_floor_that_is_too_large_is_refused_by_its_shape():
    cells = np.lib.stride_tricks.as_strided(np.zeros(1, dtype=np.int8), (40000, 40000), (0, 0))
    with pytest.raises(cairn.Error, match="40000 × 40000 cells"):
        cairn.Floor(cells, 0.05)


def test_angles_have_the_names_of_cpp():
    assert cairn.Rot3.yaw(0.3).equals(cairn.Rot3.from_roll_pitch_yaw(0, 0, 0.3))


def test_a_static_constructor_of_a_plugin_is_an_error():
    folder = os.environ.get("CAIRN_TEST_BAD_PLUGINS", "") + "/static_constructor"
    if not os.path.exists(folder + "/eager.so"):
        pytest.skip("the plugins that are wrong on purpose are not built")
    program = """
import cairn
try:
    cairn.generate('ring', 1, poses=9)[0].set_loss('eager')
except cairn.Error as error:
    print(error.kind, error)
"""
    for does, words in (("throws", "threw an exception: there is no camera"), ("exits", "ended the process with exit code 0")):
        ended = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True,
                               env=dict(os.environ, CAIRN_PLUGIN_PATH=folder, CAIRN_TEST_CONSTRUCTOR=does))
        assert ended.stdout.startswith("plugin a static constructor " + words), ended.stdout + ended.stderr
        assert "eager.so" in ended.stdout and ended.returncode == 0


def test_an_object_without_init_is_refused():
    """In a process of its own: what lies in that memory may end it."""
    program = """
import cairn
used = 0
for name, kind in vars(cairn).items():
    if not isinstance(kind, type) or issubclass(kind, BaseException):
        continue
    try:
        bare = kind.__new__(kind)
    except TypeError:
        continue
    for member in dir(kind):
        if member == '_result_types' or member.startswith('__') and member not in ('__repr__', '__copy__', '__contains__', '__array__'):
            continue
        try:
            value = getattr(bare, member)
            if callable(value):
                value()
        except (TypeError, cairn.Error):
            continue
        used += not callable(value)
    try:
        repr(bare)
    except TypeError:
        pass
assert used < 20, used  # constants of the classes
print('ended')
"""
    ended = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, env=os.environ)
    assert ended.stdout == "ended\n", ended.stdout + ended.stderr
    for kind in (cairn.Graph, cairn.Between, cairn.Estimator, cairn.Pose3):
        with pytest.raises(TypeError, match="__init__ of this object was never called|Error|incompatible"):
            repr(kind.__new__(kind))
    assert copy.copy(cairn.Pose2(1, 2, 3)) == pickle.loads(pickle.dumps(cairn.Pose2(1, 2, 3)))
