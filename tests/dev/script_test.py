# SPDX-License-Identifier: BSD-3-Clause
"""The script ./dev itself, without building anything: its help, and what it needs."""
import re
import subprocess
import unittest
from pathlib import Path

SOURCE = Path(__file__).resolve().parents[2]
SCRIPT = (SOURCE / "dev").read_text(encoding="utf-8")
HELP = (SOURCE / "tools/dev/help.txt").read_text(encoding="utf-8")


def dev(*words):
    """The exit code, standard output and standard error."""
    ended = subprocess.run([SOURCE / "dev", *words], cwd="/", capture_output=True, text=True, check=False)
    return ended.returncode, ended.stdout, ended.stderr


class Script(unittest.TestCase):
    def test_help_is_shown_before_anything_is_done(self):
        for words in [(), ("help",), ("--help",), ("-h",), ("test", "--help"), ("package", "--fresh", "-h")]:
            self.assertEqual(dev(*words), (0, HELP, ""))

    def test_an_unknown_command_is_refused_with_those_that_there_are(self):
        self.assertEqual(dev("astrology"), (2, "", f"./dev: no command 'astrology'\n\n{HELP}"))

    def test_each_command_is_explained(self):
        explained = re.findall(r"^  ([a-z-]+) ", HELP, re.MULTILINE)
        self.assertEqual(sorted(explained), sorted(re.findall(r"^do_([a-z-]+)\(\)", SCRIPT, re.MULTILINE)))

    def test_what_it_calls_is_there(self):
        called = set(re.findall(r"\b(?:tools|tests)/[\w/]+\.(?:py|sh|txt|supp)", SCRIPT))
        self.assertGreater(len(called), 10)
        self.assertEqual([name for name in called if not (SOURCE / name).is_file()], [])

    def test_each_purpose_has_packages(self):
        listed = (SOURCE / "tools/dev/packages.txt").read_text(encoding="utf-8")
        purposes = set(re.findall(r"^(\w+): \S", listed, re.MULTILINE))
        commands = re.sub("#.*", "", SCRIPT)
        asked = re.findall(r"\bneed ([a-z_ ]+)|\bready (?:'([a-z ]+)'|([a-z]+))|\bpackages ([a-z ]+)\)", commands)
        self.assertEqual({word for names in asked for word in " ".join(names).split()}, purposes)


if __name__ == "__main__":
    unittest.main()
