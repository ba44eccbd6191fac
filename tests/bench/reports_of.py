# SPDX-License-Identifier: BSD-3-Clause
"""What the tests of tables share."""
from bench.command_line import provenance
from bench.studies import ALL


def studies():
    return {study.name: study for study in ALL}


def report(study, *entries):
    return {"study": study, "cairn": "0.1.0", "commit": "abc1234", "machine": {"cpu": "Some CPU", "cores": 2},
            "build": {"compiler": "gcc", "flags": "-O3", "simd": "avx2"}, "entries": list(entries)}


def without_padding(markdown):
    """Rows of tables as "| a | b |"."""
    def line(text):
        return "| " + " | ".join(cell.strip() for cell in text[1:-1].split("|")) + " |" if text.startswith("|") else text
    return "\n".join(map(line, markdown.split("\n")))


def section(whole, name):
    """The Markdown of a section of a report, without the padding of its cells."""
    return without_padding(studies()[whole["study"]].sections(whole["entries"])[name] + provenance(whole))
