# SPDX-License-Identifier: BSD-3-Clause
"""Runs the Python of docs/python.md, and of the docstrings, as a reader would type it."""
import doctest
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

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


@pytest.mark.parametrize("page, least", [("getting_started", 10), ("coming_from", 8), ("tutorials", 18)])
def test_every_block_of_the_other_pages_runs(page, least, tmp_path):
    assert run(SOURCE / "docs" / f"{page}.md", tmp_path) >= least


@pytest.mark.parametrize(
    "page, results",
    [
        ("coming_from", {"out.g2o", "loops.g2o", "tree.g2o", "marginals.json", "incremental.g2o"}),
        ("getting_started", {"optimized.g2o", "compact.g2o", "sparse.g2o", "run.json"}),
        ("tutorials", {"my_distance", "my_optimizer", "online.g2o", "full.g2o", "sparse_optimized.g2o"}),
    ],
)
def test_the_commands_run(page, results, tmp_path):
    page = (SOURCE / "docs" / f"{page}.md").read_text(encoding="utf-8")
    commands = [line for block in re.findall(r"^```sh\n(.*?)^```$", page, re.MULTILINE | re.DOTALL) for line in block.splitlines()]
    assert len(commands) >= 7 and all(line.startswith("cairn ") for line in commands)
    for line in commands:
        command = [os.environ["CAIRN_PROGRAM"], *shlex.split(line)[1:]]
        ended = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
        assert ended.returncode == 0, f"{line}\n{ended.stdout}{ended.stderr}"
    assert results <= {path.name for path in tmp_path.iterdir()}


def test_the_block_of_the_readme_runs(tmp_path, capsys):
    assert run(SOURCE / "README.md", tmp_path) == 1
    printed = capsys.readouterr().out
    assert printed.count("converged: chi2") == 3 and "ATE" in printed and (tmp_path / "solved.g2o").exists()


def test_the_clients_of_the_service_run(tmp_path, capsys):
    page = (SOURCE / "docs" / "online.md").read_text(encoding="utf-8").replace("/run/cairn/", f"{tmp_path}/")
    (_, reader), (_, writer) = blocks(page)
    service = subprocess.Popen([os.environ["CAIRN_PROGRAM"], "online", "--quiet", "--listen", tmp_path / "robot.socket"])
    try:
        while not (tmp_path / "robot.socket").exists():
            assert service.poll() is None
        follower = subprocess.Popen([sys.executable, "-u", "-c", reader], stdout=subprocess.PIPE, text=True)
        assert follower.stdout.readline().startswith("FOLLOWS 0 ")
        exec(compile(writer, "online.md", "exec"), {})
    finally:
        service.terminate()
    assert service.wait() == 0
    printed = capsys.readouterr().out.splitlines()
    assert printed[0] == "['VERTEX_SE2', '1', '1', '0', '0.5']" and len(printed) == 4 and printed[3].startswith("['CHI2', ")
    followed, _ = follower.communicate()
    assert follower.returncode == 0
    assert [line for line in followed.splitlines() if line.startswith("UPDATE")] == [f"UPDATE {k}" for k in (4, 6, 8, 9)]


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
