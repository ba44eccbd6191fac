# SPDX-License-Identifier: BSD-3-Clause
"""A page of the program's commands, from `cairn help COMMAND`."""
import re
import subprocess


def help_of(cairn, *command):
    # As wide as the page, without colours.
    ended = subprocess.run([cairn, "help", *command], capture_output=True, text=True, check=True, env={"COLUMNS": "100", "NO_COLOR": "1", "LC_ALL": "C.UTF-8"})
    return ended.stdout.rstrip()


def write(stage, cairn):
    """Returns the name of the page."""
    overview = help_of(cairn)
    commands = re.findall(r"^  ([a-z][a-z-]*) {2,}", overview, re.MULTILINE)
    text = ["# Commands", "", "What `cairn help COMMAND` prints.", "", "```text", overview, "```", ""]
    for command in commands:
        text += [f"## cairn {command}", "", "```text", help_of(cairn, command), "```", ""]
    if len(commands) < 10:
        raise SystemExit(f"hardly any commands in cairn help: {commands}")
    stage.write("commands.md", "\n".join(text))
    return ["commands"]
