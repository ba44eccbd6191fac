#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Every kind of violation is found in a program that does all of them, and in one that is not there an error.
#
#   notices_what_is_wrong.sh DRIVER CARELESS LIBRARY FOLDER
set -euo pipefail
driver=$1 careless=$2 library=$3 folder=$4

# expect_violations WHAT... -- ARGUMENT...
expect_violations() {
  local expected=() found code=0 violation
  while [[ $1 != -- ]]; do
    expected+=("$1")
    shift
  done
  found=$("$driver" --program "$careless" --library "$library" --folder "$folder" --careless "${@:2}") || code=$?
  printf '%s\n' "$found"
  [[ $code == 1 ]] || { printf 'exit code %s; expected 1\n' "$code" >&2; exit 1; }
  for violation in "${expected[@]}"; do
    [[ $found == *"$violation"* ]] || { printf 'not found: %s\n' "$violation" >&2; exit 1; }
  done
}

expect_violations 'killed by' 'exit code 0, but result.txt differs' 'left behind: temporary.txt' 'exit code 1' \
  'result.txt is neither the old file nor the new one' 'one output failed, and second.txt was not written either' \
  'no message on standard error' 'nothing was lost, and yet' --

expect_violations 'left behind: temporary.txt' 'result.txt is neither the old file nor the new one' \
  'line 1 was acknowledged, and is not in the journal' 'saved.txt was acknowledged, and is the old file' \
  -- --kill --count 40

# Only what is killed after its last record has this wrong: at a random moment of up to 400.
restored=
for seed in {1..10}; do
  restored=$("$driver" --program "$careless" --library "$library" --folder "$folder" --careless --kill --count 40 \
    --seed "$seed") || true
  [[ $restored != *'its journal leads to another map'* ]] || break
done
[[ $restored == *'its journal leads to another map'* ]] || { printf 'not found: another map\n' >&2; exit 1; }

code=0
"$driver" --program "$folder/none" --library "$library" --folder "$folder" --careless 2>/dev/null || code=$?
[[ $code == 2 ]] || { printf 'a program that is not there: exit code %s; expected 2\n' "$code" >&2; exit 1; }
