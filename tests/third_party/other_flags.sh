#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# other_flags.sh PREFIX SOURCE BUILD COMPILER LAUNCHER LIBCXX: the same plugin, SOURCE, with the manifest that
# cairn_add_plugin() has written in BUILD, compiled in other ways: each gives the same estimate as COMPILER with Release's
# flags, or is refused, and the message says what differs. LIBCXX: a folder with the headers of libc++ unpacked.
set -euo pipefail
prefix=$1 source=$2 build=$3 compiler=$4 launcher=$5 libcxx=$6
cairn=$prefix/bin/cairn
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
failed=0
fail() {
  printf 'FAILED: %s\n' "$*" >&2
  failed=1
}
read -ra flags <<<"$(PKG_CONFIG_PATH=$prefix/lib/pkgconfig pkg-config --cflags cairn 2>/dev/null)" || true
((${#flags[@]})) || {
  printf 'skipped: there is no pkg-config\n'
  exit 77
}
flags+=(-I"$(dirname "$source")" -fPIC -fvisibility=hidden -DNDEBUG)

# try NAME DIFFERENCE COMPILER FLAG…: the estimate is that of the first one, or the refusal has a line with a mark that matches
# DIFFERENCE.
try() {
  local name=$1 difference=$2 compiler=$3 file status=0
  shift 3
  mkdir "$work/$name"
  cp "$build/range.json" "$work/$name"
  for file in "$source" "$build/range_manifest.cpp"; do
    ${launcher:+"$launcher"} "$compiler" "${flags[@]}" "$@" -c "$file" -o "$work/$name/$(basename "$file").o" 2>"$work/log" || {
      fail "$name: $(cat "$work/log")"
      return
    }
  done
  "$compiler" -shared "$@" "$work/$name"/*.o -o "$work/$name/range.so"
  "$cairn" optimize "$(dirname "$source")/beacons.g2o" --plugin "$work/$name/range.so" -o "$work/$name.g2o" --quiet >"$work/out" 2>&1 || status=$?
  case $status in
    0)
      paste "$work/$name.g2o" "$work/release.g2o" | awk '/^VERTEX/ { n = NF / 2; for (k = 3; k <= n; ++k) if (($k - $(k + n)) ^ 2 > 1e-18) exit 1; found = 1 } END { exit !found }' ||
        fail "$name: another estimate: $(cat "$work/$name.g2o")"
      printf '%-20s works\n' "$name"
      ;;
    5)
      grep -qE "^  ! $difference" "$work/out" || fail "$name: '$difference' is not named: $(cat "$work/out")"
      printf '%-20s refused: %s\n' "$name" "$(grep '^  ! ' "$work/out" | tr -s ' ' | tr '\n' ';')"
      ;;
    *) fail "$name: cairn optimize ends with $status: $(cat "$work/out")" ;;
  esac
}
lacks() { printf '%-20s not tried: there is no %s\n' "$1" "$2"; }

alignment='Eigen [0-9.]+ max-align=.* max-align='
try release nothing "$compiler" -O3
[[ -f $work/release.g2o ]] || exit 1
try unoptimised nothing "$compiler" -O0
try c++23 nothing "$compiler" -std=c++2b -O0 -g -UNDEBUG
try avx2 "$alignment" "$compiler" -O3 -mavx2
try native "$alignment" "$compiler" -O3 -march=native
try checked_library 'libstdc\+\+ .*debug=0 .*debug=1' "$compiler" -O0 -D_GLIBCXX_DEBUG
try assertions 'libstdc\+\+ .*assertions=0.*assertions=1' "$compiler" -O1 -D_GLIBCXX_ASSERTIONS
try old_strings 'libstdc\+\+ cxx11-abi=1 .*cxx11-abi=0' "$compiler" -O0 -D_GLIBCXX_USE_CXX11_ABI=0
for other in g++ clang++; do
  [[ $("$compiler" --version) != "$("$other" --version 2>/dev/null)" ]] || continue  # tried already
  if command -v "$other" >/dev/null; then
    try "other_$other" '(gcc|clang) [0-9]+ +(gcc|clang) [0-9]+' "$other" -O0
  else
    lacks "other_$other" "$other"
  fi
done
headers=$(find "$libcxx" /usr/lib/llvm-*/include/c++/v1 -path '*/c++/v1/version' -printf '%h\n' 2>/dev/null | head -n 1) || true
if command -v clang++ >/dev/null && [[ -n $headers ]]; then
  # What the library itself is linked with does not matter: the dynamic linker finds none of the core's functions.
  try libc++ 'libstdc\+\+ .* libc\+\+ ' clang++ -O0 -nostdinc++ -isystem "$headers" -nostdlib++
else
  lacks libc++ "clang++ with libc++-dev"
fi
exit $failed
