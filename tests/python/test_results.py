# SPDX-License-Identifier: BSD-3-Clause
"""Results have their figures as attributes, from the fields that they declare in C++, and the stubs name all of them."""
import ast
from pathlib import Path

import cairn
import result_sample


def test_a_figure_that_is_added_is_an_attribute():
    grown = result_sample.GrownSample()
    assert grown.spread == 0.125
    assert type(grown).spread.__doc__ == "Of the positions [m]."
    grown.spread_member = 2.0
    assert grown.spread == 2.0
    assert not hasattr(result_sample.Sample(), "spread")


def test_attributes_have_the_values_and_the_help_of_their_fields():
    sample = result_sample.Sample()
    assert sample.error == 1 / 3 and sample.good is True and sample.name == 'city, "large"'
    assert sample.counts == {"kept_loops": 7, "loops": 14}
    assert sample.margin is None and sample.check == {"total": None, "solve": None}
    assert sample.seconds == {"total": 1.5, "solve": 0.25} and sample.runs == [sample.seconds] * 2
    assert sample.verdicts == {"linked": 3}
    assert type(sample).error.__doc__ == "Root mean square, after alignment [m]."
    assert type(sample).seconds.__doc__ == "A dict:\ntotal: of all [s]\nsolve: solving [s]"


def test_the_stubs_have_every_figure():
    stub = ast.parse(Path(cairn.__file__).with_name("__init__.pyi").read_text())
    classes = {node.name: node for node in stub.body if isinstance(node, ast.ClassDef)}

    def names(node):
        own = {member.name for member in node.body if isinstance(member, ast.FunctionDef)}
        return own.union(*(names(classes[base.id]) for base in node.bases if getattr(base, "id", "") in classes))

    lines = []
    for cls in vars(cairn).values():
        types = getattr(cls, "_result_types", {}) if isinstance(cls, type) else {}
        for name in sorted(set(types) - names(classes[cls.__name__]) if types else []):
            lines.append(f"class {cls.__name__}:\n    @property\n    def {name}(self) -> {types[name]}: ...")
    assert not lines, "apps/python/cairn/__init__.pyi lacks\n" + "\n".join(lines)
