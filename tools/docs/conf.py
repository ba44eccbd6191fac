# SPDX-License-Identifier: BSD-3-Clause
"""Sphinx's configuration of the documentation site. `stage.py` has gathered its sources; `./dev docs` runs both."""
import os
import re
from pathlib import Path

SOURCE = Path(__file__).resolve().parents[2]

project = "cairn"
author = "The cairn authors"
project_copyright = author
release = version = re.search(r"project\(cairn VERSION ([0-9.]+)", (SOURCE / "CMakeLists.txt").read_text()).group(1)

extensions = ["myst_parser", "breathe"]
source_suffix = {".md": "markdown"}
master_doc = "index"
exclude_patterns = ["files/**"]

# Anchors of headings as a forge makes them, so that the pages read and link the same there.
myst_heading_anchors = 6
suppress_warnings = ["myst.header"]  # a page may begin below the first level, as those of a forge do

breathe_projects = {"cairn": os.environ.get("CAIRN_DOXYGEN_XML", "")}
breathe_default_project = "cairn"
breathe_default_members = ("members", "undoc-members")
breathe_show_include = False
cpp_id_attributes = ["CAIRN_API"]

html_theme = "furo"
html_title = f"cairn {version}"
html_show_sphinx = False
html_copy_source = False
pygments_style = "default"
highlight_language = "none"
