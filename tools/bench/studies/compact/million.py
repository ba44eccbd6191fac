# SPDX-License-Identifier: BSD-3-Clause
"""A robot that drives through a city of 1 km² for a million poses, live beside `cairn online`, whose map has a fixed number of
poses. The robot is native/city_drive.cpp: its steps take a fraction of a millisecond."""
from __future__ import annotations

import io
import json
import math
import subprocess
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt

from ...pages import Sections, table
from ...program import Failed, Words
from ...reports import Json, number, parts, text
from ...study import Bench, Keep, Study, tell
from ...words import digits, megabytes, milliseconds, percent, whole

Poses = npt.NDArray[np.float64]  # rows of x, y [m] and theta [rad]
SIGMA = {"translation": 0.02, "rotation": 0.005}  # of odometry and of matches, on each axis [m, rad]


@dataclass
class Drive:
    poses: int = 1_000_000
    streets: int = 11  # each way, 100 m apart
    keep: int = 2000
    sample: int = 100_000  # so many are compared with batch
    stops: list[int] = field(default_factory=lambda: [1000, 10_000, 100_000, 200_000, 500_000, 1_000_000])


QUICK = Drive(20_000, 5, 300, 10_000, [1000, 5000, 10_000, 20_000])


def compose(a: Poses, b: Poses) -> Poses:
    """a · b, row by row."""
    c, s = np.cos(a[..., 2]), np.sin(a[..., 2])
    return np.stack([a[..., 0] + c * b[..., 0] - s * b[..., 1], a[..., 1] + s * b[..., 0] + c * b[..., 1],
                     wrapped(a[..., 2] + b[..., 2])], axis=-1)


def wrapped(angles: Poses) -> Poses:
    return np.arctan2(np.sin(angles), np.cos(angles))


def chained(motions: Poses, first: Poses) -> Poses:
    """The poses from `first` on, with the motion to each of the others from the one before."""
    poses = [first]
    for motion in motions:
        poses.append(compose(poses[-1], motion))
    return np.array(poses)


def planar_error(estimate: Poses, truth: Poses) -> tuple[float, float]:
    """Absolute trajectory error, as of `cairn evaluate`: root mean squares [m, rad] of what is left after the rigid motion
    that brings the positions nearest to the true ones (Horn's, in the plane)."""
    if len(estimate) == 0:
        return math.nan, math.nan
    e, t = (poses[:, :2] - poses[:, :2].mean(axis=0) for poses in [estimate, truth])
    turn = math.atan2(float(np.sum(e[:, 0] * t[:, 1] - e[:, 1] * t[:, 0])), float(np.sum(e * t)))
    rotation = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]])
    positions = np.sum((e @ rotation.T - t) ** 2, axis=1)
    angles = wrapped(estimate[:, 2] + turn - truth[:, 2]) ** 2
    return math.sqrt(positions.mean()), math.sqrt(angles.mean())


def read_poses(file: Path, tag: str, ids: int) -> Poses:
    """What the lines with a tag have after their ids."""
    with file.open(encoding="utf-8") as lines:
        text_of = "".join(line for line in lines if line.startswith(tag + " "))
    return np.loadtxt(io.StringIO(text_of), usecols=range(1 + ids, 4 + ids), ndmin=2)


def generate_city(bench: Bench, drive: Drive, city: Path, truth: Path) -> None:
    options = (f"poses={drive.poses},block=100,streets={drive.streets},loop_density=0,"
               f"translation_sigma={SIGMA['translation']},rotation_sigma={SIGMA['rotation']}")
    run_or_fail(bench, ["generate", f"manhattan:{options}", "-o", str(city), "--ground-truth", str(truth), "--quiet"])


def run_or_fail(bench: Bench, words: Words) -> None:
    outcome = bench.cairn.run(words).outcome
    if outcome.exit_code != 0:
        raise Failed(f"cairn {words[0]}: {outcome.complaint}")


def batch_solution(bench: Bench, full: Path, initial: Poses) -> Poses:
    """Every pose of the sample where all measurements have it."""
    given, best = bench.cairn.work / "given.g2o", bench.cairn.work / "best.g2o"
    vertices = "".join(f"VERTEX_SE2 {k} {x!r} {y!r} {theta!r}\n" for k, (x, y, theta) in enumerate(initial.tolist()))
    given.write_text(vertices + full.read_text(encoding="utf-8"), encoding="utf-8")
    run_or_fail(bench, ["optimize", str(given), "-o", str(best), "--quiet"])
    return read_poses(best, "VERTEX_SE2", 1)


def errors_entry(name: str, estimate: Poses, truth: Poses) -> Json:
    translation, rotation = planar_error(estimate, truth)
    return {"part": "errors", "name": name, "poses": len(estimate), "ate": translation, "ate_rotation": rotation}


def study_million(bench: Bench, keep: Keep) -> None:
    drive = QUICK if bench.quick else Drive()
    work = bench.cairn.work
    city, truth_file, full, live = (work / name for name in ["city.g2o", "truth.g2o", "full.g2o", "live.g2o"])
    tell("compact, million: the city")
    generate_city(bench, drive, city, truth_file)
    truth, motions = read_poses(truth_file, "VERTEX_SE2", 1), read_poses(city, "EDGE_SE2", 2)
    words = [str(Path(bench.cairn.program).with_name("cairn_city_drive")), bench.cairn.program, str(city), str(truth_file),
             str(drive.keep), str(SIGMA["translation"]), str(SIGMA["rotation"]), str(drive.sample), str(full), str(live),
             *map(str, drive.stops)]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as robot:
        assert robot.stdin and robot.stdout
        for stop in drive.stops:
            tell(f"compact, million: {stop} poses")
            robot.stdin.write("\n")  # it waits, so that nothing here disturbs its clock
            robot.stdin.flush()
            line = robot.stdout.readline()
            if not line:
                break
            entry = json.loads(line)
            kept = np.array(entry.pop("map"))  # rows of id, x, y, theta
            ids = kept[:, 0].astype(int)
            translation, rotation = planar_error(kept[:, 1:], truth[ids])
            keep({"part": "drive", **entry, "ate": translation, "ate_rotation": rotation})
            if stop == drive.sample:
                odometry = chained(motions[:stop - 1], truth[0])
                batch = batch_solution(bench, full, odometry)
                for name, estimate, true in [("odometry", odometry, truth[:stop]), ("batch", batch, truth[:stop]),
                                             ("live", read_poses(live, "VERTEX_SE2", 1), truth[:stop]),
                                             ("batch_at_kept", batch[ids], truth[ids]), ("kept", kept[:, 1:], truth[ids])]:
                    keep(errors_entry(name, estimate, true))
    for file in [city, truth_file]:
        file.unlink()
    if robot.returncode != 0:
        raise Failed("the drive through the city has failed")


# Tables

ESTIMATES = {"odometry": "odometry", "batch": "all poses and measurements, in batch",
             "live": "compact, each pose when it was the newest",
             "batch_at_kept": "all poses and measurements, in batch: of the poses kept", "kept": "compact: of the poses kept"}


def sections(entries: list[Json]) -> Sections:
    drive = [[*(whole(number(entry, of)) for of in ["poses", "kept", "factors"]), megabytes(number(entry, "memory")),
              *(milliseconds(number(entry, of)) for of in ["median", "p99", "longest"]), digits(number(entry, "asked")),
              percent(number(entry, "left"), 2), digits(number(entry, "ate"))] for entry in parts(entries, "drive")]
    errors = [[ESTIMATES[text(entry, "name")], whole(number(entry, "poses")), digits(number(entry, "ate")),
               digits(math.degrees(number(entry, "ate_rotation")))] for entry in parts(entries, "errors")]
    return {"compact-million": table(["poses driven", "poses kept", "factors", "memory [MB]", "median step [ms]", "99 %",
                                      "longest", "matches asked for, per pose", "poses that leave",
                                      "ATE of the poses kept [m]"], drive),
            "compact-million-errors": table(["estimate", "poses", "ATE [m]", "ATE [°]"], errors)}


STUDIES = [Study("compact_million", study_million, sections)]
