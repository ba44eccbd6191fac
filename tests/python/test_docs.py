# SPDX-License-Identifier: BSD-3-Clause
"""Runs the Python of docs/python.md, and of the docstrings, as a reader would type it."""
import doctest
import os
import re
from pathlib import Path

import cairn

# Plots are drawn without a screen.
os.environ.setdefault("MPLBACKEND", "Agg")
SOURCE = Path(__file__).resolve().parents[2]


def blocks(text):
    """The fenced blocks of Python, each with the number of its first line."""
    for match in re.finditer(r"^```python\n(.*?)^```$", text, re.MULTILINE | re.DOTALL):
        yield text.count("\n", 0, match.start(1)) + 1, match.group(1)


def run(page, folder):
    """Runs all blocks one after the other in one session, and returns how many examples there were."""
    before = os.getcwd()
    os.chdir(folder)
    try:
        session, examples, report = {}, 0, []
        runner = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE)
        for line, block in blocks(page.read_text(encoding="utf-8")):
            if ">>>" in block:
                test = doctest.DocTestParser().get_doctest(block, session, page.name, str(page), line - 1)
                runner.run(test, out=report.append, clear_globs=False)
                session = test.globs
                examples += len(test.examples)
            else:
                exec(compile("\n" * (line - 1) + block, str(page), "exec"), session)
                examples += 1
        assert runner.failures == 0, "".join(report)
        return examples
    finally:
        os.chdir(before)


def test_every_block_of_the_guide_runs(tmp_path):
    assert run(SOURCE / "docs" / "python.md", tmp_path) >= 20


def test_the_block_of_the_readme_runs(tmp_path, capsys):
    assert run(SOURCE / "README.md", tmp_path) == 1
    printed = capsys.readouterr().out
    assert printed.count("converged: chi2") == 3 and "ATE" in printed and (tmp_path / "solved.g2o").exists()


def test_a_wrong_block_is_found(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("# Page\n\n```python\n>>> 1 + 1\n3\n\n```\n")
    try:
        run(page, tmp_path)
    except AssertionError as error:
        assert 'page.md", line 4' in str(error) and "Expected:" in str(error)
    else:
        raise AssertionError("nothing was found")


def test_the_guide_names_everything_public():
    text = (SOURCE / "docs" / "python.md").read_text(encoding="utf-8")
    missing = [name for name in cairn.__all__ if not re.search(rf"\b{re.escape(name)}\b", text)]
    # What is returned by what the guide shows has a docstring of its own.
    assert set(missing) <= {"CompactResult", "Component", "Option", "SparsifyResult", "Summary", "TrajectoryError", "UpdateReport", "__version__"}, missing
