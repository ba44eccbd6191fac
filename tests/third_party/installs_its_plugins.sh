#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# installs_its_plugins.sh PREFIX BUILD USER_DATA GRAPH: what `cmake --install` of a third party's plugins puts where, seen
# by the installed cairn. BUILD was configured without a build type, a licence or a place to install to, and with
# XDG_DATA_HOME=USER_DATA.
set -euo pipefail
prefix=$1 build=$2 user_data=$3 graph=$4
cairn=$prefix/bin/cairn
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
unset CAIRN_PLUGIN_PATH
fail() {
  printf 'FAILED: %s\n' "$*" >&2
  exit 1
}
export XDG_DATA_HOME=$user_data
rm -rf "$user_data" # of an earlier run

# Optimised, although nobody asked for it.
"$cairn" plugins --plugin "$build/dense_ldlt.so" dense_ldlt --json - >"$work/dense.json"
grep -q '"optimized": *true' "$work/dense.json" || fail "not optimised: $(cat "$work/dense.json")"
"$cairn" plugins --plugin "$build/dense_ldlt.so" dense_ldlt >"$work/dense.txt"
grep -q 'unoptimised' "$work/dense.txt" && fail "$(cat "$work/dense.txt")"

# Installed, it is found by nothing but its place, and by nobody else.
"$cairn" info "$graph" >"$work/out" 2>&1 && fail "the graph was read before the plugin was installed"
cmake --install "$build" >"$work/log"
for file in range.so range.json dense_ldlt.so dense_ldlt.json; do
  [[ -f $user_data/cairn/plugins/$file ]] || fail "no $file in $user_data: $(cat "$work/log")"
done
"$cairn" optimize "$graph" --linear-solver dense_ldlt --quiet -o "$work/optimized.g2o" ||
  fail "the installed plugins were not found"
XDG_DATA_HOME=$work "$cairn" info "$graph" >"$work/out" 2>&1 && fail "another user sees the plugin too"

# It keeps working when what it was built in is gone: all libraries are found from where it is now.
readelf -d "$user_data/cairn/plugins/range.so" >"$work/dynamic"
grep -qF "$build" "$work/dynamic" && fail "it looks for libraries in $build: $(cat "$work/dynamic")"

# A licence that nobody stated is not made up.
"$cairn" plugins --json - >"$work/all.json"
tr -d '\n' <"$work/all.json" | grep -oE '\{[^{}]*"dense_ldlt"[^{}]*\}' >"$work/offer"
grep -q '"licence": *"unstated"' "$work/offer" || fail "its licence: $(cat "$work/offer")"

# Below a prefix, where that is wanted.
cmake -DCAIRN_PLUGIN_INSTALL_FOLDER=lib/cairn "$build" >"$work/log"
cmake --install "$build" --prefix "$work/prefix" >>"$work/log"
cmake -UCAIRN_PLUGIN_INSTALL_FOLDER "$build" >>"$work/log"
[[ -f $work/prefix/lib/cairn/range.so && -f $work/prefix/lib/cairn/range.json ]] ||
  fail "not below the prefix: $(cat "$work/log")"
