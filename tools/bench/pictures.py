# SPDX-License-Identifier: BSD-3-Clause
"""Draws by `cairn plot` what studies have left in a folder:

    python3 -m bench.pictures CAIRN FOLDER IMAGES

Of what a folder does not have, the pictures in IMAGES stay as they are.
"""
from __future__ import annotations

import argparse
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

EXPLORERS = ("frontier", "heuristic", "ede_gradient", "ede_rrt_star", "drrt_star", "errt_star")
TREES = ("drrt_star", "errt_star")  # explorers whose trees are drawn
DECISION = 34  # at this decision, or at the last one of a shorter run


@dataclass(frozen=True)
class Plotter:
    """`cairn plot` with a folder for what it draws."""

    cairn: str
    images: Path

    def plot(self, image: str, inputs: Sequence[Path], *options: str) -> None:
        """Raises CalledProcessError if nothing was drawn."""
        subprocess.run([self.cairn, "plot", *map(str, inputs), *options, "-o", str(self.images / image), "--quiet"], check=True)


def named(names: Sequence[str]) -> list[str]:
    """The options that name what is drawn."""
    return [word for name in names for word in ("--name", name)]


def draw_performance(plotter: Plotter, folder: Path) -> None:
    """Reports of `cairn bench` and `cairn online` themselves."""
    for file, image, options in [
        ("graphs_picture.json", "performance_graphs.svg", ("--what", "bars", "--size", "900x2000")),
        ("scaling_picture.json", "performance_scaling.svg", ("--what", "scaling", "--size", "900x380")),
        ("online_picture.json", "online_steps.svg", ("--what", "steps", "--size", "900x420")),
        ("compact_growth_picture.json", "compact_growth.svg", ("--what", "scaling", "--size", "900x380")),
    ]:
        if (folder / file).is_file():
            plotter.plot(image, [folder / file], *options)


def draw_gain(plotter: Plotter, folder: Path) -> None:
    """What a threshold of the compact graph costs and saves."""
    if (folder / "compact_gain.csv").is_file():
        plotter.plot("compact_gain.svg", [folder / "compact_gain.csv"], "--y", "loop closures kept*", "--y", "ATE over*",
                     "--x-max", "2.9", "--log", "y", "--size", "900x420")


def draw_compact_maps(plotter: Plotter, work: Path) -> None:
    """Maps of the study compact_figures."""
    for map_of_all in sorted(work.glob("figure_*_apal.g2o")):
        draw_compact_map(plotter, work, map_of_all.name.removeprefix("figure_").removesuffix("_apal.g2o"))
    if (work / "recovery_v0_detail.g2o").is_file():
        draw_recovery(plotter, work)


def draw_compact_map(plotter: Plotter, work: Path, name: str) -> None:
    """One map, as a picture of vectors where it is small."""
    def of(what: str) -> Path:
        return work / f"figure_{name}_{what}"

    ending = "png"
    if of("norms.csv").is_file():
        ending = "svg"
        plotter.plot(f"compact_norms_{name}.svg", [of("norms.csv")], "--y", "marginal*", "--y", "full*", "--log", "y",
                     "--size", "900x360")
        plotter.plot(f"compact_ellipses_{name}.svg", [of("fpfl.g2o"), of("fpfl.json")], "--poses", "--ellipses", "3",
                     "--size", "700x500", "--name", "few poses, few loop closures")
    plotter.plot(f"compact_map_{name}.{ending}", [of("apal.g2o"), of("apfl.g2o"), of("fpfl.g2o")], "--apart", "--poses",
                 "--size", "900x700", *named(["all poses, all loop closures", "all poses, few loop closures", "few of both"]))


def draw_recovery(plotter: Plotter, work: Path) -> None:
    """Three ways to recover the poses that a compact graph does not have, and a detail of them."""
    versions = ["v0", "v1", "v2"]
    truth, detail = [], []
    if (work / "recovery_truth.g2o").is_file():
        truth = ["--truth", str(work / "recovery_truth.g2o")]
        detail = ["--truth", str(work / "recovery_truth_detail.g2o")]
    plotter.plot("compact_recovery.png", [work / f"recovery_{version}.g2o" for version in versions], *truth, *named(versions),
                 "--size", "900x600")
    plotter.plot("compact_recovery_detail.svg", [work / f"recovery_{version}_detail.g2o" for version in versions], *detail,
                 *named(versions), "--poses", "--size", "900x500")


def draw_sparsification(plotter: Plotter, folder: Path) -> None:
    """Divergences of the studies of sparsification, and a whole graph before and after."""
    work, lines = folder / "work", ("--y", "*@3", "--y", "*@6")
    if (work / "sparsify_iterations.csv").is_file():
        plotter.plot("sparsify_iterations.svg", [work / "sparsify_iterations.csv"], *lines, "--x-max", "30", "--log", "y",
                     "--size", "900x420")
        plotter.plot("sparsify_times.svg", [work / "sparsify_times.csv"], *lines, "--log", "xy", "--size", "900x380")
    if (work / "sparsify_original.g2o").is_file():
        plotter.plot("sparsify_result.png", [work / "sparsify_whole.g2o"], "--truth", str(work / "sparsify_original.g2o"),
                     "--name", "one of five poses", "--size", "900x600")
    if (folder / "sparsify_example.csv").is_file():
        plotter.plot("sparsify_example.svg", [folder / "sparsify_example.csv"], "--y", "KLD*", "--log", "y", "--size", "900x420")


def draw_exploration(plotter: Plotter, work: Path) -> None:
    """Mean curves of the studies of exploration, and maps of explore_figures."""
    for part in ("cave", "freiburg", "action"):
        curves = {name: work / f"explore_{part}_{name}.csv" for name in EXPLORERS}
        curves = {name: file for name, file in curves.items() if file.is_file()}
        if curves:
            files, names = list(curves.values()), named(list(curves))
            plotter.plot(f"explore_{part}_entropies.svg", files, *names, "--x", "distance", "--y", "map_entropy *",
                         "--y", "trajectory_entropy *", "--size", "900x420")
            plotter.plot(f"explore_{part}_errors.svg", files, *names, "--x", "known", "--y", "map_error *", "--size", "900x420")
        recordings = {name: work / f"figure_{part}_{name}.jsonl" for name in EXPLORERS}
        recordings = {name: file for name, file in recordings.items() if file.is_file()}
        if recordings:
            plotter.plot(f"explore_{part}_maps.png", list(recordings.values()), *named(list(recordings)), "--what", "map",
                         "--size", "1200x1000")
    draw_trees(plotter, [work / f"figure_action_{name}.jsonl" for name in TREES])


def draw_trees(plotter: Plotter, recordings: list[Path]) -> None:
    """Both trees at the same decision."""
    if all(file.is_file() for file in recordings):
        decision = min([DECISION, *(decisions(file) or 1 for file in recordings)])
        plotter.plot("explore_trees.png", recordings, *named(TREES), "--what", "map", "--decision", str(decision),
                     "--size", "1200x500")


def decisions(recording: Path) -> int:
    """How many a recorded exploration has."""
    with recording.open("rb") as lines:
        return sum(b'"kind":"drive"' in line for line in lines)


def draw(cairn: str, folder: Path, images: Path) -> None:
    """Everything that the folder has the runs of. Raises CalledProcessError at the first picture that fails."""
    plotter = Plotter(cairn, images)
    draw_performance(plotter, folder)
    draw_gain(plotter, folder)
    draw_compact_maps(plotter, folder / "work")
    draw_sparsification(plotter, folder)
    draw_exploration(plotter, folder / "work")


def main(words: list[str]) -> int:
    """The exit code: that of `cairn plot` where it fails."""
    parser = argparse.ArgumentParser(prog="bench.pictures", description="Draws what the studies in a folder have found.")
    parser.add_argument("cairn", metavar="CAIRN", help="the program that draws")
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="of the studies")
    parser.add_argument("images", type=Path, metavar="IMAGES", help="the folder of the pictures")
    given = parser.parse_args(words)
    try:
        draw(given.cairn, given.folder, given.images)
    except subprocess.CalledProcessError as error:
        return error.returncode if error.returncode >= 0 else 128 - error.returncode
    except KeyboardInterrupt:
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
