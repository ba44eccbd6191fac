# SPDX-License-Identifier: BSD-3-Clause
"""Tables in Markdown, their places in the pages of docs/, and the same tables in LaTeX."""
from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

from tabulate import tabulate

Sections = dict[str, str]  # the Markdown of each part of a page that is written by a study, by its name


def table(heading: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """The first column is to the left, the others to the right."""
    aligned = ["left"] + ["right"] * (len(heading) - 1) if rows else None  # tabulate has no columns without rows
    markdown: str = tabulate(rows, heading, tablefmt="pipe", colalign=aligned, disable_numparse=True)
    return markdown + "\n"


def tables_in(markdown: str) -> Iterator[list[list[str]]]:
    """The tables of a section as `table` writes them: the cells of each row, first those of the heading."""
    for block in re.findall(r"(?:^\|.*\n)+", markdown, re.MULTILINE):
        rows = [[cell.strip() for cell in line.strip().strip("|").split("|")] for line in block.splitlines()]
        yield rows[:1] + rows[2:]


def latex(markdown: str) -> str:
    """The tables of a section as tabulars of LaTeX, one after the other; emphasis is left out."""
    texts = []
    for heading, *rows in tables_in(markdown):
        plain = [[re.sub(r"\*\*|`", "", cell) for cell in row] for row in rows]
        aligned = ["left"] + ["right"] * (len(heading) - 1) if rows else None
        texts.append(tabulate(plain, heading, tablefmt="latex", colalign=aligned, disable_numparse=True) + "\n")
    return "\n".join(texts)


def marker(name: str) -> str:
    return f"<!-- table:{name} -->\n"


def put(name: str, markdown: str, page: str) -> str:
    """The page with the section between its markers, which stand on lines of their own and stay:

        <!-- table:NAME -->
        <!-- /table -->

    Raises ValueError if the page has no such place.
    """
    before, begin, rest = page.partition(marker(name))
    _, end, after = rest.partition("<!-- /table -->")
    if not end:
        raise ValueError(f"the page has no place for the table {name}")
    return before + begin + markdown + end + after


def put_into(pages: list[str], name: str, markdown: str) -> int:
    """Into the page that has a place for it, which is returned. Raises ValueError if none has."""
    at = next((k for k, page in enumerate(pages) if marker(name) in page), 0)
    pages[at] = put(name, markdown, pages[at])
    return at
