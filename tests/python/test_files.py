# SPDX-License-Identifier: BSD-3-Clause
import gzip

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import cairn

EVERY_FORMAT = ["g2o", "graph", "g2o.gz", "graph.gz"]


@pytest.mark.parametrize("ending", EVERY_FORMAT)
def test_what_is_written_is_read(tmp_path, ending):
    graph, _ = cairn.generate("manhattan", seed=5, poses=100)
    path = tmp_path / f"map.{ending}"
    graph.write(path)
    again = cairn.read(str(path))
    assert_array_equal(again.ids(), graph.ids())
    assert_allclose(again.states(cairn.Pose2), graph.states(cairn.Pose2), rtol=1e-12)
    assert_allclose(again.chi2(), graph.chi2(), rtol=1e-9)
    assert (path.read_bytes()[:2] == b"\x1f\x8b") == ending.endswith(".gz")


def test_every_format_that_is_on_offer_can_be_named(tmp_path):
    graph, _ = cairn.generate("sphere", seed=5, turns=3)
    for name in ["g2o", "tum", "kitti"]:
        cairn.write(graph, tmp_path / "file", name)
        again = cairn.read(tmp_path / "file", name)
        assert again.variable_count == graph.variable_count
        positions = again.states(cairn.Pose3)[:, :3]
        assert_allclose(positions, graph.states(cairn.Pose3)[np.argsort(graph.ids()), :3], atol=1e-6)


def test_bundles_are_read_and_written(tmp_path):
    graph, _ = cairn.generate("bundle", seed=5)
    graph.write(tmp_path / "problem.bal")
    again = cairn.read(tmp_path / "problem.bal")
    assert again.factor_types == graph.factor_types
    camera = again.ids("VERTEX_CAMERA_BAL")[0]
    assert again.at(camera).shape == (10,)


def test_a_bad_file_is_named_with_its_line(tmp_path):
    (tmp_path / "bad.g2o").write_text("VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0\n")
    with pytest.raises(cairn.Error, match=r"bad\.g2o:2") as raised:
        cairn.read(tmp_path / "bad.g2o")
    assert raised.value.kind == "input"
    with pytest.raises(cairn.Error, match="nowhere.g2o"):
        cairn.read(tmp_path / "nowhere.g2o")


def test_unknown_lines_are_skipped_on_request(tmp_path):
    with gzip.open(tmp_path / "map.g2o.gz", "wt") as file:
        file.write("VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0\nTHING 1 2\nEDGE_SE2 0 1 1 0 0 1 0 0 1 0 1\n")
    with pytest.raises(cairn.Error, match=r"THING.*\(skip_unknown leaves such lines out\)"):
        cairn.read(tmp_path / "map.g2o.gz")
    graph = cairn.read(tmp_path / "map.g2o.gz", skip_unknown=True)
    assert graph.factor_count == 1
    assert any("THING" in note for note in graph.notes)


def test_what_files_lack_is_supplied_or_left_out_on_request(tmp_path):
    (tmp_path / "odd.g2o").write_text("VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0\nEDGE_SE2 0 1 1.5 0 0\nEDGE_SE2 0 9 1 0 0 1 0 0 1 0 1\n")
    with pytest.raises(cairn.Error, match=r"\(unit_information takes it as the identity\)"):
        cairn.read(tmp_path / "odd.g2o")
    with pytest.raises(cairn.Error, match=r"\(skip_dangling leaves out"):
        cairn.read(tmp_path / "odd.g2o", unit_information=True)
    graph = cairn.read(tmp_path / "odd.g2o", unit_information=True, skip_dangling=True)
    assert graph.factor_count == 1 and len(graph.notes) == 2
    assert graph.chi2() == 0.25
    assert graph.truth is None


def test_the_truth_of_a_file_is_kept_beside_its_graph(tmp_path):
    (tmp_path / "x.pyfg").write_text(
        "VERTEX_SE2 0.5 A0 5 5 0\nVERTEX_SE2 1.5 A1 7 5 0\nEDGE_SE2 0.5 A0 A1 1 0 0 0.25 0 0 0.5 0 0.01\n"
    )
    graph = cairn.read(tmp_path / "x.pyfg")
    assert_array_equal(graph.states(cairn.Pose2), [[0, 0, 0], [1, 0, 0]])
    assert_array_equal(graph.truth.states(cairn.Pose2), [[5, 5, 0], [7, 5, 0]])
    assert_array_equal(graph.stamps, [0.5, 1.5])
    assert_array_equal(graph.copy().truth.states(cairn.Pose2), graph.truth.states(cairn.Pose2))


def test_generators_are_repeatable_and_take_options():
    one, _ = cairn.generate("manhattan", seed=9, poses=50)
    two, _ = cairn.generate("manhattan:poses=50", seed=9)
    other, truth = cairn.generate("manhattan", seed=10, poses=50)
    assert_array_equal(one.states(cairn.Pose2), two.states(cairn.Pose2))
    assert one.variable_count == 50 and not np.array_equal(one.states(cairn.Pose2), other.states(cairn.Pose2))
    assert truth.variable_count == 50
