#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# any_plugin_may_be_missing.sh PREFIX: takes the shared object of one plugin after the other away from a copy of the
# installed cairn. Whatever does not ask for it goes on working; whatever does says what is missing.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cp -R "$1/bin" "$1/lib" "$work/"
cairn=$work/bin/cairn
unset CAIRN_PLUGIN_PATH
fail() {
  printf 'FAILED: %s\n' "$*" >&2
  exit 1
}

graph=$work/ring.g2o
"$cairn" generate ring:poses=60 -o "$graph" --quiet
wanted=(
  "plugins"
  "plugins eigen"
  "bench @ring:poses=60 --linear-solver eigen --repeat 1 --no-memory"
  "info $graph"
  "convert $graph $work/copy.g2o"
  "generate manhattan:poses=50 -o $work/manhattan.g2o"
  "generate sphere:turns=5,poses_per_turn=10 -o $work/sphere.g2o"
  "optimize @bundle:cameras=6,points=100 --optimizer levenberg_marquardt"
  "optimize $graph --linear-solver block_cholesky --optimizer gauss_newton"
  "optimize $graph --linear-solver cholmod --optimizer levenberg_marquardt"
  "optimize $graph --linear-solver eigen --optimizer dogleg"
  "optimize $graph --optimizer ceres"
  "optimize $graph --initial odometry --loss huber"
)

# A build without one of these plugins tests the others.
commands=()
for command in "${wanted[@]}"; do
  # shellcheck disable=SC2086  # a command is words
  if "$cairn" $command --quiet >"$work/out" 2>&1; then
    commands+=("$command")
  elif grep -q 'there is no' "$work/out"; then
    printf 'left out of this build: cairn %s\n' "$command"
  else
    fail "with all plugins, cairn $command: $(cat "$work/out")"
  fi
done

# Which shared objects a command needs is seen from what happens without each: it ends well, or with 5 and the
# name of what is missing. Nothing else is allowed, and listing always works where its own command is there.
broken=0
for library in "$work"/lib/cairn/*.so; do
  name=$(basename "$library")
  mv "$library" "$work/aside"
  failures=0
  for command in "${commands[@]}"; do
    status=0
    # shellcheck disable=SC2086  # a command is words
    "$cairn" $command --quiet >"$work/out" 2>&1 || status=$?
    if ((status == 5)) && grep -q "$name is missing" "$work/out"; then
      failures=$((failures + 1))
      [[ $command != plugins || $name == commands.so ]] || fail "cairn plugins needs $name"
    elif ((status != 0)); then
      fail "without $name, cairn $command ended with $status: $(cat "$work/out")"
    fi
  done
  ((failures == 0)) || broken=$((broken + 1))
  [[ $name == commands.so ]] || ((failures < ${#commands[@]} - 1)) || fail "no command but plugins works without $name"
  printf 'without %-24s %d of %d commands work\n' "$name" $((${#commands[@]} - failures)) ${#commands[@]}
  mv "$work/aside" "$library"
done
((broken > 0)) || fail "no shared object was ever missed: nothing was tested"

# Asked for by name, it says what is missing and what there is instead.
[[ -e $work/lib/cairn/cholmod.so ]] || exit 0
rm "$work/lib/cairn/cholmod.so"
status=0
"$cairn" optimize "$graph" --linear-solver cholmod --quiet >"$work/out" 2>&1 || status=$?
((status == 5)) || fail "a missing solver ended with $status"
for text in "linear solver 'cholmod'" "cholmod.so is missing" block_cholesky eigen; do
  [[ $text == *cholmod* || -e $work/lib/cairn/$text.so ]] || continue
  grep -qF "$text" "$work/out" || fail "no '$text' in: $(cat "$work/out")"
done

# Where Debian packages are installed, and not that of this plugin.
rm "$work/lib/cairn/cholmod.json"
"$cairn" optimize "$graph" --linear-solver cholmod --quiet >"$work/out" 2>&1 && fail "a missing solver was found"
grep -q 'Debian package' "$work/out" && fail "a package is named that nobody knows: $(cat "$work/out")"
printf 'linear_solver spqr cairn-plugin-spqr\nlinear_solver cholmod cairn-plugin-cholmod\n' >"$work/lib/cairn/packages.txt"
"$cairn" optimize "$graph" --linear-solver cholmod --quiet >"$work/out" 2>&1 && fail "a missing solver was found"
grep -q 'it is in the Debian package cairn-plugin-cholmod$' "$work/out" || fail "its package is not named: $(cat "$work/out")"
