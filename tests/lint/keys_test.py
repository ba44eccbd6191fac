# SPDX-License-Identifier: BSD-3-Clause
"""tools/lint/keys.py and lint.py: what changes the keys of which sources, and what is done with them."""

import contextlib
import io
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
import unittest
from pathlib import Path
from unittest import mock

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tools/lint"))
import keys  # noqa: E402
import lint  # noqa: E402

FILES = {
    ".clang-tidy": "Checks: '*'\n",
    "tools/lint/tidy.py": "TOGETHER = 16\n",
    "lib/part/include/part/base.hpp": "#pragma once\n",
    "lib/part/include/part/derived.hpp": '#pragma once\n#include "part/base.hpp"\n',
    "lib/other/base.hpp": "#pragma once\n",
    "lib/part/src/first.cpp": '#include "part/derived.hpp"\n',
    "lib/part/src/second.cpp": '#include <vector>\n  #  include "../include/part/base.hpp"\n',
    "lib/part/src/third.cpp": '#include "base.hpp"\n#include "round.hpp"\n',
    "lib/part/src/round.hpp": '#pragma once\n#include "round.hpp"\n',
    "lib/part/src/alone.cpp": '// "part/base.hpp"\n#include <part/base.hpp>\n',
    "lib/part/src/not_compiled.cpp": "",
}
COMPILED = [name for name in FILES if name.endswith(".cpp") and "not_compiled" not in name]
FIRST, SECOND, THIRD, ALONE = (f"lib/part/src/{name}.cpp" for name in ("first", "second", "third", "alone"))


class Checkout(unittest.TestCase):
    """Sources in a repository of git, in which nothing is committed yet."""

    def setUp(self) -> None:
        self.root = self.checkout()

    def checkout(self) -> Path:
        place = tempfile.TemporaryDirectory()
        self.addCleanup(place.cleanup)
        root = Path(place.name).resolve()
        subprocess.run(["git", "init", "-q", root], check=True)
        for name, text in FILES.items():
            (root / name).parent.mkdir(parents=True, exist_ok=True)
            (root / name).write_text(text)
        return root

    def database(self, root: Path, flags: str = "-O2") -> str:
        files = [f"{root}/{name}" for name in [*COMPILED, "build/written_by_cmake.cpp"]]
        entries = [{"directory": f"{root}/build", "command": f"c++ {flags} -I{root}/lib -c {file}", "file": file} for file in files]
        return json.dumps(entries, indent=2)


class Keys(Checkout):
    def keys(self, tools: bytes = b"14") -> dict[str, str]:
        return keys.keys_of(self.root, self.database(self.root), tools)

    def changed_by(self, name: str, text: str = "// changed\n") -> set[str]:
        """The sources whose key changes with a file."""
        before = self.keys()
        (self.root / name).parent.mkdir(parents=True, exist_ok=True)
        with (self.root / name).open("a") as file:
            file.write(text)
        after = self.keys()
        self.assertEqual(list(before), list(after))
        return {source for source in before if before[source] != after[source]}

    def test_each_source_that_is_compiled_has_a_key_of_its_own(self) -> None:
        found = self.keys()
        self.assertEqual(list(found), sorted(COMPILED))
        self.assertEqual(len(set(found.values())), len(COMPILED))

    def test_a_source_changes_its_own_key(self) -> None:
        self.assertEqual(self.changed_by(FIRST), {FIRST})
        self.assertEqual(self.changed_by("lib/part/src/not_compiled.cpp"), set())

    def test_a_header_changes_the_keys_of_what_may_include_it(self) -> None:
        # That third.cpp means the other one is not known here.
        self.assertEqual(self.changed_by("lib/part/include/part/base.hpp"), {FIRST, SECOND, THIRD})
        self.assertEqual(self.changed_by("lib/part/include/part/derived.hpp"), {FIRST})
        self.assertEqual(self.changed_by("lib/other/base.hpp"), {THIRD})
        self.assertEqual(self.changed_by("lib/part/src/round.hpp"), {THIRD})

    def test_what_moves_as_it_is_keeps_its_key(self) -> None:
        before = self.keys()
        (self.root / "lib").rename(self.root / "plugins")
        database = self.database(self.root).replace("/lib/", "/plugins/").replace("-I", "-isystem /usr/include/eigen3 -I")
        after = keys.keys_of(self.root, database, b"14")
        self.assertEqual({name.replace("lib/", "plugins/", 1): key for name, key in before.items()}, after)

    def test_a_new_header_of_the_same_ending_does_so_too(self) -> None:
        self.assertEqual(self.changed_by("lib/new/part/derived.hpp"), {FIRST})
        self.assertEqual(self.changed_by("lib/new/unheard_of.hpp"), set())

    def test_the_checks_and_the_linter_change_all(self) -> None:
        for name in (".clang-tidy", "lib/part/.clang-tidy", "tools/lint/tidy.py", "tools/lint/more.txt"):
            self.assertEqual(self.changed_by(name), set(COMPILED), name)
        self.assertEqual(self.changed_by("tools/other.py"), set())
        self.assertEqual(self.changed_by("tools/lint/__pycache__/tidy.cpython-311.pyc"), set())

    def test_other_versions_change_all(self) -> None:
        before, after = self.keys(b"14"), self.keys(b"15")
        self.assertFalse(set(before.values()) & set(after.values()))
        self.assertIn(b"version", keys.versions([]))

    def test_other_flags_change_the_keys_of_what_is_compiled_with_them(self) -> None:
        before = self.keys()
        of_second = f"-I{self.root}/lib -c {self.root}/{SECOND}"
        database = self.database(self.root).replace(f"-O2 {of_second}", f"-O3 {of_second}")
        after = keys.keys_of(self.root, database, b"14")
        self.assertEqual({source for source in before if before[source] != after[source]}, {SECOND})

    def test_another_checkout_has_the_same_keys(self) -> None:
        other = self.checkout()
        self.assertEqual(keys.keys_of(other, self.database(other), b"14"), self.keys())

    def test_a_file_that_is_gone_is_no_file(self) -> None:
        subprocess.run(["git", "-C", self.root, "add", "."], check=True)
        (self.root / ALONE).unlink()
        self.assertEqual(list(self.keys()), sorted({*COMPILED} - {ALONE}))


class Lint(Checkout):
    """The program, with a clang-tidy that has a finding in third.cpp."""

    def setUp(self) -> None:
        super().setUp()
        self.cache = self.root / "cache"
        (self.root / "build/release").mkdir(parents=True)
        (self.root / "build/release/compile_commands.json").write_text(self.database(self.root, "-Werror -O2 -fpch-preprocess"))
        self.addCleanup(os.chdir, os.getcwd())
        os.chdir(self.root)

    def lint(self, *files: str) -> tuple[int, str, set[str]]:
        """The exit code, what is said, and which sources clang-tidy sees."""
        seen: set[str] = set()

        def check(_database: Path, clean: Path, found: dict[str, str]) -> int:
            seen.update(found)
            for file, key in found.items():
                if file != THIRD:
                    (clean / key).touch()
            return 1 if THIRD in found else 0

        said = io.StringIO()
        with mock.patch.object(lint.tidy, "check_all", check), contextlib.redirect_stderr(said), \
                mock.patch.dict(os.environ, XDG_CACHE_HOME=str(self.cache)):
            code = lint.main(["--packages", "git", "--", *files])
        return code, said.getvalue(), seen

    def test_what_was_found_clean_is_not_looked_at_again(self) -> None:
        self.assertEqual(self.lint(), (1, "lint: clang-tidy on 4 of 4 files\n", set(COMPILED)))
        self.assertEqual(self.lint(), (1, "lint: clang-tidy on 1 of 4 files\n", {THIRD}))
        (self.root / FIRST).write_text("// changed\n")
        self.assertEqual(self.lint(FIRST, ALONE), (0, "lint: clang-tidy on 1 of 2 files\n", {FIRST}))
        self.assertEqual(self.lint(FIRST, "nothing.cpp"), (0, "lint: clang-tidy on 0 of 1 files\n", set()))

    def test_flags_that_clang_does_not_know_are_left_out(self) -> None:
        self.lint()
        database = (self.root / "build/lint/compile_commands.json").read_text()
        self.assertEqual(database, self.database(self.root, "-O2"))
        lines = (self.root / "build/lint/keys").read_text().splitlines()
        self.assertEqual([line.split()[1] for line in lines], sorted(COMPILED))

    def test_what_nobody_asks_for_is_forgotten(self) -> None:
        self.lint()
        folder = self.cache / "cairn/lint"
        for age, name in ((59, "recent"), (62, "old")):
            (folder / name).touch()
            os.utime(folder / name, (time.time() - age * 86400,) * 2)
        used = next(folder.glob("[0-9a-f]*[0-9a-f]"))
        os.utime(used, (time.time() - 62 * 86400,) * 2)
        self.lint()
        self.assertTrue(used.exists() and (folder / "recent").exists())
        self.assertFalse((folder / "old").exists())


if __name__ == "__main__":
    if not shutil.which("git") or not shutil.which("clang-tidy"):
        print("git or clang-tidy is not installed")
        sys.exit(77)
    unittest.main()
