#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# listing_opens_no_plugin.sh PREFIX: `cairn plugins` reads the small file beside each shared object, and opens none but the
# one that it is in itself.
set -euo pipefail
prefix=$1
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
unset CAIRN_PLUGIN_PATH
export ASAN_OPTIONS=detect_leaks=0 # the leak check cannot run under strace
strace -o "$work/probe" true 2>/dev/null || {
  echo "strace is not there, or not allowed here"
  exit 77
}

# opened COMMAND...: the files below lib/cairn that the program opened, with that ending
opened() {
  local ending=$1
  shift
  strace -f -qq -e trace=open,openat,openat2 -o "$work/log" "$prefix/bin/cairn" "$@" >"$work/out"
  grep -oE "\"[^\"]*/lib/cairn/[^\"]*\.$ending\"" "$work/log" | sort -u || true
}

count=$(find "$prefix/lib/cairn" -name '*.so' | wc -l)
sidecars=$(opened json plugins | wc -l)
libraries=$(opened so plugins | grep -v '/commands.so"' || true) # that of the command itself
if ((count == 0 || sidecars != count)); then
  echo "FAILED: $count plugins, but $sidecars sidecar files were read"
  exit 1
fi
if [[ -n $libraries ]]; then
  printf 'FAILED: cairn plugins opened\n%s\n' "$libraries"
  exit 1
fi
# The same trap must catch what does open one, or it proves nothing. One name's options are in its shared object.
if [[ $(opened so plugins block_cholesky) != *block_cholesky.so* ]]; then
  echo "FAILED: strace did not see the plugin that was asked for"
  exit 1
fi
echo "$count plugins listed, none opened"
