# SPDX-License-Identifier: BSD-3-Clause
import math
import os
import shutil
import subprocess
import sys

import pytest

import cairn


def test_every_kind_lists_its_components():
    assert {"optimizer", "linear_solver", "format", "loss", "factor", "variable"} <= set(cairn.kinds())
    for kind in cairn.kinds():
        for name, component in cairn.components(kind).items():
            assert (component.kind, component.name) == (kind, name)
            assert component.summary and component.plugin and component.licence


def test_options_have_names_types_and_ranges():
    options = {option.name: option for option in cairn.components("optimizer")["dogleg"].options}
    solver = options["linear_solver"]
    assert (solver.type, solver.choices) == ("component", ["linear_solver"])
    assert solver.default in cairn.components("linear_solver")
    scale = {option.name: option for option in cairn.components("loss")["cauchy"].options}["scale"]
    assert scale.type == "real" and scale.minimum > 0 and scale.maximum < math.inf and scale.help
    assert "cairn.Option scale=" in repr(scale)


def test_every_default_is_accepted():
    for kind in ["optimizer", "linear_solver", "loss", "generator"]:
        for name, component in cairn.components(kind).items():
            given = {option.name: option.default for option in component.options if option.default and "," not in option.default}
            assert cairn.spec(name, **given).startswith(name)


def test_a_wrong_kind_says_which_there_are():
    with pytest.raises(cairn.Error, match="nothing of kind 'optimiser' is on offer; kinds: .*optimizer"):
        cairn.components("optimiser")


def test_without_plugins_the_folders_of_the_search_are_named(tmp_path):
    # The libraries alone: plugins are looked for beside them.
    with open("/proc/self/maps") as maps:
        libraries = {line.split()[-1] for line in maps if "/libcairn.so" in line}
    assert libraries
    for library in libraries:
        shutil.copy(library, tmp_path)
        soname = os.path.basename(library)
        while soname != "libcairn.so":  # libcairn.so.0.1.0, .0.1, .0: whichever the module asks for
            soname = soname.rpartition(".")[0]
            if not (tmp_path / soname).exists():
                (tmp_path / soname).symlink_to(os.path.basename(library))
    program = """
import cairn
assert cairn.kinds() == []
try:
    cairn.components("optimizer")
except cairn.Error as error:
    print(error)
"""
    environment = {name: value for name, value in os.environ.items() if name != "CAIRN_PLUGIN_PATH"}
    environment.update(LD_LIBRARY_PATH=f"{tmp_path}:{environment.get('LD_LIBRARY_PATH', '')}", XDG_DATA_HOME=str(tmp_path))
    ended = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True)
    assert ended.returncode == 0, ended.stderr
    assert "nothing of kind 'optimizer' is on offer" in ended.stdout
    assert f"no plugin was found in {tmp_path / 'cairn'}, nor in the folders of CAIRN_PLUGIN_PATH" in ended.stdout


def test_values_of_options_are_written_as_on_the_command_line():
    assert cairn.spec("a", b=True, c=3, d=0.25, e="text", f=None) == "a:b=true,c=3,d=0.25,e=text"


def test_an_argument_that_is_not_there_gets_a_suggestion():
    graph, _ = cairn.generate("manhattan", poses=20)
    for call, message in [
        (lambda: cairn.optimize(graph, iterations=5), "optimize has no argument 'iterations', nor has levenberg_marquardt such an option; did you mean 'max_iterations'"),
        (lambda: cairn.optimize(graph, "dogleg", iteration_limit=5), "nor has dogleg such an option; did you mean 'max_iterations'"),
        (lambda: cairn.optimize(graph, initial_lamda=5), "has no option 'initial_lamda'; did you mean 'initial_lambda'"),
        (lambda: cairn.explore(cairn.generate_floor("rooms"), distance=5), "did you mean 'max_distance'"),
        (lambda: cairn.Estimator(keeps="last"), "Estimator has no argument 'keeps', nor has incremental_cholesky such an option; did you mean 'keep'"),
        (lambda: cairn.PosePolicy("compact_pose", trajectry=True), "did you mean 'trajectory'"),
        (lambda: cairn.draw({"graph": graph}, covariance={}), "did you mean 'covariances'"),
        (lambda: cairn.sparsify(graph, every=3), "did you mean 'keep_every'"),
    ]:
        with pytest.raises(cairn.Error, match=message):
            call()
