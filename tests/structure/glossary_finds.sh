#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# glossary.sh finds a word to avoid where a reader meets it, names file and line, and passes over code.
#
#   glossary_finds.sh SOURCE_FOLDER
set -eu
here=$(cd "$(dirname "$0")" && pwd)
tree=$(mktemp -d)
trap 'rm -rf "$tree"' EXIT
mkdir -p "$tree/docs" "$tree/core/include" "$tree/solvers" "$tree/apps/cairn"

cat > "$tree/docs/page.md" << 'END'
A page whose code may say `honest` as it likes.

```sh
honest --picture
```

The report of an honest
estimate, with the freedom of
the gauge.
END
cat > "$tree/core/include/public.hpp" << 'END'
#include "honest/picture.hpp"
/// The endgame of `honest` is an identifier.
inline int honest = 0;  ///< nats a freedom
END
cat > "$tree/solvers/plugin.cpp" << 'END'
// An honest comment of a source file is for its authors.
const char* kHelp = "the optimizer, "
                    "whoever it is";
const char kQuote = '"', kOther = 'h';  // honest
int honest(int x) { return x; }
END
cat > "$tree/apps/cairn/clean.cpp" << 'END'
const char* kClean = "the initial estimate";
END

expected='core/include/public.hpp:2
core/include/public.hpp:3
docs/page.md:7
docs/page.md:8
solvers/plugin.cpp:2
solvers/plugin.cpp:3'
if output=$("$here/glossary.sh" "$1" "$tree"); then
  echo "nothing was found, although words to avoid are there" >&2
  exit 1
fi
found=$(printf '%s\n' "$output" | cut -d: -f1,2 | sort -u)
if [ "$found" != "$expected" ]; then
  printf 'found:\n%s\nexpected:\n%s\n' "$output" "$expected" >&2
  exit 1
fi

rm -r "$tree/docs" "$tree/core" "$tree/solvers"
if ! output=$("$here/glossary.sh" "$1" "$tree"); then
  printf 'found where nothing is:\n%s\n' "$output" >&2
  exit 1
fi
