#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# builds_with_pkg_config.sh PREFIX COMPILER: a program of three lines, compiled with the flags that pkg-config gives for the
# installed cairn, solves a graph with the installed plugins. Moved elsewhere, the installation still gives its own flags.
set -euo pipefail
prefix=$1 compiler=$2
command -v pkg-config >/dev/null || {
  echo 'without pkg-config' >&2
  exit 77
}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
fail() {
  printf 'FAILED: %s\n' "$*" >&2
  exit 1
}
file=$(find "$prefix" -name cairn.pc)
[[ -f $file ]] || fail "no cairn.pc below $prefix"
export PKG_CONFIG_PATH=${file%/*}
unset CAIRN_PLUGIN_PATH
pkg-config --print-errors --exists 'cairn >= 0.1' || fail "cairn.pc"

cat >"$work/ring.cpp" <<'END'
#include <cairn/cairn.hpp>
#include <iostream>
int main() { cairn::Graph g; g.add(0, cairn::Pose2()); g.add(1, cairn::Pose2(3, 0, 0)); g.add(cairn::Between(0, 1, cairn::Pose2(2, 1, 0)), cairn::Information::sigmas(0.1, 0.1, 0.1)); cairn::optimize(g); std::cout << g.at<cairn::Pose2>(1) << "\n"; }
END
read -ra flags <<<"$(pkg-config --cflags cairn)"
read -ra libraries <<<"$(pkg-config --libs cairn)"
"$compiler" "${flags[@]}" -o "$work/ring" "$work/ring.cpp" "${libraries[@]}" || fail "compiling with ${flags[*]} ${libraries[*]}"
out=$(LD_LIBRARY_PATH=$(pkg-config --variable=libdir cairn) "$work/ring") || fail "the program ends with $?"
[[ $out == 'Pose2(2, 1, '* ]] || fail "the program says $out"

cp -r "${file%/*}" "$work/lib"
[[ $(PKG_CONFIG_PATH=$work/lib pkg-config --variable=libdir cairn) != "$(pkg-config --variable=libdir cairn)" ]] ||
  fail "cairn.pc names the folder that it was installed to"
