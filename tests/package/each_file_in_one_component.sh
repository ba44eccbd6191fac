#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# each_file_in_one_component.sh BUILD COMPONENT…: what `cmake --install` puts down as a whole is what its components put
# down one by one, each file once. A file without a component would be in no Debian package.
set -euo pipefail
build=$1
shift
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
fail() {
  printf 'FAILED: %s\n' "$*" >&2
  exit 1
}
cmake --install "$build" --prefix "$work/whole" >"$work/log"
(cd "$work/whole" && find . ! -type d | sort) >"$work/expected"
for component; do
  [[ $component != Unspecified ]] || fail "an install() without COMPONENT"
  cmake --install "$build" --prefix "$work/$component" --component "$component" >"$work/log"
  (cd "$work/$component" && find . ! -type d) >"$work/files" || fail "$component has no files"
  [[ -s $work/files ]] || fail "$component has no files"
  cat "$work/files" >>"$work/found"
done
sort "$work/found" | uniq -d >"$work/twice"
[[ ! -s $work/twice ]] || fail "in several components: $(cat "$work/twice")"
sort "$work/found" | diff "$work/expected" - || fail "in no component, or not in the whole"
