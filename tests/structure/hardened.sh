#!/usr/bin/env bash
# Usage: hardened.sh FILE...: each binary is position-independent, has read-only relocations that are bound at the start,
# a stack that is not executable, protected stacks and checked calls of the C library (SECURITY.md).
set -euo pipefail
failed=0
for file; do
  lacks=()
  header=$(readelf -hW "$file") segments=$(readelf -lW "$file") dynamic=$(readelf -dW "$file") symbols=$(readelf -sW "$file")
  grep -q 'Type: *DYN' <<<"$header" || lacks+=("position independence")
  grep -q GNU_RELRO <<<"$segments" || lacks+=("read-only relocations")
  grep -q 'GNU_STACK.* RW ' <<<"$segments" || lacks+=("a stack that is not executable")
  grep -q BIND_NOW <<<"$dynamic" || lacks+=("binding at the start")
  grep -q __stack_chk_fail <<<"$symbols" || lacks+=("stack protection")
  if ((${#lacks[@]})); then
    printf '%s lacks:\n' "$file"
    printf '  %s\n' "${lacks[@]}"
    failed=1
  fi
  fortified+=$(grep -o '__[a-z]*_chk@' <<<"$symbols" || true)
done
[[ -n ${fortified:-} ]] || {
  echo 'no binary has checked calls of the C library (_FORTIFY_SOURCE)'
  failed=1
}
exit "$failed"
