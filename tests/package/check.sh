#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# check.sh FOLDER: the Debian packages in FOLDER, without installing them: no file twice; libraries found from where the
# packages are, and nothing of where they were built; packages of cairn need one another in one version; no library under
# the GPL but where the package says so; and unpacked into any folder, the program and the Python package work and find
# their plugins.
set -euo pipefail
packages=$(cd "$1" && pwd)
source=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
failed=0
fail() {
  printf 'FAILED: %s\n' "$*" >&2
  failed=1
}
shopt -s nullglob
debs=("$packages"/*.deb)
((${#debs[@]} >= 3)) || {
  printf 'no packages in %s\n' "$packages" >&2
  exit 1
}

# By package: its files, and together unpacked in one folder.
root=$work/root
for deb in "${debs[@]}"; do
  name=$(dpkg-deb -f "$deb" Package)
  mkdir -p "$work/apart/$name"
  dpkg-deb -x "$deb" "$work/apart/$name"
  dpkg-deb -x "$deb" "$root"
  (cd "$work/apart/$name" && find . ! -type d) >>"$work/files"
done
sort "$work/files" | uniq -d >"$work/twice"
[[ ! -s $work/twice ]] || fail "in several packages: $(tr '\n' ' ' <"$work/twice")"

# Versions and dependences among the packages, licences.
version=$(dpkg-deb -f "$packages"/cairn_*.deb Version)
libraries=$(cd "$work/apart" && printf '%s\n' libcairn[0-9]*)
for deb in "${debs[@]}"; do
  name=$(dpkg-deb -f "$deb" Package)
  depends=$(dpkg-deb -f "$deb" Depends)
  [[ $(dpkg-deb -f "$deb" Version) == "$version" ]] || fail "$name has another version than cairn"
  [[ $name == "$libraries" || ", $depends," == *", $libraries (= $version),"* ]] ||
    fail "$name does not need $libraries in its own version: $depends"
  for file in copyright changelog.gz changelog.Debian.gz; do
    [[ -s $work/apart/$name/usr/share/doc/$name/$file ]] || fail "$name has no $file"
  done
done

# Whether a file names the folder of the sources, or of the build in it. What lies there tells it from others: /usr/lib/cairn
# is not in /cairn, where the image has its sources.
inside=$(find "$source" -mindepth 1 -maxdepth 1 -type d -name '[a-z]*' -printf '%f\n' | paste -sd '|')
names_sources() {
  local status=0
  grep -qaP "(^|[^\\w./]|-I)\\Q$source\\E/($inside)(/|[^\\w.-]|\$)" "$1" || status=$?
  ((status < 2)) || fail "grep cannot read $1"
  return $status
}

# What is compiled: how it finds libraries, and what it says of the machine that it was built on.
folders=$(cd "$root" && find . -type f -name 'libcairn*.so.*' -printf '%h\n' | sort -u)
[[ $(wc -l <<<"$folders") == 1 ]] || fail "libraries in several folders: $folders"
while IFS= read -r file; do
  readelf -h "$file" >/dev/null 2>&1 || continue
  readelf -d "$file" >"$work/dynamic"
  what=${file#"$work/apart/"}
  grep -q '(RPATH)' "$work/dynamic" && fail "$what has an RPATH"
  runpath=$(sed -n 's/.*(RUNPATH).*\[\(.*\)\]/\1/p' "$work/dynamic")
  [[ -z $runpath || ($runpath == "\$ORIGIN"* && $runpath != *:*) ]] || fail "$what looks for libraries in $runpath"
  if names_sources "$file"; then fail "$what names the folder of its sources"; fi
  [[ $file != *.a ]] || continue  # is linked into what needs it
  # All of it, in the folder that has all packages.
  LD_LIBRARY_PATH='' ldd "$root/${what#*/}" >"$work/ldd" || fail "ldd $what"
  grep -q 'not found' "$work/ldd" && fail "$what: $(grep 'not found' "$work/ldd" | tr '\n' ' ')"
  grep -q 'libcairn' "$work/ldd" && {
    grep 'libcairn' "$work/ldd" | grep -qvF "=> $root/" && fail "$what takes $(grep libcairn "$work/ldd" | tr '\n' ' ')"
  }
  case ${what%%/*} in
    cairn | libcairn* | python3-cairn | cairn-plugin-lapack | cairn-plugin-exploration)
      grep -qE 'lib(cholmod|spqr|ceres|umfpack|klu)' "$work/ldd" && fail "$what needs a library under the GPL"
      ;;
  esac
done < <(find "$work/apart" -type f)

# Used from there.
unset CAIRN_PLUGIN_PATH LD_LIBRARY_PATH
export XDG_DATA_HOME=$work/no_user_data
cairn=$root/usr/bin/cairn
"$cairn" plugins --json "$work/plugins.json" >/dev/null || fail "cairn plugins ends with $?"
[[ $(grep -o '"file": *"[^"]*"' "$work/plugins.json" | sort -u | wc -l) == $(find "$root" -path '*/cairn/*.json' | wc -l) ]] ||
  fail "not all plugins are found, or others"
grep -o '"file": *"[^"]*"' "$work/plugins.json" | grep -vF "\"$root/" && fail "plugins are found elsewhere"
# Where a package is not installed, its name is known all the same.
names=$(find "$root" -path '*/cairn/packages.txt')
while read -r kind name package; do
  find "$work/apart/$package" -name '*.json' -exec grep -hF "\"kind\": \"$kind\", \"name\": \"$name\"" {} + >"$work/out" ||
    fail "$package has no $kind $name"
done <"$names"
for package in "$work"/apart/cairn-plugin-*; do
  grep -q " $(basename "$package")\$" "$names" || fail "nothing of $(basename "$package") is in $names"
done
"$cairn" generate manhattan:poses=300 -o "$work/graph.g2o" --quiet --seed 7 >"$work/out" || fail "cairn generate: $(cat "$work/out")"
"$cairn" optimize "$work/graph.g2o" -o "$work/best.g2o" --quiet >"$work/out" || fail "cairn optimize ends with $?"
grep -q 'status *converged' "$work/out" || fail "cairn optimize: $(cat "$work/out")"
if [[ -d $work/apart/python3-cairn ]]; then
  PYTHONPATH=$root/usr/lib/python3/dist-packages PYTHONDONTWRITEBYTECODE=1 /usr/bin/python3 -c '
import sys, cairn
graph = cairn.read(sys.argv[1])
assert cairn.optimize(graph).converged and cairn.__file__.startswith(sys.argv[2]), cairn.__file__
' "$work/graph.g2o" "$root/" || fail "the Python package"
fi

# Debian's own rules, where its checker is there.
if command -v lintian >/dev/null; then
  lintian --allow-root --fail-on error,warning --suppress-tags initial-upload-closes-no-bugs "${debs[@]}" >"$work/lintian" 2>&1 ||
    fail "lintian: $(cat "$work/lintian")"
else
  printf 'without lintian, Debian'\''s own rules are not checked\n' >&2
fi
((failed)) || printf '%d packages of cairn %s: %d files, each in one; unpacked they work\n' ${#debs[@]} "$version" "$(wc -l <"$work/files")"
exit $failed
