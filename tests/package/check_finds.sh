#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# check_finds.sh FOLDER PLUGIN: that check.sh finds what is wrong with packages that are spoilt: those of FOLDER, whose
# program package also gets PLUGIN, a shared object under the GPL as it lies in the build, without need of one version.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
plugin=$2
[[ -f $plugin ]] || {
  printf 'without %s nothing is spoilt\n' "$plugin" >&2
  exit 0
}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cp "$1"/*.deb "$work"
dpkg-deb -R "$work"/cairn_*.deb "$work/spoilt"
cp "$plugin" "$(find "$work/spoilt" -type d -path '*/lib/*/cairn')"
sed -i 's/\(libcairn[0-9.]*\) (=[^)]*)/\1/' "$work/spoilt/DEBIAN/control"
rm "$work/spoilt/usr/share/doc/cairn/copyright"
dpkg-deb -b "$work/spoilt" "$work"/cairn_*.deb >/dev/null
rm -rf "$work/spoilt"

if "$here/check.sh" "$work" >"$work/out" 2>&1; then
  printf 'FAILED: check.sh finds nothing wrong with spoilt packages\n' >&2
  exit 1
fi
for finding in 'in several packages: .*cholmod.so' 'does not need libcairn.* in its own version' 'has no copyright' \
  'looks for libraries in /' 'names the folder of its sources' 'needs a library under the GPL'; do
  grep -q "FAILED: .*$finding" "$work/out" || {
    printf 'FAILED: check.sh does not find: %s\n' "$finding" >&2
    exit 1
  }
done
