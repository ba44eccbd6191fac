# SPDX-License-Identifier: BSD-3-Clause
"""What tools/docs/stage.py gathers for Sphinx, and that it finds links that lead nowhere."""
import json
import os
import re
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

SOURCE = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(SOURCE / "tools" / "docs"))

import headers  # noqa: E402
import python_names  # noqa: E402
import stage  # noqa: E402

PROGRAM = os.environ["CAIRN_PROGRAM"]


class TheWholeStage(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.place = tempfile.TemporaryDirectory()
        cls.folder = Path(cls.place.name) / "source"
        cls.ended = subprocess.run(
            [sys.executable, SOURCE / "tools" / "docs" / "stage.py", cls.folder, "--cairn", PROGRAM], capture_output=True, text=True
        )

    @classmethod
    def tearDownClass(cls):
        cls.place.cleanup()

    def test_every_link_leads_somewhere_and_every_page_is_in_the_navigation(self):
        self.assertEqual((self.ended.returncode, self.ended.stderr), (0, ""))
        for page in (SOURCE / "docs").glob("*.md"):
            self.assertTrue(page.name == "index.md" or (self.folder / "docs" / page.name).exists(), page)
        index = (self.folder / "index.md").read_text()
        for name in ["docs/getting_started", "docs/glossary", "README", "CHANGELOG", "components/index", "components/optimizer", "commands"]:
            self.assertRegex(index, rf"(?m)^{name}$")

    def test_components_have_their_options(self):
        listed = subprocess.run([PROGRAM, "plugins", "dogleg", "--json", "-"], capture_output=True, text=True, check=True)
        (dogleg,) = json.loads(listed.stdout)["offers"]
        page = (self.folder / "components" / "optimizer.md").read_text()
        section = re.search(r"(?ms)^## dogleg$(.*?)(^## |\Z)", page).group(1)
        self.assertTrue(dogleg["options"])
        for option in dogleg["options"]:
            self.assertIn(f"| `{option['name']}` | {option['type']} |", section)

    def test_every_kind_has_a_page(self):
        listed = subprocess.run([PROGRAM, "plugins", "--json", "-"], capture_output=True, text=True, check=True)
        for kind in {offer["kind"] for offer in json.loads(listed.stdout)["offers"]}:
            self.assertTrue((self.folder / "components" / f"{kind}.md").exists(), kind)

    def test_commands_show_their_help(self):
        page = (self.folder / "commands.md").read_text()
        for command in ["optimize", "compact", "online", "new-plugin"]:
            self.assertRegex(page, rf"(?m)^## cairn {command}$")
        self.assertIn("--linear-solver", page)


class Links(unittest.TestCase):
    def setUp(self):
        self.place = tempfile.TemporaryDirectory()
        self.addCleanup(self.place.cleanup)
        self.stage = stage.Stage(Path(self.place.name))

    def link(self, text):
        return stage.LINK.sub(lambda match: self.stage.link(match, SOURCE / "docs" / "python.md"), text)

    def test_those_to_pages_stay(self):
        for text in ["[guide](cpp.md)", "[guide](cpp.md#a-graph)", "[`code`](../README.md)", "[below](#arrays)", "[far](https://example.org/a.md)"]:
            self.assertEqual(self.link(text), text)
        self.assertEqual(self.stage.wrong, [])

    def test_files_come_along_and_folders_become_text(self):
        self.assertEqual(self.link("[log](../examples/python/ranges.py)"), "[log](../examples/python/ranges.py)")
        self.assertTrue((self.stage.folder / "examples" / "python" / "ranges.py").exists())
        self.assertEqual(self.link("see [`examples`](../examples)."), "see `examples`.")

    def test_those_to_nothing_are_found(self):
        self.assertEqual(self.link("[gone](gone.md)"), "gone")
        self.assertEqual(self.link("[outside](../../elsewhere.md)"), "outside")
        self.assertEqual(len(self.stage.wrong), 2)
        self.assertIn("docs/python.md: gone.md is not there", self.stage.wrong)


    def test_those_to_headings_that_there_are_not_are_found(self):
        for text in ["[guide](cpp.md#no-such-heading)", "[below](#no-such-heading)"]:
            self.assertEqual(self.link(text), text)
        expected = ["docs/python.md: cpp.md has no heading for #no-such-heading", "docs/python.md: python.md has no heading for #no-such-heading"]
        self.assertEqual(self.stage.wrong, expected)

    def test_headings_have_the_anchors_of_a_forge(self):
        text = "# One `two`: [three](x.md)!\n## Same\n## Same\n```sh\n# no heading\n```\n<a id=\"named\"></a>\n### Λ and x_1 – far\n"
        self.assertEqual(stage.anchors(text), {"one-two-three", "same", "same-1", "named", "λ-and-x_1--far"})


class Gallery(unittest.TestCase):
    def test_each_picture_is_drawn_by_a_command_of_the_page_and_is_there(self):
        text = (SOURCE / "docs" / "gallery.md").read_text(encoding="utf-8")
        commands = "\n".join(re.findall(r"^```sh\n(.*?)^```$", text, re.MULTILINE | re.DOTALL))
        drawn = re.findall(r"^cairn plot .* -o (\S+)$", commands, re.MULTILINE)
        self.assertEqual(re.findall(r"^!\[.+\]\(images/(\S+)\)$", text, re.MULTILINE), drawn)
        self.assertGreaterEqual(len(drawn), 9)
        for picture in drawn:
            self.assertTrue((SOURCE / "docs" / "images" / picture).exists(), picture)


class Docstrings(unittest.TestCase):
    def test_arguments_become_a_list_and_examples_code(self):
        text = python_names.prose("Does it.\n\n    x = f(1)\n\nname: what\n    it is\nother: this\n")
        self.assertEqual(text, "Does it.\n\n```python\nx = f(1)\n```\n\n- `name`: what\n  it is\n- `other`: this")

    def test_overloads_are_taken_apart(self):
        doc = "add(*args, **kwargs)\nOverloaded function.\n\n1. add(self: cairn.Graph, id: int) -> int\n\nOne.\n\n2. add(self: cairn.Graph, x: cairn._cairn.Factor) -> int\n\nTwo."
        self.assertEqual(python_names.split(doc), [("add(id: int) -> int", "One."), ("add(x: Factor) -> int", "Two.")])


class Headers(unittest.TestCase):
    def test_the_layers_are_those_of_the_sources(self):
        for part, name, folder in headers.folders(SOURCE):
            self.assertTrue(any(folder.glob("*.hpp")), folder)
        layers = {path.name for path in (SOURCE / "core" / "include" / "cairn").iterdir()}
        self.assertEqual(set(headers.LAYERS), layers)


if __name__ == "__main__":
    unittest.main()
