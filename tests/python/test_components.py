# SPDX-License-Identifier: BSD-3-Clause
import math

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


def test_values_of_options_are_written_as_on_the_command_line():
    assert cairn.spec("a", b=True, c=3, d=0.25, e="text", f=None) == "a:b=true,c=3,d=0.25,e=text"
