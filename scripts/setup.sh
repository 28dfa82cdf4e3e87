#!/usr/bin/env bash
# Set up everything on Debian 12 or 13: Debian's FEniCSx and gmsh, and .venv on top of Debian's own Python.
# What is already there is left alone; an interrupted run is repaired by the next one. Arguments are further Debian
# packages to install.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd -P)
cd "$root"
unset PYTHONPATH PYTHONHOME
export PYTHONNOUSERSITE=1 # packages of the user's own would hide Debian's

packages=(python3-dolfinx-real python3-gmsh python3-venv libopenblas0-pthread libegl1 ca-certificates "$@")
python=/usr/bin/python3 # never another python3 that comes first on PATH: only Debian's sees Debian's FEniCSx
venv=.venv
stamp=$venv/.fenics_contact-ready
unfinished=$venv/.fenics_contact-unfinished

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

# The release that decides versions: bookworm or trixie.
debian_release() {
  local found
  found=$(. /etc/os-release 2>/dev/null && echo "${ID:-unknown}:${VERSION_CODENAME:-unknown}:${PRETTY_NAME:-unknown}") || found=::unknown
  case $found in
    debian:bookworm:*) echo bookworm ;;
    debian:trixie:*) echo trixie ;;
    *) die "needs Debian 12 (bookworm) or Debian 13 (trixie), got ${found##*:}." \
      "Elsewhere, install FEniCSx with real PETSc (CHOLMOD or MUMPS) and gmsh yourself, for instance from conda-forge," \
      "then pip install -e '.[dev]' there, and name that Python: make ... PYTHON=/path/to/python" ;;
  esac
}

missing_packages() {
  local package
  for package in "${packages[@]}"; do
    [ "$(dpkg-query -W -f='${db:Status-Status}' "$package" 2>/dev/null)" = installed ] || echo "$package"
  done
}

install_packages() {
  local as_root=()
  if [ "$(id -u)" != 0 ]; then
    command -v sudo >/dev/null || die "needs root for the Debian packages $*, got user $(id -un) without sudo:" \
      "run as root: apt-get install --no-install-recommends $*"
    as_root=(sudo)
  fi
  local apt=("${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -o Acquire::Retries=3 -o DPkg::Lock::Timeout=600)
  say "installing Debian packages (up to 0.5 GB, some minutes): $*"
  retry quietly "${apt[@]}" update || die "apt-get update failed: see the lines above; is the network reachable?"
  retry quietly "${apt[@]}" install -y --no-install-recommends "$@" || die "apt-get install failed: see the lines above"
}

# Everything that the content of .venv depends on, its place included: its scripts name it.
fingerprint() {
  { echo "$root" "$release"; "$python" --version; cat pyproject.toml "$constraints" "${BASH_SOURCE[0]}"; } | sha256sum
}

# A .venv that was begun and not finished, was moved, is of another Python or cannot run pip is built anew.
venv_is_sound() {
  local config=$venv/pyvenv.cfg
  [ ! -e $unfinished ] && grep -qsx 'include-system-site-packages = true' $config &&
    grep -qsx "home = ${python%/*}" $config && grep -qsF " $root/$venv" $config &&
    $venv/bin/python -m pip --version >/dev/null 2>&1
}

build_venv() {
  if ! venv_is_sound; then
    say "creating $venv"
    rm -rf $venv
    mkdir $venv
    touch $unfinished
    "$python" -m venv --system-site-packages $venv
  fi
  touch $unfinished
  rm -f $stamp
  say "installing Python packages into $venv"
  # As an environment variable the constraints hold for the build of the package, too.
  PIP_CONSTRAINT=$constraints retry $venv/bin/python -m pip install --quiet --disable-pip-version-check \
    -e '.[dev]' || die "pip install failed: see the lines above; is the network reachable?"
}

release=$(debian_release)
constraints=constraints/$release.txt

exec 9<"$root" # the directory itself is the lock: two makes at once take turns
flock 9

missing=$(missing_packages)
[ -z "$missing" ] || install_packages $missing

wanted=$(fingerprint)
if [ "$(cat $stamp 2>/dev/null)" != "$wanted" ] || [ -e $unfinished ] || [ ! -x $venv/bin/python ]; then
  build_venv
  echo "$wanted" >$stamp
  rm -f $unfinished
  say "done"
fi
