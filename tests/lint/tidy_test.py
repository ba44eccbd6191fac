#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""tools/lint/tidy.py on small sources: what is clean, what is not, and files that cannot be checked together."""

import contextlib
import io
import json
import os
import shutil
import sys
import tempfile
import unittest
from pathlib import Path
from unittest import mock

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tools/lint"))
import tidy  # noqa: E402

CONFIGURATION = """Checks: '-*,clang-diagnostic-*,misc-redundant-expression,modernize-use-override'
WarningsAsErrors: '*'
HeaderFilterRegex: '/(lib)/[^ ]*\\.hpp$'
"""
WRONG = "int wrong(int a) { return a - a; }\n"
NO_OVERRIDE = "struct A { virtual ~A() = default; virtual void f() = 0; };\nstruct B : A { void f(); };\n"


class Tidy(unittest.TestCase):
    """A checkout with sources in lib/, compiled in build/."""

    def setUp(self) -> None:
        self.root = Path(self.enterContext(tempfile.TemporaryDirectory())).resolve()
        for folder in ("build/lint", "lib", "clean"):
            (self.root / folder).mkdir(parents=True)
        (self.root / ".clang-tidy").write_text(CONFIGURATION)
        self.entries: list[dict[str, str]] = []
        before = os.getcwd()
        os.chdir(self.root)
        self.addCleanup(os.chdir, before)

    def enterContext(self, manager):  # of unittest from Python 3.11 on
        value = manager.__enter__()
        self.addCleanup(manager.__exit__, None, None, None)
        return value

    def add(self, name: str, text: str, flags: str = "") -> None:
        file = self.root / "lib" / name
        file.write_text(text)
        if name.endswith(".cpp"):
            self.entries.append({"directory": str(self.root / "build"), "file": str(file),
                                 "command": f"/usr/bin/c++ -I{self.root}/lib -std=c++20 {flags} -o {name}.o -c {file}"})

    def run_on(self, *names: str) -> tuple[set[str], str, int]:
        """The names that are found clean, what is printed, and the exit code."""
        database = self.root / "build/lint/compile_commands.json"
        database.write_text(json.dumps(self.entries))
        for file in (self.root / "clean").iterdir():
            file.unlink()
        keys = {f"lib/{name}": f"key_of_{name}" for name in names}
        out = io.StringIO()
        with contextlib.redirect_stdout(out):
            code = tidy.check_all(database, self.root / "clean", keys)
        clean = {file.name.removeprefix("key_of_") for file in (self.root / "clean").iterdir()}
        return clean, out.getvalue(), code

    def runs_on(self, *names: str) -> tuple[int, set[str], str, int]:
        """How often clang-tidy ran, and the result of run_on."""
        with mock.patch.object(tidy.Linter, "_tidy", autospec=True, side_effect=tidy.Linter._tidy) as runs:
            result = self.run_on(*names)
        return runs.call_count, *result

    def test_sources_without_a_finding_are_clean(self) -> None:
        names = [f"right{k}.cpp" for k in range(tidy.TOGETHER + 3)]
        for k, name in enumerate(names):
            self.add(name, f"int right{k}() {{ return {k}; }}\n")
        self.assertEqual(self.runs_on(*names), (2, set(names), "", 0))

    def test_only_sources_that_are_asked_for_are_looked_at(self) -> None:
        self.add("right.cpp", "int right() { return 1; }\n")
        self.add("wrong.cpp", WRONG)
        self.assertEqual(self.run_on("right.cpp"), ({"right.cpp"}, "", 0))

    def test_one_wrong_source_is_named_and_the_others_are_clean(self) -> None:
        for k in range(5):
            self.add(f"right{k}.cpp", f"int right{k}() {{ return {k}; }}\n")
        self.add("wrong.cpp", WRONG)
        clean, output, code = self.run_on(*(f"right{k}.cpp" for k in range(5)), "wrong.cpp")
        self.assertEqual((clean, code), ({f"right{k}.cpp" for k in range(5)}, 1))
        self.assertIn("lib/wrong.cpp:1:", output)
        self.assertIn("misc-redundant-expression", output)

    def test_a_wrong_header_is_found(self) -> None:
        self.add("wrong.hpp", "#pragma once\ninline " + WRONG)
        self.add("user.cpp", '#include "wrong.hpp"\n')
        self.add("right.cpp", "int right() { return 1; }\n")
        clean, output, code = self.run_on("right.cpp", "user.cpp")
        self.assertEqual((clean, code), ({"right.cpp"}, 1))
        self.assertIn("lib/wrong.hpp:2:", output)

    def test_names_that_clash_are_no_finding(self) -> None:
        for k in range(4):
            self.add(f"clash{k}.cpp", f"namespace {{ int same() {{ return {k}; }} }}\nint clash{k}() {{ return same(); }}\n")
        names = {f"clash{k}.cpp" for k in range(4)}
        self.assertEqual(self.run_on(*names), (names, "", 0))

    def test_other_flags_are_other_groups(self) -> None:
        self.add("with.cpp", "#ifndef GIVEN\n#error not given\n#endif\n", "-DGIVEN")
        self.add("without.cpp", "#ifdef GIVEN\n#error given\n#endif\n")
        self.assertEqual(self.run_on("with.cpp", "without.cpp"), ({"with.cpp", "without.cpp"}, "", 0))

    def test_a_folder_may_leave_checks_out(self) -> None:
        self.add("other.cpp", NO_OVERRIDE)
        self.add("right.cpp", "int right() { return 1; }\n")
        self.add("wrong.cpp", WRONG)
        names = ("other.cpp", "right.cpp", "wrong.cpp")
        clean, output, _ = self.run_on(*names)
        self.assertEqual(clean, {"right.cpp"})
        self.assertIn("modernize-use-override", output)
        (self.root / "lib/.clang-tidy").write_text("InheritParentConfig: true\nChecks: '-modernize-use-override'\n")
        clean, output, _ = self.run_on(*names)
        self.assertEqual(clean, {"other.cpp", "right.cpp"})
        self.assertIn("misc-redundant-expression", output)

    def test_plugins_and_what_differs_in_places_alone_are_checked_together(self) -> None:
        for k in range(3):
            (self.root / f"lib/part{k}").mkdir()
            (self.root / f"lib/part{k}/header{k}.hpp").write_text("#pragma once\n")
            self.add(f"plugin{k}.cpp", f'#include "header{k}.hpp"\nextern "C" void cairn_plugin_v1() {{}}\n',
                     f"-I{self.root}/lib/part{k} -Dplugin{k}_EXPORTS -O{k} -fno-math-errno")
        names = {f"plugin{k}.cpp" for k in range(3)}
        self.assertEqual(self.runs_on(*names), (1, names, "", 0))

    def test_what_a_precompiled_header_hides_is_found(self) -> None:
        (self.root / "build/cmake_pch.hxx").write_text("#include <array>\n#include <map>\n#include <vector>\n")
        precompiled = f"-include {self.root}/build/cmake_pch.hxx"
        uses = "int {0}(const std::vector<int>& v) {{ return v[0]; }}\n"
        self.add("first.cpp", "#include <vector>\n" + uses.format("first"), precompiled)
        self.add("second.cpp", uses.format("second"), precompiled)
        clean, output, code = self.run_on("first.cpp", "second.cpp")
        self.assertEqual((clean, code), ({"first.cpp"}, 1), output)
        self.assertIn("lib/second.cpp:1:", output)
        # Neither may come after the other; the one without either may come before both.
        self.add("third.cpp", "#include <array>\nint third(const std::array<int, 1>& a) { return a[0]; }\n", precompiled)
        self.add("fourth.cpp", "int fourth() { return 4; }\n", precompiled)
        names = {"first.cpp", "third.cpp", "fourth.cpp"}
        self.assertEqual(self.runs_on(*names), (2, names, "", 0))

    def test_what_comes_with_a_precompiled_header_is_no_include(self) -> None:
        (self.root / "build/cmake_pch.hxx").write_text("#include <map>\n#include <regex>\n")
        precompiled = f"-include {self.root}/build/cmake_pch.hxx"
        self.add("first.cpp", "#include <cctype>\n#include <locale>\nbool first(char c) { return std::isspace(c, std::locale()); }\n", precompiled)
        self.add("second.cpp", "bool second(char c) { return std::isspace(c, std::locale()); }\n", precompiled)
        self.assertEqual(self.run_on("first.cpp", "second.cpp")[0], {"first.cpp"})

    def test_a_header_of_the_same_name_is_another_one(self) -> None:
        for name, text in (("first", "inline int f() { return 1; }\n"), ("second", "inline " + WRONG)):
            (self.root / "lib" / name).mkdir()
            (self.root / "lib" / name / "same.hpp").write_text("#pragma once\n" + text)
            self.add(f"{name}.cpp", f'#include "same.hpp"\nint {name}() {{ return 1; }}\n', f"-I{self.root}/lib/{name}")
        self.assertEqual(self.run_on("first.cpp", "second.cpp")[0], {"first.cpp"})

    def test_what_silences_the_compiler_does_so_in_one_source(self) -> None:
        self.add("first.cpp", '#pragma GCC diagnostic ignored "-Wunused-variable"\nvoid first() { int a = 1; }\n', "-Wall")
        self.add("second.cpp", "void second() { int b = 1; }\n", "-Wall")
        self.assertEqual(self.run_on("first.cpp", "second.cpp")[0], {"first.cpp"})

    def test_what_a_header_lacks_behind_a_precompiled_one_is_found(self) -> None:
        (self.root / "build/cmake_pch.hxx").write_text("#include <vector>\n")
        self.add("lacks.hpp", "#pragma once\ninline int lacking(const std::vector<int>& v) { return v[0]; }\n")
        self.add("user.cpp", '#include "lacks.hpp"\n', f"-include {self.root}/build/cmake_pch.hxx")
        self.add("a.cpp", "#include <vector>\n", f"-include {self.root}/build/cmake_pch.hxx")
        self.assertEqual(self.run_on("user.cpp", "a.cpp")[0], {"a.cpp"})

    def test_what_nothing_uses_in_a_source_is_found(self) -> None:
        self.add("right.cpp", "int right() { return 1; }\n")
        self.add("constant.cpp", "namespace { constexpr int kUnused = 3; }\n", "-Wall -Wunused-const-variable")
        self.add("other.cpp", "int other() { return 2; }\n", "-Wall -Wunused-const-variable")
        self.add("function.cpp", "namespace { inline int unused() { return 3; } }\n", "-Wall")
        self.add("another.cpp", "int another() { return 2; }\n", "-Wall")
        names = ("another.cpp", "constant.cpp", "function.cpp", "other.cpp", "right.cpp")
        clean, output, code = self.run_on(*names)
        self.assertEqual((clean, code), ({"another.cpp", "other.cpp", "right.cpp"}, 1))
        self.assertIn("lib/constant.cpp:1:", output)
        self.assertIn("lib/function.cpp:1:", output)

    def test_a_source_within_a_source_is_found(self) -> None:
        self.add("part.cpp", "int part() { return 1; }\n")
        self.add("whole.cpp", '#include "part.cpp"\n')
        self.add("right.cpp", "int right() { return 1; }\n")
        self.entries = [entry for entry in self.entries if "part.cpp" not in entry["file"]]
        (self.root / ".clang-tidy").write_text(CONFIGURATION.replace("-*,", "-*,bugprone-suspicious-include,", 1))
        clean, output, code = self.run_on("right.cpp", "whole.cpp")
        self.assertEqual((clean, code), ({"right.cpp"}, 1))
        self.assertIn("bugprone-suspicious-include", output)


if __name__ == "__main__":
    if not shutil.which("clang-tidy"):
        print("clang-tidy is not installed")
        sys.exit(77)
    unittest.main()
