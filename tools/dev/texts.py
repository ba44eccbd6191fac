# SPDX-License-Identifier: BSD-3-Clause
"""What `./dev lint` looks at besides C++: paths of one machine in any text, and the shell scripts."""
from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

# A path of somebody's own machine has no place in a file that others read.
HOME = re.compile(r"(^|[^\w.~-])/(home|root|Users|work)/[\w.]")


def files(*patterns: str) -> list[str]:
    """Those of the checkout that is the working directory, also not yet added to git; all without patterns."""
    listed = subprocess.run(["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard", "--", *patterns],
                            stdout=subprocess.PIPE, text=True, check=True).stdout
    return [name for name in listed.split("\0") if name]


def homes(names: list[str]) -> Iterator[str]:
    """Lines with a path of one machine, after file and number."""
    for name in names:
        path = Path(name)
        if path.name == "LICENSE" or not path.is_file():
            continue
        data = path.read_bytes()
        try:
            text = data.decode()
        except UnicodeDecodeError:
            continue
        if "\0" in text:
            continue
        for number, line in enumerate(text.split("\n"), 1):
            if HOME.search(line):
                yield f"{name}:{number}:{line}"


def paths_are_of_no_machine() -> bool:
    """Prints those that are of one."""
    found = list(homes(files()))
    for line in found:
        print(line, flush=True)
    if found:
        print("lint: a path of one machine, above", file=sys.stderr)
    return not found


def scripts_are_sound() -> bool:
    """As bash reads them, and then shellcheck."""
    scripts = files("dev", ".ci/run", "*.sh")
    read = all(subprocess.run(["bash", "-n", script], check=False).returncode == 0 for script in scripts)
    return read and subprocess.run(["shellcheck", *scripts], check=False).returncode == 0


def main() -> int:
    """The exit code."""
    sound = [paths_are_of_no_machine(), scripts_are_sound()]  # both are looked at
    return 0 if all(sound) else 1


if __name__ == "__main__":
    sys.exit(main())
