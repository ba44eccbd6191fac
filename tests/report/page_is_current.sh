#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# page_is_current.sh APPS/REPORT: builds the page in a copy of its sources and compares it with dist/report.html.
set -euo pipefail
sources=$1
if [[ ! -x $sources/node_modules/.bin/vite ]] || ! command -v node >/dev/null; then
  echo "no Node with the page's packages here (npm ci in apps/report)"
  exit 77
fi
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cp -r "$sources"/. "$work" 2>/dev/null || true
(cd "$work" && rm -rf dist && node node_modules/vite/bin/vite.js build >build.log 2>&1) || {
  cat "$work/build.log"
  exit 1
}
cmp "$work/dist/report.html" "$sources/dist/report.html" || {
  echo "FAILED: run npm run build in apps/report"
  exit 1
}
