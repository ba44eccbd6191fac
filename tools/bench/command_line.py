# SPDX-License-Identifier: BSD-3-Clause
"""The command line behind `./dev bench`: studies are measured, or with --tables written into pages."""
from __future__ import annotations

import argparse
import json
import math
from pathlib import Path

from .data import Row, brief, files_of
from .pages import Sections, latex, put_into
from .program import TINY, Cairn, Failed
from .reports import Json, items, member, number, text
from .shown import SHOWN
from .studies import ALL
from .studies.minimum import Peer
from .study import Bench, Study, tell


def is_chosen(study: str, chosen: list[str]) -> bool:
    """Of a group of studies, such as compact_sets, the name before the underscore stands for all."""
    return not chosen or any(study == name or study.startswith(name + "_") for name in chosen)


def machine_and_build(report: Json) -> str:
    return (f"{text(report, 'machine.cpu')}, {number(report, 'machine.cores'):.0f} cores, {text(report, 'build.simd')}; "
            f"{text(report, 'build.compiler')}, `{text(report, 'build.flags')}`")


def provenance(report: Json) -> str:
    """"Measured on …", below each study's tables: they need not be of one day."""
    quick = "Quick run, not a measurement. " if member(report, "quick") is True else ""
    commit = text(report, "commit")
    return f"\n*{quick}{machine_and_build(report)}; {'commit ' + commit if commit else 'cairn ' + text(report, 'cairn')}.*\n"


def about(report: Json) -> Row:
    """The same, as columns that each row of a CSV ends with."""
    quick = " --quick" if member(report, "quick") is True else ""
    return {"command": f"./dev bench {text(report, 'study')}{quick}", "commit": text(report, "commit") or f"cairn {text(report, 'cairn')}",
            "machine": machine_and_build(report).replace("`", "")}


def finite(value: Json) -> Json:
    """JSON has no NaN."""
    if isinstance(value, dict):
        return {name: finite(one) for name, one in value.items()}
    if isinstance(value, list):
        return [finite(one) for one in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def measure(arguments: argparse.Namespace) -> None:
    bench = Bench(Cairn(arguments.cairn, arguments.folder / "work"), arguments.data, arguments.quick, arguments.ours,
                  arguments.rounds or (2 if arguments.quick else 5), arguments.peer)
    # Machine and build, as the program that is measured reports them.
    tiny = bench.cairn.optimize(TINY, ["--linear-solver", bench.ours]).required().report
    for study in ALL:
        if is_chosen(study.name, arguments.studies):
            report = {"study": study.name, "cairn": tiny["cairn"], "commit": arguments.commit, "quick": bench.quick,
                      "rounds": bench.rounds, "ours": bench.ours, "machine": tiny["machine"], "build": tiny["build"],
                      "entries": []}
            measure_study(study, bench, report, arguments.folder / f"{study.name}.json")


def measure_study(study: Study, bench: Bench, report: Json, file: Path) -> None:
    def keep(entry: Json) -> None:
        report["entries"].append(finite(entry))
        file.write_text(json.dumps(report, ensure_ascii=False) + "\n", encoding="utf-8")

    study.measure(bench, keep)


def write_tables(arguments: argparse.Namespace) -> None:
    """Of every study that there is a report of; the others' sections stay as they are."""
    if arguments.latex:
        arguments.latex.mkdir(parents=True, exist_ok=True)
    pages = [page.read_text(encoding="utf-8") for page in arguments.tables]
    for study in ALL:
        file = arguments.folder / f"{study.name}.json"
        if not file.exists():
            continue
        report = json.loads(file.read_text(encoding="utf-8", errors="replace"))
        sections = study.sections(items(report, "entries"))
        write_sections(sections, report, arguments.tables, pages)
        for name, markdown in sections.items():
            if arguments.latex and (tables := latex(markdown)):
                (arguments.latex / f"{name}.tex").write_text(tables, encoding="utf-8")
        for name, content in study.files(items(report, "entries")).items():
            (arguments.folder / name).write_text(content, encoding="utf-8")
    for page, content in zip(arguments.tables, pages):
        page.write_text(content, encoding="utf-8")
        tell(f"tables: {page}")


def write_sections(sections: Sections, report: Json, files: list[Path], pages: list[str]) -> None:
    """Each in short into the one of the pages that has a place for it, and in full into a folder `data` beside that."""
    for name, markdown in sections.items():
        shown = brief(name, markdown, SHOWN.get(name))
        only_a_link = shown.startswith("In full:") and shown.count("\n") == 1  # to what has all of it
        at = put_into(pages, name, shown if only_a_link else shown + provenance(report))
        folder = files[at].parent / "data"
        folder.mkdir(exist_ok=True)
        for file, content in files_of(name, markdown, about(report)).items():
            (folder / file).write_text(content, encoding="utf-8")


def parse(words: list[str]) -> argparse.Namespace:
    names = list(dict.fromkeys(name for study in ALL for name in [study.name.partition("_")[0], study.name]))
    parser = argparse.ArgumentParser(prog="bench", description="Measures the program cairn, one JSON file a study, and makes "
                                     "tables of those.", allow_abbrev=False)
    parser.add_argument("studies", nargs="*", metavar="STUDY", help="all, or some of: " + " ".join(names))
    parser.add_argument("--cairn", metavar="PROGRAM", help="the program to measure")
    parser.add_argument("--folder", type=Path, required=True, help="where the JSON is")
    parser.add_argument("--data", type=Path, metavar="FOLDER", help="of the real graphs")
    parser.add_argument("--commit", default="", help="what is measured, for the tables")
    parser.add_argument("--ours", default="block_cholesky", metavar="SPEC",
                        help="cairn's own linear solver, with options [block_cholesky]")
    parser.add_argument("--rounds", type=int, metavar="N", help="of each comparison [5, quick 2]")
    parser.add_argument("--peer", action="append", default=[], metavar="NAME=COMMAND",
                        help="minimum: another program, which is called with a g2o file and reports as cairn does")
    parser.add_argument("--quick", action="store_true", help="few and small graphs: shows that it works, no more")
    parser.add_argument("--check", action="store_true", help="only look at the arguments")
    parser.add_argument("--tables", type=Path, nargs="+", metavar="PAGE", help="do not measure: fill in the tables of these, and write them in full beside, as data/*.csv")
    parser.add_argument("--latex", type=Path, metavar="FOLDER", help="with --tables: the same tables in LaTeX too, a file NAME.tex each")
    arguments = parser.parse_intermixed_args(words)
    for name in arguments.studies:
        if name not in names:
            parser.error(f"there is no study '{name}'; there are: {' '.join(names)}")
    if arguments.latex and not arguments.tables and not arguments.check:
        parser.error("--latex needs --tables PAGE: it writes the tables that are filled in")
    if arguments.data and not arguments.data.is_dir():
        parser.error(f"--data {arguments.data}: there is no such folder")
    if not arguments.tables and not arguments.cairn and not arguments.check:
        parser.error("--cairn PROGRAM is needed to measure")
    for given in arguments.peer:
        try:
            Peer.of(given)
        except ValueError as error:
            parser.error(f"--peer: {error}")
    if arguments.rounds is not None and not 1 <= arguments.rounds <= 1000:
        parser.error("--rounds must be from 1 to 1000")
    return arguments


def main(words: list[str]) -> int:
    arguments = parse(words)
    if arguments.check:
        return 0
    try:
        arguments.folder.mkdir(parents=True, exist_ok=True)
        if arguments.tables:
            write_tables(arguments)
        else:
            measure(arguments)
    except (Failed, OSError, ValueError) as error:
        tell(f"bench: {error}")
        return 1
    except KeyboardInterrupt:  # what was measured is kept
        return 130
    return 0
