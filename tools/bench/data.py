# SPDX-License-Identifier: BSD-3-Clause
"""The tables of a section as CSV, and the few rows of them that a page has beside a link to that.

What stands in a CSV are the cells of the table as they are, but that nothing is left out for the eye: a cell that is empty
because it is that of the row above has its text, a number has no unit, and each row has the command that repeats it, the
commit and the machine.
"""
from __future__ import annotations

import csv
import io
import re
from collections.abc import Callable
from dataclasses import dataclass, field
from decimal import Decimal

from .pages import table, tables_in

Row = dict[str, str]  # by the names of the columns
MOST_ROWS = 12  # of a table that a page has as it is
UNITS = {"k": Decimal("1e3"), "M": Decimal("1e6"), "G": Decimal("1e9"), "T": Decimal("1e12")}
NUMBER = r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?"


@dataclass
class Table:
    """With a name of its own for each column, and no cell left out."""

    names: list[str]
    rows: list[list[str]]

    def named(self) -> list[Row]:
        return [dict(zip(self.names, row)) for row in self.rows]


@dataclass
class Shown:
    """What a page has of a table: these columns, all if there is none, of the rows that are asked for."""

    columns: list[str] = field(default_factory=list)
    rows: Callable[[Row], bool] = lambda row: True


def filled(rows: list[list[str]]) -> list[list[str]]:
    """Empty cells at the beginning of a row are those of the row above."""
    done: list[list[str]] = []
    for row in rows:
        first = next((k for k, cell in enumerate(row) if cell), 0)
        done.append((done[-1][:first] if done else row[:first]) + row[first:])
    return done


def tables(markdown: str) -> list[Table]:
    """Those of a section; several with the same columns, each below its name in bold, are one, whose first column is that.

    Raises ValueError where two columns have the same name.
    """
    found: list[tuple[list[str], list[list[str]]]] = []
    for before, block in re.findall(r"((?:^(?!\|).*\n)*)((?:^\|.*\n)+)", markdown, re.MULTILINE):
        heading, *rows = next(tables_in(block))
        if twice := {name for name in heading if heading.count(name) > 1}:
            raise ValueError(f"a table has two columns {', '.join(sorted(twice))}")
        rows = filled(rows)
        if name := re.search(r"^\*\*(.+)\*\* \(", before, re.MULTILINE):
            heading, rows = ["graph", *heading], [[name.group(1), *row] for row in rows]
        if found and found[-1][0] == heading:
            found[-1][1].extend(rows)
        else:
            found.append((heading, rows))
    return [Table(heading, rows) for heading, rows in found]


def without_units(name: str, cells: list[str]) -> tuple[str, list[str]]:
    """A column of numbers: without "×", with "%" in its name, and "187 k" as 187000; "-" is nothing."""
    cells = ["" if cell == "-" else cell for cell in (re.sub(r"\*\*|`", "", cell) for cell in cells)]
    some = [cell for cell in cells if cell]
    name = name.replace("`", "")
    for unit, called in [("×", name), ("%", f"{name} [%]")]:
        if some and all(re.fullmatch(rf"{NUMBER} {unit}", cell) for cell in some):
            return called, [cell.removesuffix(f" {unit}") for cell in cells]
    if some and all(re.fullmatch(rf"{NUMBER}(?: [kMGT])?", cell) for cell in some):
        return name, [f"{Decimal(cell[:-2]) * UNITS[cell[-1]]:f}" if cell[-1:] in UNITS else cell for cell in cells]
    return name, cells


def csv_of(one: Table, about: Row) -> str:
    """`about`: columns that are the same in all rows, such as the commit."""
    columns = [without_units(name, [row[k] for row in one.rows]) for k, name in enumerate(one.names)]
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([*(name for name, _ in columns), *about])
    for k in range(len(one.rows)):
        writer.writerow([*(cells[k] for _, cells in columns), *about.values()])
    return text.getvalue()


def files_of(name: str, markdown: str, about: Row) -> dict[str, str]:
    """The content of each by its name: NAME.csv, and if there are several tables NAME-2.csv and so on."""
    return {f"{name}.csv" if k == 1 else f"{name}-{k}.csv": csv_of(one, about) for k, one in enumerate(tables(markdown), 1)}


def again_empty(rows: list[list[str]]) -> list[list[str]]:
    """For the eye: the first cell only where it changes."""
    return [["" if k > 0 and len(row) > 2 and row[0] == rows[k - 1][0] else row[0], *row[1:]] for k, row in enumerate(rows)]


def short(one: Table, shown: Shown | None) -> str:
    """The table in the page; nothing of one that is long, unless it is said what. Raises ValueError for an unknown column."""
    if shown is None:
        shown = Shown(rows=lambda row: len(one.rows) <= MOST_ROWS)
    if unknown := [name for name in shown.columns if name not in one.names]:
        raise ValueError(f"the table has no column {', '.join(unknown)}; it has {', '.join(one.names)}")
    chosen = [[row[name] for name in shown.columns or one.names] for row in one.named() if shown.rows(row)]
    return table(shown.columns or one.names, again_empty(chosen)) if chosen else ""


def brief(name: str, markdown: str, shown: list[Shown] | None) -> str:
    """A section for a page: its lines, its tables in short, and links to the files. `shown`: of each table."""
    lines = [line for line in markdown.split("\n") if line and not line.startswith("|") and not re.match(r"\*\*.+\*\* \(", line)]
    parts, links = [], []
    for k, one in enumerate(tables(markdown)):
        parts.append(short(one, shown[k] if shown and k < len(shown) else None))
        file = f"{name}.csv" if k == 0 else f"{name}-{k + 1}.csv"
        links.append(f"[{file}](data/{file}) ({len(one.rows)} row{'s' if len(one.rows) != 1 else ''})")
    if links:
        parts.append(f"In full: {', '.join(links)}.\n")
    if lines:
        parts.append("\n".join(lines) + "\n")
    return "\n".join(part for part in parts if part)
