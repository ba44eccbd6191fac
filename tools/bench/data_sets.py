# SPDX-License-Identifier: BSD-3-Clause
"""The graphs that are measured on: published ones, which lie in a folder of data, and generated ones, which everybody has.

A study takes those of its published graphs that are there, and the generated ones; `quick` means few and small.
"""
from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path


@dataclass(frozen=True)
class DataSet:
    """A graph as the command line of `cairn` takes it, and where its true poses come from.

    `truth`: "generated": the generator knows them; "file": a graph or a trajectory; "edges": measurements without noise, to
    be optimised; "camera": poses of a camera in KITTI's axes; "simulated": the same, along which the graph is simulated,
    too (camera_world.cpp); "de_facto": nobody knows them, and the minimum of all measurements stands in.
    """

    name: str
    graph: str  # a file, or @KIND:options
    arguments: list[str] = field(default_factory=list)  # what reading it needs
    truth: str = "generated"
    truth_file: str = ""
    truth_arguments: list[str] = field(default_factory=list)  # what optimising it needs

    @property
    def generated(self) -> bool:
        return self.graph.startswith("@")

    def located(self, data: Path | None) -> DataSet | None:
        """With its files as paths; None if one is not there."""
        if self.generated:
            return self
        if data is None:
            return None
        graph, truth = data / self.graph, data / self.truth_file
        there = graph.exists() and truth.exists()
        return replace(self, graph=str(graph), truth_file=str(truth) if self.truth_file else "") if there else None


def located(sets: Iterable[DataSet], data: Path | None) -> list[DataSet]:
    """Those that there are."""
    return [found for found in (one.located(data) for one in sets) if found]


def every_graph(data: Path | None, quick: bool, folders: list[str]) -> list[DataSet]:
    """All graphs in these folders of the data, by the names of their files; without any a generated one."""
    files = [] if data is None or quick else [file for folder in folders for file in sorted((data / folder).glob("*.*"))]
    return [DataSet(f"{file.parent.name}/{file.name}", str(file)) for file in files] or [SMALL_PLANE if quick else PLANE]


def located_or(published: list[DataSet], data: Path | None, quick: bool, small: DataSet, generated: DataSet) -> list[DataSet]:
    """The published ones; if there are none or if it is to be quick, a generated one."""
    return [small] if quick else located(published, data) or [generated]


LIKE_G2O = ["--types", "slam3d:metric=g2o"]
# What the pages were measured with where they name no other: the default until `rotation_vector` became it.
LOGARITHM = ["--types", "slam3d:metric=logarithm"]
ROTATION_VECTOR = ["--types", "slam3d:metric=rotation_vector"]
SMALL_PLANE, PLANE = DataSet("manhattan, 600 poses", "@manhattan:poses=600"), DataSet("manhattan", "@manhattan")

_OPTIMIZED = {one.name: one for one in [
    DataSet("manhattanOlson3500", "pose2d/manhattanOlson3500.g2o"),
    DataSet("city10000", "pose2d/city10000.g2o"),
    DataSet("10kHog-man", "pose2d/10kHog-man.graph.gz"),
    DataSet("w20000", "pose2d/w20000_isam.txt"),
    DataSet("intel1728", "pose2d/intel1728.g2o"),
    DataSet("killian5489", "pose2d/killian5489_glc.g2o"),
    DataSet("kitti_00", "pose2d/kitti_00.g2o"),
    DataSet("sphere2500", "pose3d/sphere2500.g2o", LOGARITHM),
    DataSet("sphere2500a", "pose3d/sphere2500a.g2o", LOGARITHM),
    DataSet("torus3D", "pose3d/torus3D.g2o.gz", LOGARITHM),
    DataSet("torus10000", "pose3d/torus10000_isam.txt", LOGARITHM),
    DataSet("parking-garage", "pose3d/parking-garage.g2o", LOGARITHM),
    DataSet("cubicle", "pose3d/cubicle.g2o", ["--repair-information", *LOGARITHM]),
    DataSet("sphere_bignoise", "pose3d/sphere_bignoise_vertex3.g2o", LOGARITHM),
    DataSet("Victoria Park", "landmark2d/victoriaPark_isam.txt", ["--initial", "incremental"]),
    DataSet("cityTrees10000", "landmark2d/cityTrees10000_isam.txt"),
    DataSet("ladybug-49", "ba/ladybug-problem-49-7776-pre.txt"),
    DataSet("dubrovnik-3", "ba/dubrovnik-3-7-pre.txt"),
    PLANE,
    DataSet("city", "@city"),
    DataSet("sphere", "@sphere", LOGARITHM),
    DataSet("torus", "@torus:turns=60", LOGARITHM),
    DataSet("grid3d 12³", "@grid3d:nx=12,ny=12,nz=12", LOGARITHM),
    DataSet("grid3d 20³", "@grid3d:nx=20,ny=20,nz=20", LOGARITHM),
    DataSet("landmarks2d", "@landmarks2d"),
    DataSet("bundle", "@bundle"),
]}

# Of each study that optimises: all, and the few when it is to be quick.
_CHOSEN = {
    "graphs": (["manhattanOlson3500", "city10000", "10kHog-man", "w20000", "intel1728", "killian5489", "sphere2500",
                "sphere2500a", "torus3D", "torus10000", "parking-garage", "cubicle", "sphere_bignoise", "manhattan",
                "city", "sphere", "torus", "grid3d 12³"],
               ["manhattanOlson3500", "intel1728", "parking-garage", "sphere"]),
    "rates": (["manhattanOlson3500", "sphere2500", "torus3D", "torus10000", "manhattan", "sphere", "torus", "grid3d 20³"],
              ["manhattanOlson3500", "sphere2500", "manhattan"]),
    "precision": (["manhattanOlson3500", "city10000", "intel1728", "killian5489", "kitti_00", "sphere2500", "sphere2500a",
                   "torus3D", "torus10000", "parking-garage", "cubicle", "sphere_bignoise", "manhattan", "grid3d 12³", "grid3d 20³"],
                  ["intel1728", "parking-garage", "sphere2500"]),
    "threads": (["manhattanOlson3500", "torus3D", "torus10000", "manhattan", "torus", "grid3d 20³"],
                ["manhattanOlson3500", "torus"]),
    "marginals": (["manhattanOlson3500", "intel1728", "city10000", "kitti_00", "sphere2500", "torus3D", "torus10000",
                   "parking-garage", "sphere_bignoise", "manhattan", "city", "sphere", "torus", "grid3d 12³"],
                  ["intel1728", "parking-garage", "manhattan"]),
    "solvers": (["manhattanOlson3500", "sphere2500", "Victoria Park", "cityTrees10000", "ladybug-49", "dubrovnik-3",
                 "landmarks2d", "bundle"],
                ["intel1728", "dubrovnik-3", "landmarks2d"]),
}


def sets_of(study: str, data: Path | None, quick: bool) -> list[DataSet]:
    """The graphs of "graphs", "rates", "precision", "threads", "marginals" or "solvers"."""
    return located((_OPTIMIZED[name] for name in _CHOSEN[study][quick]), data)


def pose_graphs(data: Path | None, quick: bool) -> list[DataSet]:
    """Every pose graph of the folders pose2d and pose3d of `data`, and generated ones; in space with g2o's residual, which all
    programs have."""
    small_space = DataSet("sphere, 200 poses", "@sphere:turns=10,poses_per_turn=20,radius=20", LIKE_G2O)
    if quick:
        return [SMALL_PLANE, small_space]
    def published(folder: str, arguments: list[str]) -> list[DataSet]:
        files = sorted((data / folder).iterdir(), key=lambda file: file.name.lower()) if data and (data / folder).is_dir() else []
        return [DataSet(file.name.removesuffix(".gz"), str(file), ["--repair-information", *arguments]) for file in files]
    space = [replace(_OPTIMIZED[name], arguments=LIKE_G2O) for name in ["sphere", "torus", "grid3d 12³"]]
    return [*published("pose2d", []), *published("pose3d", LIKE_G2O), PLANE, _OPTIMIZED["city"], *space]


# `cairn replay` has other initial guesses than `cairn optimize`.
_REPLAYED = [
    DataSet("manhattanOlson3500", "pose2d/manhattanOlson3500.g2o"),
    DataSet("manhattanOlson3500, file's start", "pose2d/manhattanOlson3500.g2o", ["--initial", "as_given"]),
    DataSet("intel1728", "pose2d/intel1728.g2o"),
    DataSet("city10000", "pose2d/city10000.g2o"),
    DataSet("sphere2500", "pose3d/sphere2500.g2o", LIKE_G2O),
    DataSet("parking-garage", "pose3d/parking-garage.g2o", LIKE_G2O),
    DataSet("10kHog-man", "pose2d/10kHog-man.graph.gz"),
    DataSet("killian5489", "pose2d/killian5489_glc.g2o"),
    DataSet("cityTrees10000", "landmark2d/cityTrees10000_isam.txt"),
    DataSet("Victoria Park", "landmark2d/victoriaPark_isam.txt"),
    PLANE,
    DataSet("city", "@city:poses=5000"),
    DataSet("sphere", "@sphere", LOGARITHM),
    DataSet("landmarks2d", "@landmarks2d"),
]
_REPLAYED_QUICKLY = [DataSet("intel1728", "pose2d/intel1728.g2o"), SMALL_PLANE,
                     DataSet("landmarks2d, 500 poses", "@landmarks2d:poses=500")]


def online_sets(data: Path | None, quick: bool) -> list[DataSet]:
    return located(_REPLAYED_QUICKLY if quick else _REPLAYED, data)


def budget_sets(data: Path | None, quick: bool) -> list[DataSet]:
    if quick:
        return [DataSet("city, 1000 poses", "@city:poses=1000")]
    return [one for one in online_sets(data, quick) if "file's start" not in one.name]


# `cairn compact`, with the truth. The ellipses are those of Ila et al. (2017) with the noise that the errors in their Table 4
# show: their relative pose errors of odometry, 0.100 m and 3.16 degrees of ellipse3D and 0.095 m and 2.74 degrees of ellipseN,
# over sqrt(3), are that of an axis: as much for every pair, and not 5 % of its motion. ellipseN was matched within about 1 m,
# by its v.


def ellipse3d(more: str = "", noise: float = 1.0) -> DataSet:
    """`more`: options of the generator; `noise`: a factor of the paper's standard deviations."""
    return DataSet("ellipse3d" + (f", noise × {noise:g}" if noise != 1.0 else ""), "@ellipse3d:translation_error=0,rotation_error=0,"
                   f"translation_sigma={0.058 * noise:.6g},rotation_sigma={0.032 * noise:.6g}" + more, LOGARITHM)


def ellipse_n(laps: int, more: str = "") -> DataSet:
    return DataSet("ellipse_n", f"@ellipse_n:laps={laps},translation_error=0,rotation_error=0,translation_sigma=0.055,"
                   f"rotation_sigma=0.03,loop_radius=1{more}")


# The sensor of these, as options of the registration `simulated`.
ELLIPSE_SENSOR, ELLIPSE_N_SENSOR = "range=3,angle=0.2", "range=1,angle=0.2"
_COMPACTED = [
    ellipse3d(),
    ellipse_n(10),
    DataSet("kitti_00", "pose2d/kitti_00.g2o", truth="camera", truth_file="groundtruth/kitti_00_poses.txt"),
    DataSet("kitti_00, simulated", "", ROTATION_VECTOR, "simulated", "groundtruth/kitti_00_poses.txt"),
    DataSet("sphere2500", "pose3d/sphere2500.g2o", LIKE_G2O, "edges", "groundtruth/sphere2500_groundtruth_isam.txt"),
    DataSet("sphere2500_isam", "pose3d/sphere2500_isam.txt", ROTATION_VECTOR, "edges",
            "groundtruth/sphere2500_groundtruth_isam.txt"),
    DataSet("parking-garage", "pose3d/parking-garage.g2o", LIKE_G2O, "de_facto"),
    DataSet("10kHog-man", "pose2d/10kHog-man.graph.gz", [], "de_facto", truth_arguments=["--initial", "chordal"]),
    DataSet("manhattanOlson3500_isam", "pose2d/manhattanOlson3500_isam.txt", [], "file",
            "groundtruth/manhattanOlson3500_nodes_groundTruth.dat"),
    DataSet("city10000", "pose2d/city10000_isam.txt", [], "edges", "groundtruth/city10000_groundtruth_isam.txt"),
]


def compact_sets(data: Path | None, quick: bool) -> list[DataSet]:
    return [ellipse3d(), DataSet("manhattan, 500 poses", "@manhattan:poses=500")] if quick else located(_COMPACTED, data)


def compact_sets_named(names: list[str], data: Path | None, quick: bool) -> list[DataSet]:
    """In their order; quick: those that are generated."""
    return [one for one in located(_COMPACTED, None if quick else data) if one.name in names]


def simulated_sets(data: Path | None, quick: bool) -> list[tuple[DataSet, str]]:
    """With a registration that measures what the truth is, and the range of its sensor as options of that."""
    planar = "range=3,angle=3.14"
    ellipse = (ellipse3d(), ELLIPSE_SENSOR)
    if quick:
        return [ellipse, (DataSet("manhattan, 300 poses", "@manhattan:poses=300"), planar)]
    return [ellipse, (DataSet("sphere, 900 poses", "@sphere:turns=30,poses_per_turn=30,radius=30", LOGARITHM), "range=8,angle=0.6"),
            (DataSet("manhattan, 2000 poses", "@manhattan:poses=2000"), planar),
            *((one, planar) for one in compact_sets_named(["manhattanOlson3500_isam"], data, quick))]


def live_sets(data: Path | None, quick: bool) -> list[tuple[DataSet, list[str]]]:
    """With what a robot knows of its sensor, as arguments; without these thresholds are found. Circles whose loop closures
    are half to five times as noisy as odometry, and recordings."""
    def circle(noisier: str, laps: int) -> tuple[DataSet, list[str]]:
        return (DataSet(f"circle, loop closures × {noisier}",
                        f"@ellipse_n:laps={laps},poses_per_lap=40,loop_radius=5,loop_angle=0.5,loop_density=0.1,"
                        "translation_error=0,rotation_error=0,translation_sigma=0.02,rotation_sigma=0.005,"
                        f"loop_noise={noisier}"), ["--range", "5", "--angle", "0.5"])
    if quick:
        return [circle("2.5", 5)]
    recordings = [*compact_sets_named(["kitti_00", "manhattanOlson3500_isam", "parking-garage"], data, quick),
                  *located([DataSet("FR079", "pose2d/FR079.g2o", truth="de_facto"),
                            DataSet("killian5489", "pose2d/killian5489_glc.g2o", truth="de_facto")], data)]
    return [circle(noisier, 25) for noisier in ["0.5", "1", "1.5", "2.5", "5"]] + [(one, []) for one in recordings]


# `cairn sparsify`; without published graphs a generated one.

_CHAIN = ["--initial", "odometry"]
_M3500 = DataSet("M3500", "pose2d/M3500.g2o", _CHAIN)
_CITY = DataSet("city10000", "pose2d/city10000_isam.txt")


def thesis_sets(data: Path | None, quick: bool) -> list[DataSet]:
    """Those of Vallvé's thesis."""
    return located_or([_M3500, DataSet("Intel", "pose2d/intel1228_carlone.g2o", _CHAIN),
                       DataSet("FR079", "pose2d/FR079.g2o", _CHAIN), DataSet("MITb", "pose2d/MITb.g2o", _CHAIN)],
                      data, quick, SMALL_PLANE, PLANE)


def space_sets(data: Path | None, quick: bool) -> list[DataSet]:
    return located_or([DataSet("sphere2500_isam", "pose3d/sphere2500_isam.txt", LOGARITHM),
                       DataSet("parking-garage", "pose3d/parking-garage.g2o", LIKE_G2O),
                       DataSet("eecs", "pose3d/eecs_glc.g2o", LIKE_G2O),
                       DataSet("duderstadt", "pose3d/duderstadt_glc.g2o", LIKE_G2O)], data, quick,
                      DataSet("sphere, 200 poses", "@sphere:turns=10,poses_per_turn=20,radius=20", LOGARITHM), DataSet("sphere", "@sphere", LOGARITHM))


def large_sets(data: Path | None, quick: bool) -> list[DataSet]:
    return located_or([_M3500, _CITY], data, quick, SMALL_PLANE, PLANE)


def sparsify_online_sets(data: Path | None, quick: bool) -> list[DataSet]:
    return located_or([DataSet("manhattanOlson3500_isam", "pose2d/manhattanOlson3500_isam.txt"), _CITY], data, quick, SMALL_PLANE,
                      PLANE)


def edge_sets(data: Path | None, quick: bool) -> list[DataSet]:
    return located_or([DataSet("M3500", "pose2d/M3500.g2o"), DataSet("intel1728", "pose2d/intel1728.g2o"),
                       DataSet("killian5489", "pose2d/killian5489_glc.g2o"), DataSet("sphere2500", "pose3d/sphere2500.g2o", LOGARITHM),
                       DataSet("parking-garage", "pose3d/parking-garage.g2o", LOGARITHM)], data, quick, SMALL_PLANE, PLANE)
