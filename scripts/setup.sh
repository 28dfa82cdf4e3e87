#!/usr/bin/env bash
# Set up FEniCSx, gmsh and .venv in one of two ways:
#   packages  Debian 12 or newer (sid too) and Ubuntu 25.04 or newer: the system's own, and .venv on top of its Python,
#             which sees what FEniCSx and gmsh need of the system's Python packages, and nothing else.
#             Ubuntu 24.04 has no FEniCSx in its archive, only in that of the FEniCS project (ppa:fenics-packages/fenics).
#   wheel     x86-64 Linux without these or without root: .venv alone, FEniCSx by the wheel of a third party, which is
#             alpha.
# WHEEL=1 or WHEEL=0 chooses; by default it is the way that .venv was made, else packages, else, where these are
# missing and there is no root, the wheel. What is already there is left alone; an interrupted run is repaired by
# the next one.
#
#   scripts/setup.sh [--dev] [--plan] [PACKAGE...]
#
# --dev: the tools of developers, too. --plan: print what would be used and missing. PACKAGE: further packages.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd -P)
cd "$root"
unset PYTHONPATH PYTHONHOME
export PYTHONNOUSERSITE=1 # packages of the user's own would hide the system's
export PIP_CONSTRAINT=    # nor do a machine's other constraints apply

tools=demo plan=
while [[ ${1-} == --* ]]; do
  case $1 in
    --dev) tools=dev ;;
    --plan) plan=1 ;;
    *) echo "setup.sh takes --dev, --plan and names of packages, got: $1" >&2; exit 2 ;;
  esac
  shift
done
modules=(python3-dolfinx-real python3-gmsh)
packages=("${modules[@]}" python3-venv libopenblas0-pthread libegl1 ca-certificates)
compared=(python3-getfem) # what benchmarks compare with, where it is installed
wheel_packages=(python3-venv python3-dev gcc ca-certificates libegl1 libgl1 libglu1-mesa libxcursor1 libxft2 libxinerama1)
further=("$@")
venv=.venv
unfinished=$venv/.fenics_contact-unfinished
from_wheel=$venv/.fenics_contact-wheel

say() { printf 'set-up: %s\n' "$*" >&2; }
die() {
  printf 'set-up: %s\n' "$@" >&2
  exit 1
}

retry() {
  local attempt
  for attempt in 1 2 3; do
    "$@" && return
    [ "$attempt" = 3 ] || { say "failed, trying again: $*"; sleep $((5 * attempt)); }
  done
  return 1
}

# Hundreds of lines that matter only when something fails.
quietly() {
  local output
  output=$("$@" 2>&1) || { printf '%s\n' "$output" | tail -n 30 >&2; return 1; }
}

# The system as NAME VERSION and in words; sid and the next Debian have no number.
system() {
  (. "${OS_RELEASE:-/etc/os-release}" 2>/dev/null && echo "${ID:-unknown} ${VERSION_ID:-99} ${PRETTY_NAME:-$(uname -sr)}") ||
    echo "unknown 0 $(uname -sr)"
}
read -r system_name system_version system_words <<<"$(system)"
has_packages() {
  case $system_name in
    debian) [ "${system_version%%.*}" -ge 12 ] ;;
    ubuntu) [ "${system_version%%.*}" -ge 25 ] || apt-cache show python3-dolfinx-real >/dev/null 2>&1 ;;
    *) false ;;
  esac
}
names_packages_alike() { [ "$system_name" = debian ] || [ "$system_name" = ubuntu ]; }

missing_packages() {
  local package
  for package in "$@"; do
    [ "$(dpkg-query -W -f='${db:Status-Status}' "$package" 2>/dev/null)" = installed ] || echo "$package"
  done
}

# sudo that asks for a password needs a terminal.
can_be_root() { [ "$(id -u)" = 0 ] || { command -v sudo >/dev/null && { sudo -n true 2>/dev/null || [ -t 0 ]; }; }; }

install_packages() {
  local as_root=()
  [ "$(id -u)" = 0 ] || as_root=(sudo)
  local apt=("${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -o Acquire::Retries=3 -o DPkg::Lock::Timeout=600
    -o APT::Keep-Downloaded-Packages=false)
  say "installing packages of $system_words (up to 0.55 GB to download, some minutes): $*"
  retry quietly "${apt[@]}" update || die "apt-get update failed: see the lines above; is the network reachable?" "$offer"
  retry quietly "${apt[@]}" install -y --no-install-recommends "$@" ||
    die "apt-get install failed: see the lines above; on Ubuntu the component universe is needed"
}

# The Python of .venv, or the first one that can use the wheel; if there is none, what the first one misses.
find_wheel_python() {
  local name path needs
  python= obstacle=
  for name in $venv/bin/python /usr/bin/python3 python3 python3.14 python3.13 python3.12; do
    path=$(command -v "$name") || continue
    path=$(base_of "$path" 2>/dev/null) || continue
    needs=$("$path" scripts/wheel_needs.py 2>/dev/null) || continue
    [ -n "$needs" ] || { python=$path; return; }
    [ -n "$obstacle" ] || obstacle=${needs//$'\n'/; }
  done
  [ -n "$obstacle" ] || obstacle="Python 3"
  return 1
}
base_of() { "$1" -c 'import os, sys; print(os.path.realpath(sys._base_executable))'; }

elsewhere="Elsewhere, install FEniCSx with real PETSc (CHOLMOD or MUMPS) and gmsh yourself, for instance from conda-forge,
set-up: then pip install -e '.[dev]' there, and name that Python: make ... PYTHON=/path/to/python"
offer="Without these or without root, on x86-64 Linux with Python 3.12 or newer: make ... WHEEL=1, which takes FEniCSx from PyPI by
set-up: dolfinx-solver-real, the wheel of a third party, which is alpha"

choose_way() {
  case ${WHEEL-} in
    1) way=wheel ;;
    0) way=packages ;;
    '') [ -e $from_wheel ] && way=wheel || way=packages ;;
    *) die "needs WHEEL=1, WHEEL=0 or none, got WHEEL=$WHEEL" ;;
  esac
  [ $way = wheel ] || has_packages ||
    die "needs Debian 12 or newer or Ubuntu 25.04 or newer (24.04 with ppa:fenics-packages/fenics), got $system_words." \
      "$elsewhere" "$offer"
  python=/usr/bin/python3 # never another python3 that comes first on PATH: only the system's sees its FEniCSx
  [ $way = wheel ] || missing=$(missing_packages "${packages[@]}")
  if [ -n "$missing" ] && [ -z "${WHEEL-}" ] && ! can_be_root && find_wheel_python; then
    say "packages are missing, and user $(id -un) cannot become root; one who can runs" \
      "apt-get install --no-install-recommends" $missing
    way=wheel missing=
  fi
  if [ $way = wheel ] && names_packages_alike && can_be_root; then missing=$(missing_packages "${wheel_packages[@]}"); fi
  missing="$missing $(missing_packages ${further[@]+"${further[@]}"})"
  [ -z "${missing// /}" ] || can_be_root ||
    die "needs root for packages, got user $(id -un), who cannot become root: run as root" \
      "apt-get install --no-install-recommends $(echo $missing)" "$offer" ${obstacle:+"Here that needs $obstacle"}
}

announce_wheel() {
  local libraries
  libraries=$("$python" scripts/wheel_needs.py libraries)
  say "FEniCSx comes from PyPI by dolfinx-solver-real, the wheel of a third party, which is alpha:" \
    "where there is root, prefer the packages of Debian or Ubuntu"
  [ -z "$libraries" ] || say "demos, which draw pictures, and gmsh fail before an administrator installs" \
    "(names of Debian's and Ubuntu's packages):" $libraries
}

# Everything that the content of .venv depends on, its place included: its scripts name it.
fingerprint() {
  { echo "$root" $way "$1" "$python"; "$python" --version; cat pyproject.toml "$pins"/*.txt scripts/setup.sh scripts/*system_packages.py 2>/dev/null || true; } | sha256sum
}
is_ready() { [ "$(cat $venv/.fenics_contact-ready-"$1" 2>/dev/null)" = "$(fingerprint "$1")" ]; }

# A .venv that was begun and not finished, was moved, is of another way or Python, or cannot run pip is built anew.
venv_is_sound() {
  local config=$venv/pyvenv.cfg made=packages
  [ ! -e $from_wheel ] || made=wheel
  [ ! -e $unfinished ] && [ $made = $way ] && grep -qsx "include-system-site-packages = false" $config &&
    grep -qsx "home = ${python%/*}" $config && grep -qsF " $root/$venv" $config &&
    $venv/bin/python -m pip --version >/dev/null 2>&1
}

# Of the system's Python packages .venv sees those of FEniCSx and gmsh and what these depend on. One that came since,
# as with a newer dolfinx, is seen after the next set-up; what pip has installed hides its counterpart.
link_system_packages() {
  [ $way = wheel ] || "$python" scripts/link_system_packages.py $venv "${modules[@]}" "${compared[@]}"
}

pip() {
  retry $venv/bin/python -m pip install --quiet --disable-pip-version-check "$@" ||
    die "pip install failed: see the lines above; is the network reachable?"
}

build_venv() {
  local lists list
  if ! venv_is_sound; then
    say "creating $venv"
    rm -rf $venv
    mkdir $venv
    touch $unfinished
    "$python" -m venv $venv
    [ $way = packages ] || touch $from_wheel
  fi
  touch $unfinished
  link_system_packages
  rm -f $venv/.fenics_contact-ready-*
  say "installing Python packages into $venv"
  if [ -d "$pins" ]; then # all that is needed is listed, so that nothing else can be drawn in
    lists=(-r "$pins/demo.txt")
    [ $way = packages ] || lists+=(-r "$pins/wheel.txt")
    [ $tools = demo ] || lists+=(-r "$pins/dev.txt")
    pip --require-hashes --no-deps "${lists[@]}"
    pip --require-hashes --no-deps --target=$venv/build --upgrade -r "$pins/build.txt" # FEniCSx uses the system's
    PYTHONPATH=$venv/build pip --no-deps --no-build-isolation -e .
    rm -r $venv/build
  else
    say "no versions are pinned for Python $minor: pip takes the newest"
    list=$venv/system.txt
    $venv/bin/python -c 'import numpy, scipy; print(f"numpy=={numpy.__version__}\nscipy=={scipy.__version__}")' >$list
    if [ $tools = demo ]; then pip -c $list -e '.[cli,viz]'; else pip -c $list -e '.[dev]'; fi
  fi
}

missing= python= obstacle= way=
choose_way
if [ -n "$plan" ]; then
  [ $way = packages ] || find_wheel_python || python="no Python, which needs $obstacle"
  echo "$way with $python; missing:" $missing
  exit
fi

exec 9<"$root" # the directory itself is the lock: two makes at once take turns
flock 9

[ -z "${missing// /}" ] || install_packages $missing
[ $way = packages ] || find_wheel_python || die "the wheel needs $obstacle." "$elsewhere"
minor=$("$python" -c 'import sys; print("%d.%d" % sys.version_info[:2])')
pins=constraints/python$minor

if [ -e $unfinished ] || [ ! -x $venv/bin/python ] || ! { is_ready dev || is_ready $tools; }; then
  [ $way = packages ] || announce_wheel
  build_venv
  link_system_packages
  dolfinx=$(scripts/launch.sh 1 $venv/bin/python -c 'import mpi4py.MPI, dolfinx; print(dolfinx.__version__)') ||
    die "FEniCSx cannot be loaded: see the lines above"
  fingerprint $tools >$venv/.fenics_contact-ready-$tools
  rm -f $unfinished
  say "done: $system_words, Python $minor, dolfinx $dolfinx ($way)"
else
  link_system_packages
fi
