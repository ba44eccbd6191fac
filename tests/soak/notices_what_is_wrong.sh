#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Every kind of violation is found in a program that does all of them, and in one that is not there an error.
#
#   notices_what_is_wrong.sh DRIVER CARELESS LIBRARY FOLDER
set -euo pipefail
driver=$1 careless=$2 library=$3 folder=$4

code=0
found=$("$driver" --program "$careless" --library "$library" --folder "$folder" --rounds 100) || code=$?
printf '%s\n' "$found"
[[ $code == 1 ]] || { printf 'exit code %s; expected 1\n' "$code" >&2; exit 1; }
for violation in 'was acknowledged, and is not in the journal' 'ESTIMATE ALL differs' \
  'map.g2o differs' 'ends with signal 15; expected exit code 130' 'ends with exit code 0; expected exit code 3' \
  'ends with signal 13' "the long session's memory grew"; do
  [[ $found == *"$violation"* ]] || { printf 'not found: %s\n' "$violation" >&2; exit 1; }
done

code=0
"$driver" --program "$folder/none" --library "$library" --folder "$folder" --rounds 1 >/dev/null || code=$?
[[ $code == 1 ]] || { printf 'a program that is not there: exit code %s; expected 1\n' "$code" >&2; exit 1; }
