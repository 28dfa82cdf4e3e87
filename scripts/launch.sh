#!/usr/bin/env bash
# Run a Python on one rank or several, in the environment that scripts/environment lists.
#
#   scripts/launch.sh RANKS [NAME=VALUE...] PYTHON ARGUMENT...
#   e.g.  scripts/launch.sh 2 .venv/bin/python demos/demo_chain_links.py
#
# NAME=VALUE wins over the list.
# The mpirun is the one that belongs to PYTHON's mpi4py, whatever comes first on PATH.
set -euo pipefail

if [ $# -lt 3 ] || ! [[ $1 =~ ^[1-9][0-9]*$ ]]; then
  echo "launch.sh needs RANKS [NAME=VALUE...] PYTHON ARGUMENT... with a positive number of ranks, got: $*" >&2
  exit 2
fi
ranks=$1
shift
settings=()
while [[ ${1-} == [A-Z]*=* ]]; do
  settings+=("$1")
  shift
done
python=$1
shift
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)

set -a
# shellcheck source=scripts/environment
. "$root/scripts/environment"
set +a
[ "$(uname -s)" = Linux ] || unset VTK_DEFAULT_OPENGL_WINDOW # no EGL elsewhere
[ ${#settings[@]} -eq 0 ] || export "${settings[@]}"
export PYTHONPATH=$root${PYTHONPATH:+:$PYTHONPATH} # so that a Python without the package installed finds it too

# What MPI has left in the environment of the caller would make mpirun fail.
words=$("$python" -P "$root/fenics_contact/_base/launching.py" "$ranks") || exit 2
start=()
while IFS= read -r word; do start+=("$word"); done <<<"$words" # the bash of macOS has no mapfile
exec "${start[@]}" "$python" "$@"
