# SPDX-License-Identifier: BSD-3-Clause
"""What `cairn plot` runs: python3 -m cairn.plot svg < NUMBERS > PICTURE, for the JSON that `cairn plot … -o NUMBERS.json` writes."""
import json
import sys


def main() -> int:
    if len(sys.argv) != 2 or sys.argv[1] not in ("svg", "png", "pdf"):
        print(__doc__, file=sys.stderr)
        return 2
    from ._numbers import PlotError
    from ._page import picture

    try:
        drawn = picture(json.load(sys.stdin.buffer), sys.argv[1])
    except PlotError as error:
        print(error, file=sys.stderr)
        return error.code
    sys.stdout.buffer.write(drawn)
    sys.stdout.buffer.flush()
    return 0


if __name__ == "__main__":
    sys.exit(main())
