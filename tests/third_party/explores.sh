#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# explores.sh PREFIX PLUGINS: the installed cairn drives a robot by a third party's explorer.
set -euo pipefail
prefix=$1 plugins=$2
cairn=$prefix/bin/cairn
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
fail() {
  printf 'FAILED: %s\n' "$*" >&2
  exit 1
}

export CAIRN_PLUGIN_PATH=$plugins
"$cairn" explore @rooms:width=10,height=8,seed=2 --explorer longest --registration simulated:range=1 \
  --until distance=40 --quiet --json "$work/report.json" >"$work/out" || fail "cairn explore ended with $?"
grep -q '"explorer": *"longest"' "$work/report.json" || fail "another explorer was used"
awk -F'[:,]' '/"seen"/ { seen = $2 } /"floor": *[0-9]/ { floor = $2 } END { exit !(seen > 0.9 * floor && floor > 0) }' \
  "$work/report.json" || fail "it has not seen the floor: $(cat "$work/out")"
