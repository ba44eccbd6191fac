# SPDX-License-Identifier: BSD-3-Clause
"""The search for silent failures: `./dev silent` (docs/reliability.md).

Random worlds, and the graphs of a folder with other states and fewer measurements, are optimised with default settings; each
result is held against the best of other starts, another optimizer and the truth."""
from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import sys
import time
from collections import Counter
from typing import Dict, Iterable, List, Optional, Tuple

import cairn
from known import known_graphs, known_world
from trial import FINDINGS, Verdict, judge
from worlds import KINDS, draw

Job = Tuple[str, int, Optional[str], bool, str]


def tried(job: Job) -> Verdict:
    kind, seed, initial, alone, folder = job
    try:
        world = known_world(folder, seed) if kind == "known" else draw(kind, seed)
    except cairn.Error as error:
        return Verdict(kind, seed, "error", f"while the world is made: {error}")
    try:
        return judge(kind, seed, world, initial, alone)
    except Exception as error:  # of any kind: a finding
        return Verdict(kind, seed, "error", f"{world.name}: {type(error).__name__}: {error}")


def jobs_of(arguments: argparse.Namespace) -> List[Job]:
    kinds = [arguments.kind] if arguments.kind else list(KINDS) + (["known"] if known_graphs(arguments.data) else [])
    share = {kind: 1.0 if arguments.kind else (KINDS[kind][1] if kind in KINDS else 0.02) for kind in kinds}
    total = sum(share.values())
    jobs: List[Job] = []
    for kind in kinds:
        count = max(1, round(arguments.count * share[kind] / total))
        jobs += [(kind, arguments.seed + k, arguments.initial or None, arguments.alone, arguments.data) for k in range(count)]
    return jobs


def single_thread() -> None:
    cairn.set_threads(1)


def run(jobs: List[Job], processes: int) -> Iterable[Verdict]:
    """Verdicts in the order of the jobs. A process that ends is a finding of the job that it was at."""
    context = multiprocessing.get_context("spawn")
    with context.Pool(processes, initializer=single_thread, maxtasksperchild=2000) as pool:
        results = [(job, pool.apply_async(tried, (job,))) for job in jobs]
        for job, result in results:
            try:
                yield result.get(timeout=600)
            except multiprocessing.TimeoutError:
                yield Verdict(job[0], job[1], "error", "no result after 600 s, or the process has ended")


def table(verdicts: List[Verdict]) -> str:
    rows = ["| kind | graphs | silent | of these only the truth is below | false doubts | doubts | of these right | not converged | errors |",
            "| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |"]
    for kind in [*KINDS, "known"]:
        of_kind = [v for v in verdicts if v.kind == kind]
        if not of_kind:
            continue
        count = Counter(v.finding for v in of_kind)
        doubted = [v for v in of_kind if v.doubts]
        right = sum(v.doubt_is_right for v in doubted)
        only = sum(v.only_the_truth for v in of_kind if v.finding == "silent")
        rate = 100.0 * count["silent"] / len(of_kind)
        rows.append(f"| {kind} | {len(of_kind)} | {count['silent']} ({rate:.2f} %) | {only} | {count['false']} | {len(doubted)} | {right} | {count['not converged']} | {count['error']} |")
    return "\n".join(rows)


def on_doubts(verdicts: List[Verdict]) -> str:
    """What is asked of doubts: how many are right, and how many ordinary graphs carry one that is not."""
    doubted = [v for v in verdicts if v.doubts]
    right = sum(v.doubt_is_right for v in doubted)
    ordinary = [v for v in verdicts if v.kind == "ordinary"]
    false = sum(v.finding == "false" for v in ordinary)
    return (f"doubts: {right} of {len(doubted)} right ({100.0 * right / max(1, len(doubted)):.1f} %); "
            f"ordinary graphs with one that is not: {false} of {len(ordinary)} ({100.0 * false / max(1, len(ordinary)):.2f} %)")


def shown(verdict: Verdict) -> str:
    lines = [f"{verdict.finding}: --kind {verdict.kind} --seed {verdict.seed} --count 1: {verdict.name}",
             f"  chi2 {verdict.chi2:.8g}, best {verdict.best:.8g} from {verdict.best_from}"]
    lines += [f"  note: {note}" for note in verdict.notes]
    return "\n".join(lines)


def main(words: Optional[List[str]] = None) -> int:
    parser = argparse.ArgumentParser(prog="./dev silent", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter,
                                     epilog="findings: " + "; ".join(f"{name}: {text}" for name, text in FINDINGS.items()))
    parser.add_argument("count", nargs="?", type=int, default=1000, help="graphs in all [1000]")
    parser.add_argument("--kind", choices=[*KINDS, "known"], help="graphs of this kind alone")
    parser.add_argument("--seed", type=int, default=1, help="of the first graph of each kind [1]")
    parser.add_argument("--alone", action="store_true", help="no other optimisation: chi2 is held against that at the truth")
    parser.add_argument("--initial", default="auto", help="the start that is tried, instead of the default's; '': as given")
    parser.add_argument("--data", default=os.environ.get("CAIRN_DATA", ""), help="folder of known graphs [CAIRN_DATA]")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="processes")
    parser.add_argument("--json", help="write every verdict to this file, one a line")
    parser.add_argument("--quiet", action="store_true", help="the table alone")
    arguments = parser.parse_args(words)

    begin, verdicts = time.monotonic(), []
    jobs = jobs_of(arguments)
    out = open(arguments.json, "w", encoding="utf-8") if arguments.json else None
    for verdict in run(jobs, arguments.jobs):
        verdicts.append(verdict)
        if out:
            print(json.dumps(vars(verdict)), file=out, flush=True)
        if verdict.finding not in ("", "not converged") and not arguments.quiet:
            print(shown(verdict), flush=True)
        if not arguments.quiet and len(verdicts) % 100 == 0:
            print(f"{len(verdicts)} of {len(jobs)} graphs, {time.monotonic() - begin:.0f} s", file=sys.stderr, flush=True)
    print(table(verdicts))
    if not arguments.alone:
        print("\n" + on_doubts(verdicts))
    return 1 if any(v.finding in ("silent", "false", "error") for v in verdicts) else 0


if __name__ == "__main__":
    sys.exit(main())
