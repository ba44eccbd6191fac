#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# solves_beacons.sh PREFIX PLUGINS GRAPH: the installed cairn reads a graph with a third party's factor and solves it
# with a third party's linear solver.
set -euo pipefail
prefix=$1 plugins=$2 graph=$3
cairn=$prefix/bin/cairn
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
fail() {
  printf 'FAILED: %s\n' "$*" >&2
  exit 1
}

# Without the plugin, the tag is an error that names the line.
env -u CAIRN_PLUGIN_PATH "$cairn" info "$graph" >"$work/out" 2>&1 && fail "the graph was read without the plugin"
grep -q 'EDGE_RANGE_SE2_XY' "$work/out" || fail "the unknown tag is not named: $(cat "$work/out")"

export CAIRN_PLUGIN_PATH=$plugins
"$cairn" plugins >"$work/out"
for name in EDGE_RANGE_SE2_XY dense_ldlt; do
  grep -qw "$name" "$work/out" || fail "cairn plugins does not list $name"
done

# solve SOLVER: leaves the estimate in SOLVER.g2o and the final chi2 in SOLVER.json
solve() {
  "$cairn" optimize "$graph" --optimizer gauss_newton --linear-solver "$1" --tolerance 0 --iterations 20 \
    --quiet -o "$work/$1.g2o" --json "$work/$1.json" || fail "cairn optimize --linear-solver $1 ended with $?"
}
solve dense_ldlt
solve block_cholesky
grep -q '"linear_solver": *"dense_ldlt"' "$work/dense_ldlt.json" || fail "another linear solver was used"

# The measurements are exact, so the beacons are found where they are, by either solver.
for solver in dense_ldlt block_cholesky; do
  awk '
    BEGIN { x[100] = 4; y[100] = 1; x[101] = -3; y[101] = 6; x[102] = 2; y[102] = 12 }
    $1 == "VERTEX_XY" {
      found++
      if (($3 - x[$2]) ^ 2 + ($4 - y[$2]) ^ 2 > 1e-12) { print "beacon", $2, "is at", $3, $4; bad = 1 }
    }
    END { if (found != 3) { print found + 0, "beacons"; bad = 1 }; exit bad }' \
    "$work/$solver.g2o" || fail "$solver did not find the beacons"
done

# By file, too, and what a factor refuses is refused with its line.
"$cairn" plugins --plugin "$plugins/dense_ldlt.so" dense_ldlt | grep -q 'dense LDLT' || fail "--plugin FILE"
sed 's/^\(EDGE_RANGE_SE2_XY 0 100\) [^ ]*/\1 -3/' "$graph" >"$work/negative.g2o"
line=$(grep -n '^EDGE_RANGE_SE2_XY 0 100' "$graph" | cut -d: -f1)
status=0
"$cairn" info "$work/negative.g2o" >"$work/out" 2>&1 || status=$?
((status == 3)) || fail "a negative distance ended with $status"
grep -q "negative.g2o:$line.*a measured distance must be positive" "$work/out" ||
  fail "a negative distance says: $(cat "$work/out")"
