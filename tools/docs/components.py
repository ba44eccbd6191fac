# SPDX-License-Identifier: BSD-3-Clause
"""Pages of what can be chosen by name, one for each kind, from the tables of options that the plugins themselves have."""
import json
import subprocess

# What a kind is for; a kind of a plugin that is not here has a page all the same.
KINDS = {
    "checks": "What `cairn plugins --check` asks of components of a kind: [plugins.md](../docs/plugins.md).",
    "edge_selection": "Which loop closures stay when a graph is sparsified: [sparsify.md](../docs/sparsify.md).",
    "estimator": "Follow a graph while it grows: [online.md](../docs/online.md).",
    "explorer": "Decide where a robot drives next: [explore.md](../docs/explore.md).",
    "factor": "Types of measurements, by the tags of files: [formats.md](../docs/formats.md), [plugins.md](../docs/plugins.md).",
    "factor_recovery": "Compute the new factors of a sparse graph: [sparsify.md](../docs/sparsify.md).",
    "floor_plan": "Make floors of buildings: [floors.md](../docs/floors.md).",
    "format": "File formats of graphs and trajectories: [formats.md](../docs/formats.md).",
    "generator": "Make simulated data sets, the same on every machine.",
    "grid_format": "File formats of maps: [floors.md](../docs/floors.md).",
    "initial_guess": "Compute an initial estimate of a whole graph: [solvers.md](../docs/solvers.md).",
    "line_session": "Sessions of `cairn online` in which something decides what is kept: [online.md](../docs/online.md).",
    "linear_solver": "Solve the normal equations H δ = g: [solvers.md](../docs/solvers.md).",
    "loss": "Robust losses ρ(‖r‖²): [solvers.md](../docs/solvers.md).",
    "mapper": "Build a map of scans and poses: [explore.md](../docs/explore.md).",
    "node_selection": "Which nodes leave when a graph is sparsified: [sparsify.md](../docs/sparsify.md).",
    "optimizer": "Minimise chi2: [solvers.md](../docs/solvers.md).",
    "other_input": "What may stand for a graph and is none: [floors.md](../docs/floors.md).",
    "path_planner": "Find paths on a map: [explore.md](../docs/explore.md).",
    "pose_policy": "Decide which poses and loop closures are kept: [compact.md](../docs/compact.md).",
    "pose_remover": "Take poses out of a map while it grows: [sparsify.md](../docs/sparsify.md).",
    "registration": "Measure the relative pose of two poses: [compact.md](../docs/compact.md), [icp.md](../docs/icp.md).",
    "scene_source": "Recordings that are shown beside graphs: [report.md](../docs/report.md).",
    "sparsifier": "Take nodes out of a graph and keep their information: [sparsify.md](../docs/sparsify.md).",
    "topology": "Which pairs of nodes get a new factor: [sparsify.md](../docs/sparsify.md).",
    "variable": "Types of variables, by the tags of files: [formats.md](../docs/formats.md), [plugins.md](../docs/plugins.md).",
    "world": "Robots with a lidar, simulated or not: [explore.md](../docs/explore.md).",
}


def ask(cairn, *names):
    """The offers, with their options where one is named."""
    ended = subprocess.run([cairn, "plugins", *names, "--json", "-"], capture_output=True, text=True, check=True)
    return json.loads(ended.stdout)["offers"]


def cell(text):
    """A text in a cell of a table, in which nothing is markup."""
    for character in "\\`*_[]<>{}|$":
        text = text.replace(character, "\\" + character)
    return text.replace("\n", " ")


def limits(option):
    low, high = option["minimum"], option["maximum"]
    if option["choices"]:
        return ", ".join(f"`{choice}`" for choice in option["choices"])
    if low is None and high is None:
        return ""
    return f"{'' if low is None else f'{low:g}'} … {'' if high is None else f'{high:g}'}"


def section(offer):
    lines = [f"## {cell(offer['name'])}", "", cell(offer["summary"][:1].upper() + offer["summary"][1:]) + ".", ""]
    facts = f"Plugin `{offer['plugin']}`, {cell(offer['licence'])}."
    if offer.get("abilities"):
        facts += " Abilities: " + ", ".join(f"`{ability}`" for ability in offer["abilities"]) + "."
    lines += [facts, ""]
    if offer.get("options"):
        lines += ["| option | type | default | values | |", "| --- | --- | --- | --- | --- |"]
        for option in offer["options"]:
            default = f"`{option['default']}`" if option["default"] else ""
            lines.append(f"| `{option['name']}` | {option['type']} | {default} | {limits(option)} | {cell(option['help'])} |")
        lines.append("")
    return "\n".join(lines)


def write(stage, cairn):
    """Returns the names of the pages."""
    kinds = {}
    details = {}
    for offer in ask(cairn):
        if offer["name"] not in details:
            details[offer["name"]] = ask(cairn, offer["name"])
        whole = next(one for one in details[offer["name"]] if one["kind"] == offer["kind"])
        kinds.setdefault(offer["kind"], []).append(whole)
    rows = ["# What can be chosen by name", "", "As `cairn plugins` lists it; these pages are made of the tables of options that `cairn plugins NAME` shows.", ""]
    rows += ["| kind | names |", "| --- | --- |"]
    pages = ["components/index"]
    for kind, offers in sorted(kinds.items()):
        title = kind.replace("_", " ")
        text = [f"# Kind: {title}", "", KINDS.get(kind, ""), ""] + [section(offer) for offer in offers]
        stage.write(f"components/{kind}.md", "\n".join(text))
        pages.append(f"components/{kind}")
        rows.append(f"| [{title}]({kind}.md) | {', '.join('`' + offer['name'] + '`' for offer in offers)} |")
    stage.write("components/index.md", "\n".join(rows) + "\n")
    return pages
