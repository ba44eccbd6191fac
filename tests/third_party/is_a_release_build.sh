#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# is_a_release_build.sh PREFIX PROJECT COMPILER: a project that links cairn and gives no build type is compiled with
# optimisation and says so; one that gives one has that.
set -euo pipefail
prefix=$1 project=$2 compiler=$3
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
fail() {
  printf 'FAILED: %s\n' "$*" >&2
  exit 1
}
# configured NAME ARGUMENT…: how the project would be compiled.
configured() {
  local name=$1
  shift
  env -u CMAKE_BUILD_TYPE cmake -S "$project" -B "$work/$name" -G "Unix Makefiles" -DCMAKE_PREFIX_PATH="$prefix" \
    -DCMAKE_CXX_COMPILER="$compiler" -DCMAKE_EXPORT_COMPILE_COMMANDS=ON "$@" >"$work/$name.log" 2>&1 ||
    fail "$(cat "$work/$name.log")"
}
configured plain
grep -q 'no build type given, so it is Release' "$work/plain.log" || fail "nothing is said: $(cat "$work/plain.log")"
grep -q -- '-O3 ' "$work/plain/compile_commands.json" || fail "not optimised: $(cat "$work/plain/compile_commands.json")"
configured debug -DCMAKE_BUILD_TYPE=Debug
grep -q 'no build type' "$work/debug.log" && fail "its build type is not seen"
grep -q -- '-O3 ' "$work/debug/compile_commands.json" && fail "its build type is replaced"
exit 0
