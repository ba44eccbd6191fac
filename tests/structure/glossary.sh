#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# Fails where a text for readers uses a word of the table "Words to avoid" of docs/glossary.md, and names file and line.
# Texts for readers: the documentation; messages, --help texts and descriptions of plugins (string literals); and the
# comments of headers.
#
#   glossary.sh SOURCE_FOLDER [FOLDER]    FOLDER: of the texts searched, instead of SOURCE_FOLDER (for the test of this)
set -eu
here=$(cd "$(dirname "$0")" && pwd)
source=$(cd "$1" && pwd)
searched=$(cd "${2:-$1}" && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# The patterns stand in backticks in the first column, where "|" is written "\|", as Markdown's tables want it.
awk '/^## /{in_table = /^## Words to avoid/}
     in_table && /^\| *`/ {
       line = substr($0, 2)
       while (match(line, /^[ ,]*`[^`]*`/)) {
         pattern = substr(line, RSTART, RLENGTH)
         sub(/^[ ,]*`/, "", pattern); sub(/`$/, "", pattern)
         gsub(/\\\|/, "|", pattern)
         print pattern
         line = substr(line, RLENGTH + 1)
       }
       if (line !~ /^ *\|/) { print "unreadable row: " $0 > "/dev/stderr"; exit 1 }
     }' "$source/docs/glossary.md" > "$work/patterns"
[ "$(wc -l < "$work/patterns")" -ge 20 ] || { echo "docs/glossary.md: hardly any patterns; is the table there?" >&2; exit 1; }

# The texts, each at its line, in a copy of the tree.
cd "$searched"
mkdir "$work/texts"
for place in docs README.md CHANGELOG.md CONTRIBUTING.md SECURITY.md examples apps/cairn apps/python core lib types solvers plugins; do
  [ ! -e "$place" ] || find "$place" -type f \( -name '*.md' -o -name '*.hpp' -o -name '*.cpp' -o -name CMakeLists.txt \)
done | grep -v '^docs/glossary\.md$' > "$work/files"
[ -s "$work/files" ] || { echo "no files to search in $searched" >&2; exit 1; }
while IFS= read -r file; do
  case $file in
    *.md) kind=prose ;;
    *.hpp) kind=header ;;
    *) kind=source ;;
  esac
  mkdir -p "$work/texts/$(dirname "$file")"
  awk -v kind="$kind" -f "$here/glossary_text.awk" "$file" > "$work/texts/$file"
done < "$work/files"

cd "$work/texts"
status=0
while IFS= read -r pattern; do
  found=0
  grep -rEin -e "$pattern" . > "$work/found" || found=$?
  [ "$found" -le 1 ] || { echo "docs/glossary.md: not an extended regular expression: $pattern" >&2; exit 1; }
  [ "$found" -eq 0 ] || continue
  status=1
  sed "s|^\./||; s|\$|    (docs/glossary.md: $(printf '%s' "$pattern" | sed 's/[&|\\]/\\&/g'))|" "$work/found"
done < "$work/patterns"
exit $status
