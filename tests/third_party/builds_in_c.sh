#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# builds_in_c.sh PREFIX EXAMPLE BUILD: the example in C against the installed cairn, by CMake without C++, and by pkg-config with a
# compiler for C alone; its estimate is the mean of odometry and loop, weighted by their information.
set -euo pipefail
prefix=$1 example=$2 build=$3
command -v cc >/dev/null || {
  echo 'without a compiler for C' >&2
  exit 77
}
unset CAIRN_PLUGIN_PATH
fail() {
  printf 'FAILED: %s\n' "$*" >&2
  exit 1
}
# Of odometry: 10 m with ten times the variance 0.01 m²; of the loop: 10.2 m with 0.0004 m².
expected='pose 10: x 10.199 m, sigma 0.020 m'

rm -rf "$build"
cmake -S "$example" -B "$build" -DCMAKE_PREFIX_PATH="$prefix" -DCMAKE_BUILD_TYPE=Release >"$build.log" 2>&1 || {
  cat "$build.log" >&2
  fail 'configuring'
}
cmake --build "$build" >>"$build.log" 2>&1 || {
  cat "$build.log" >&2
  fail 'building'
}
out=$("$build/corridor") || fail "the program ends with $?"
[[ $out == "$expected" ]] || fail "the program writes $out; expected $expected"

command -v pkg-config >/dev/null || exit 0
file=$(find "$prefix" -name cairn_c.pc)
[[ -f $file ]] || fail "no cairn_c.pc below $prefix"
export PKG_CONFIG_PATH=${file%/*}
read -ra flags <<<"$(pkg-config --cflags cairn_c)"
read -ra libraries <<<"$(pkg-config --libs cairn_c)"
cc -std=c11 -Wall -Wextra -pedantic-errors -Werror "${flags[@]}" -o "$build/plain" "$example/main.c" "${libraries[@]}" -lm ||
  fail "compiling with ${flags[*]} ${libraries[*]}"
out=$(LD_LIBRARY_PATH=$(pkg-config --variable=libdir cairn_c) "$build/plain") || fail "the program ends with $?"
[[ $out == "$expected" ]] || fail "the program writes $out; expected $expected"
