# SPDX-License-Identifier: BSD-3-Clause
"""Tables as CSV, and what pages have of them."""
import csv
import io
import json
import tempfile
import unittest
from pathlib import Path

from bench import command_line, data, pages
from bench.shown import SHOWN
from reports_of import report, studies

ABOUT = {"command": "./dev bench towns", "commit": "abc1234", "machine": "Some CPU, 2 cores"}


def rows_of(text):
    return list(csv.reader(io.StringIO(text)))


def one(heading, *rows):
    return data.tables(pages.table(heading, rows))[0]


class CsvTest(unittest.TestCase):
    def test_each_row_has_what_it_is_of(self):
        text = data.csv_of(one(["graph", "time [ms]"], ["town", "1.50"], ["city, large", "> 60"]), ABOUT)
        self.assertEqual(rows_of(text), [["graph", "time [ms]", "command", "commit", "machine"],
                                         ["town", "1.50", *ABOUT.values()], ["city, large", "> 60", *ABOUT.values()]])

    def test_a_cell_that_is_empty_for_the_eye_has_its_text(self):
        table = one(["graph", "scheme", "by", "note"], ["town", "single", "a", ""], ["", "", "b", "x"], ["", "multi", "a", ""])
        self.assertEqual(table.rows, [["town", "single", "a", ""], ["town", "single", "b", "x"], ["town", "multi", "a", ""]])

    def test_numbers_have_no_units_and_keep_their_digits(self):
        table = one(["graph", "`a` / ours", "share", "nonzeros", "mixed"], ["`x`", "1.50 ×", "52 %", "187 k", "1.00 (amd)"],
                    ["**mean**", "**0.700 ×**", "-", "1.05 M", "-"], ["y", "-", "3.0 %", "999", "2"])
        self.assertEqual([row[:5] for row in rows_of(data.csv_of(table, ABOUT))],
                         [["graph", "a / ours", "share [%]", "nonzeros", "mixed"], ["x", "1.50", "52", "187000", "1.00 (amd)"],
                          ["mean", "0.700", "", "1050000", ""], ["y", "", "3.0", "999", "2"]])

    def test_tables_with_the_same_columns_below_names_are_one(self):
        table = pages.table(["solver", "ms"], [["a", "1"]])
        section = f"**town** (3 variables)\n\n{table}\n**city** (4 variables)\n\n{table}\n" + pages.table(["other"], [["b"]])
        self.assertEqual([each.names for each in data.tables(section)], [["graph", "solver", "ms"], ["other"]])
        self.assertEqual(list(data.files_of("solvers", section, ABOUT)), ["solvers.csv", "solvers-2.csv"])
        self.assertEqual(data.tables(section)[0].rows, [["town", "a", "1"], ["city", "a", "1"]])

    def test_columns_have_different_names(self):
        with self.assertRaisesRegex(ValueError, "two columns slower"):
            one(["graph", "slower", "slower"], ["town", "1", "2"])

    def test_the_tables_of_all_studies_have_different_columns(self):
        tried = 0
        for study in studies().values():
            try:
                sections = study.sections([])
            except (IndexError, ValueError, ZeroDivisionError):
                continue
            for name, markdown in sections.items():
                tried += len([data.brief(name, markdown, None), *data.tables(markdown)])
        self.assertGreater(tried, 60)


class BriefTest(unittest.TestCase):
    SECTION = "`dgemm`: 108.\n\n" + pages.table(["graph", "ms", "MB"], [[f"g{k}", str(k), "1"] for k in range(20)])

    def test_a_long_table_is_a_link_beside_the_rows_that_are_asked_for(self):
        shown = [data.Shown(["graph", "ms"], lambda row: row["graph"] in ("g3", "g17"))]
        text = data.brief("rates", self.SECTION, shown)
        self.assertIn("In full: [rates.csv](data/rates.csv) (20 rows).\n\n`dgemm`: 108.\n", text)
        self.assertEqual([table[1:] for table in pages.tables_in(text)], [[["g3", "3"], ["g17", "17"]]])

    def test_a_short_table_stays_and_a_long_one_does_not(self):
        self.assertEqual(list(pages.tables_in(data.brief("rates", self.SECTION, None))), [])
        table = pages.table(["graph", "ms"], [["town", "1"]])
        self.assertTrue(data.brief("rates", table, None).startswith(table))

    def test_a_column_that_there_is_not_is_named(self):
        with self.assertRaisesRegex(ValueError, "no column kB; it has graph, ms, MB"):
            data.brief("rates", self.SECTION, [data.Shown(["graph", "kB"])])

    def test_what_is_shown_is_of_columns_that_there_are(self):
        for study in studies().values():
            try:
                sections = study.sections([])
            except (IndexError, ValueError, ZeroDivisionError):
                continue
            for name, markdown in sections.items():
                for table, shown in zip(data.tables(markdown), SHOWN.get(name, [])):
                    if not study.name.startswith("explore"):  # whose columns are the methods that ran
                        self.assertLessEqual(set(shown.columns), set(table.names), name)


class FilesTest(unittest.TestCase):
    def test_where_nothing_is_but_a_link_the_commit_is_in_the_csv_alone(self):
        report_of = {**report("graphs"), "entries": []}
        with tempfile.TemporaryDirectory() as place:
            page = Path(place) / "page.md"
            page.write_text("<!-- table:parts -->\n<!-- /table -->\n", encoding="utf-8")
            pages_of = [page.read_text(encoding="utf-8")]
            section = pages.table(["graph", "ms"], [["town", "1"]])
            command_line.write_sections({"parts": section}, report_of, [page], pages_of)
            self.assertEqual(pages_of, ["<!-- table:parts -->\nIn full: [parts.csv](data/parts.csv) (1 row).\n<!-- /table -->\n"])
            self.assertIn(",abc1234,", (Path(place) / "data" / "parts.csv").read_text(encoding="utf-8"))

    def test_the_csv_is_beside_the_page_with_the_commit(self):
        threads = report("threads", {"name": "torus", "one": {"iteration": 0.04, "factorize": 0.03},
                                     "two": {"iteration": 0.025, "factorize": 0.015}})
        with tempfile.TemporaryDirectory() as place:
            page = Path(place) / "page.md"
            page.write_text("<!-- table:threads -->\n<!-- /table -->\n", encoding="utf-8")
            (Path(place) / "threads.json").write_text(json.dumps(threads), encoding="utf-8")
            self.assertEqual(command_line.main(["--folder", place, "--tables", str(page)]), 0)
            written = page.read_text(encoding="utf-8")
            rows = rows_of((Path(place) / "data" / "threads.csv").read_text(encoding="utf-8"))
        self.assertIn("[threads.csv](data/threads.csv) (1 row)", written)
        self.assertIn("commit abc1234.*", written)
        self.assertEqual(rows[1], ["torus", "30.0", "15.0", "2.00", "40.0", "25.0", "1.60", "./dev bench threads", "abc1234",
                                   "Some CPU, 2 cores, avx2; gcc, -O3"])
