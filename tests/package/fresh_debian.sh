#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# fresh_debian.sh PACKAGES FOLDER: in a Debian 12 that has nothing else, made in FOLDER by debootstrap, the Debian packages
# of PACKAGES are installed by apt, used as README says it, and removed without a trace. As root. Debian's packages come
# from where debootstrap takes them. FOLDER is left for looking at, and a system in it is used again.
set -euo pipefail
((EUID == 0)) || {
  printf 'as root, please\n' >&2
  exit 1
}
source=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
packages=$(cd "$1" && pwd)
mkdir -p "$2"
root=$(cd "$2" && pwd)
[[ -x $root/usr/bin/apt-get ]] || debootstrap --variant=minbase bookworm "$root"

mount -t proc proc "$root/proc"
trap 'umount "$root/proc"' EXIT
rm -rf "$root/packages" "$root/range" "$root/ros"
cp -r "$packages" "$root/packages"
cp -r "$source/tests/third_party/range" "$root/range"
mkdir -p "$root/ros/tests" "$root/ros/examples"
cp -r "$source/tests/ros" "$root/ros/tests"
cp -r "$source/examples/ros" "$root/ros/examples"

# What runs inside. Every command is shown with what it says, and must succeed.
cat >"$root/use.sh" <<'END'
set -euo pipefail
export DEBIAN_FRONTEND=noninteractive LC_ALL=C.UTF-8
run() {
  printf '\n$ %s\n' "$*"
  "$@"
}
fail() {
  printf 'FAILED: %s\n' "$*" >&2
  exit 1
}
install() { apt-get install -y -qq --no-install-recommends "$@" >/tmp/apt.log 2>&1 || { cat /tmp/apt.log; exit 1; }; }
installed() { dpkg-query -W -f='${db:Status-Status}' "$1" 2>/dev/null | grep -qx installed; }

apt-get purge -y -qq '*cairn*' >/dev/null 2>&1 || true # of an earlier run
apt-get autoremove -y -qq >/dev/null 2>&1
apt-get update -qq
cd /tmp

printf '\n==== the program alone\n'
run install /packages/cairn_*.deb /packages/libcairn0*.deb
run cairn generate manhattan:poses=1000 -o graph.g2o --ground-truth truth.g2o --seed 7
run cairn optimize graph.g2o -o best.g2o
run cairn evaluate best.g2o truth.g2o
for other in libcholmod3 libspqr2 libceres3 libopencv-core406 python3-cairn python3-matplotlib; do
  ! installed $other || fail "the program brings $other with it"
done
status=0
cairn optimize graph.g2o --linear-solver cholmod >out 2>&1 || status=$?
((status == 5)) || fail "cholmod without its package: $status"
grep -q 'it is in the Debian package cairn-plugin-cholmod' out || fail "its package is not named: $(cat out)"
cat out
status=0
cairn plot best.g2o -o best.svg >out 2>&1 || status=$?
((status == 5)) || fail "cairn plot without Python: $status"
tr '\n' ' ' <out | tr -s ' ' | grep -q 'apt install python3-matplotlib python3-cairn' || fail "what plots need is not named: $(cat out)"
cat out
zcat /usr/share/man/man1/cairn-optimize.1.gz | grep -q 'linear' || fail "no manual page of cairn optimize"
cairn complete -- optimize --linear-solver b | grep -q '^block_cholesky' || fail "no completion"

printf '\n==== the Python package\n'
run install /packages/python3-cairn_*.deb
run python3 -c 'import cairn; graph, truth = cairn.generate("sphere", seed=1); print(cairn.optimize(graph, "dogleg")); print(cairn.evaluate(graph, truth))'
[[ -n $(find /usr/lib/python3/dist-packages/cairn -name '*.pyc') ]] || fail "nothing was compiled for Python"
run install python3-matplotlib
run cairn plot best.g2o -o best.svg --quiet
run python3 -c 'import cairn; graph, _ = cairn.generate("ring", seed=1); cairn.plot.trajectory(graph).figure.savefig("ring.pdf")'

printf '\n==== plugins of their own packages\n'
run install /packages/cairn-plugin-*.deb
run cairn bench graph.g2o --optimizer levenberg_marquardt,ceres --linear-solver block_cholesky,cholmod,spqr,eigen --repeat 1 --quiet
run cairn explore @rooms --until distance=20 --seed 3 --quiet

printf '\n==== a plugin and a program of somebody else\n'
run install /packages/libcairn-dev_*.deb g++ cmake make pkg-config
rm -rf range-build my_distance my_solver # of an earlier run
run cmake -S /range -B range-build -DCMAKE_VERBOSE_MAKEFILE=OFF
run cmake --build range-build
run cmake --install range-build
run cairn optimize /range/beacons.g2o --linear-solver dense_ldlt -o beacons.g2o

# What `cairn new-plugin` writes, as its README says it: built, tested, checked, installed, and used by name.
export CTEST_OUTPUT_ON_FAILURE=1
new_plugin() {
  run cairn new-plugin "$1" "$2"
  run cmake -S "$1" -B "$1/build"
  run cmake --build "$1/build"
  run ctest --test-dir "$1/build"
  run cairn plugins --check "$1/build/$1.so"
  run cmake --install "$1/build"
}
new_plugin my_distance --factor
run cairn optimize my_distance/example.g2o -o best.g2o
run cairn bench my_distance/example.g2o --linear-solver block_cholesky,eigen --repeat 1 --quiet
run python3 -c 'import cairn; graph = cairn.read("my_distance/example.g2o"); print(graph.factor_types, cairn.optimize(graph)); assert "EDGE_MY_DISTANCE" in graph.factor_types'
new_plugin my_solver --linear-solver
run cairn generate ring:poses=100 -o ring.g2o # it is dense
run cairn optimize ring.g2o --linear-solver my_solver
run cairn bench ring.g2o --linear-solver block_cholesky,my_solver --repeat 1 --quiet
run python3 -c 'import cairn; summary = cairn.optimize(cairn.read("ring.g2o"), linear_solver="my_solver"); print(summary); assert summary.converged and summary.linear_solver == "my_solver"'

cat >two.cpp <<'CPP'
#include <cairn/cairn.hpp>
#include <iostream>
int main() { auto graph = cairn::read("graph.g2o"); std::cout << cairn::optimize(graph); }
CPP
read -ra flags <<<"$(pkg-config --cflags --libs cairn)"
run g++ -o two two.cpp "${flags[@]}"
run ./two
run env CAIRN_PLUGIN_PATH=/nowhere ./two >/dev/null

printf '\n==== with ROS\n'
printf '127.0.0.1 localhost\n' >/etc/hosts # debootstrap writes none, and roslaunch asks for it
run install /packages/cairn-ros_*.deb python3-roslaunch python3-pytest
run python3 -m pytest -q -p no:cacheprovider /ros/tests/ros/test_ros_node.py /ros/tests/ros/test_ros_conventions.py

printf '\n==== removed\n'
rm -rf ~/.local/share/cairn
dpkg -L $(dpkg-query -W -f='${Package}\n' '*cairn*') | grep cairn | sort -u >files
apt-get purge -y -qq '*cairn*' >/tmp/apt.log 2>&1 || fail "$(cat /tmp/apt.log)"
while IFS= read -r file; do
  [[ ! -e $file ]] || fail "$file is left"
done <files
[[ ! -e /usr/lib/python3/dist-packages/cairn && ! -e /usr/lib/python3/dist-packages/cairn_ros ]] || fail "the Python package left $(find /usr/lib/python3/dist-packages/cairn*)"
printf 'nothing is left of %d files\n' "$(wc -l <files)"
END
# Nothing of the environment here, such as settings of CMake, has a part in it, but how the network is reached.
environment=(HOME=/root PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin)
for name in http_proxy https_proxy no_proxy; do
  [[ -z ${!name:-} ]] || environment+=("$name=${!name}")
done
chroot "$root" /usr/bin/env -i "${environment[@]}" /bin/bash /use.sh
