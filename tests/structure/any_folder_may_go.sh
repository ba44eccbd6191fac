#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# any_folder_may_go.sh [--quick] [FOLDER...]: in a copy of the sources, deletes the folder of one plugin or subject after the
# other (or those given), configures and builds what is left, and runs the tests that are left. A subject (plugins/NAME) is
# then built alone, against what is left as it is installed, and its plugins pass `cairn plugins --check`. With --quick it
# builds the program and the plugins, without the tests, and looks at what the program still offers. By hand: all folders
# take hours.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
tests=ON
if [[ ${1:-} == --quick ]]; then
  tests=OFF
  shift
fi
# Libraries that several plugins share are no plugins: what needs them goes with them.
shared=' solvers/block solvers/linear/blas solvers/linear/iterative solvers/nonlinear/descent '

tree=build/any_folder
rm -rf "$tree/aside"
mkdir -p "$tree/aside"
# The build of the last run is kept.
find "$tree" -mindepth 1 -maxdepth 1 ! -name build ! -name aside -exec rm -rf {} +
git ls-files -z --cached --others --exclude-standard | xargs -0 tar --ignore-failed-read -cf - 2>/dev/null |
  tar -xf - -C "$tree"
cd "$tree"
unset CAIRN_PLUGIN_PATH
export CMAKE_GENERATOR=Ninja CCACHE_BASEDIR=$PWD CCACHE_NOHASHDIR=1  # what ccache has of the checkout fits
XDG_DATA_HOME=$PWD/aside
export XDG_DATA_HOME

folders=("$@")
if ((${#folders[@]} == 0)); then
  for list in types/*/CMakeLists.txt solvers/*/*/CMakeLists.txt plugins/*/CMakeLists.txt; do
    folder=${list%/CMakeLists.txt}
    [[ $shared == *" $folder "* ]] || folders+=("$folder")
  done
fi

# judge PROGRAM: its log is good if it ran to the end and every test that failed asked for what is missing, by which
# ctest would skip it.
judge() {
  grep -q '^\[==========\] [0-9]* tests* from .* ran' "$1.log" || {
    printf 'FAILED: %s ends early\n' "$1"
    tail -n 5 "$1.log"
    return 1
  }
  awk -v missing="$(cat build/release/tests/missing_plugins)" '
    /^\[ RUN / { block = "" }
    { block = block "\n" $0 }
    /^\[  FAILED  \] .* \([0-9]+ ms\)$/ && block !~ missing { print block; bad = 1 }
    END { exit bad }' "$1.log"
}
export -f judge

# run_tests: the test programs whole, two at a time, which takes half of the time of a process per test; then what is no
# program of GoogleTest.
run_tests() {
  # shellcheck disable=SC2016  # the inner shell expands it
  find build/release/tests -maxdepth 1 -type f -perm -u+x \( -name '*_test' -o -name '*_tests' \) -print0 |
    xargs -0 -P "$(nproc)" -I{} bash -c '"$1" >"$1.log" 2>&1 || judge "$1"' _ {} &&
    ctest --test-dir build/release --output-on-failure -j "$(nproc)" -LE googletest
}

# without FOLDER: everything but it, from configuring to the tests. All plugins are linked again, so that none is left
# over from the run before, and test programs that are no longer built are removed.
without() {
  rm -rf build/release/lib/cairn
  cmake --preset release -DCAIRN_WERROR=ON -DCAIRN_TESTS=$tests &&
    ninja -C build/release -t cleandead &&
    cmake --build build/release -j "$(nproc)" &&
    build/release/bin/cairn plugins &&
    { [[ $tests == OFF ]] || run_tests; }
}

# alone SUBJECT: against what was built without it, installed; and it does what it offers.
alone() {
  local prefix=$PWD/aside/prefix build=$PWD/aside/alone plugin
  rm -rf "$prefix" "$build"
  cmake --install build/release --prefix "$prefix" >/dev/null &&
    cmake -S "$1" -B "$build" -DCMAKE_PREFIX_PATH="$prefix" -DCMAKE_CXX_COMPILER_LAUNCHER=ccache \
      -DCAIRN_PLUGIN_INSTALL_FOLDER=lib/cairn &&
    cmake --build "$build" -j "$(nproc)" &&
    cmake --install "$build" --prefix "$prefix" >/dev/null &&
    "$prefix/bin/cairn" plugins || return
  while IFS= read -r plugin; do
    "$prefix/bin/cairn" plugins --check "$prefix/lib/cairn/${plugin##*/}" || return
  done < <(find "$build" -name '*.so' -not -name 'lib*')
}

failed=()
for folder in "${folders[@]}"; do
  [[ -f $folder/CMakeLists.txt ]] || {
    printf '%s: no folder of a plugin\n' "$folder" >&2
    exit 2
  }
  log=aside/${folder//\//_}.log
  mv "$folder" aside/gone
  if without >"$log" 2>&1; then
    offered=$(build/release/bin/cairn plugins --json - | grep -c '"kind"' || true)
    printf 'without %-36s %s names on offer\n' "$folder" "$offered"
  else
    printf 'without %-36s FAILED: %s\n' "$folder" "$tree/$log"
    grep -m 5 -iE 'error|\*\*\*Failed|FAILED' "$log" || tail -n 5 "$log"
    failed+=("$folder")
  fi
  mv aside/gone "$folder"
  if [[ $folder == plugins/* ]]; then
    if alone "$folder" >"${log%.log}_alone.log" 2>&1; then
      printf 'alone   %-36s against the rest, installed\n' "$folder"
    else
      printf 'alone   %-36s FAILED: %s\n' "$folder" "$tree/${log%.log}_alone.log"
      tail -n 5 "${log%.log}_alone.log"
      failed+=("$folder, alone")
    fi
  fi
done
if ((${#failed[@]})); then
  printf 'the rest does not do without: %s\n' "${failed[*]}" >&2
  exit 1
fi
