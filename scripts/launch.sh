#!/usr/bin/env bash
# Run a Python on one rank or several, in the environment that scripts/environment lists.
#
#   scripts/launch.sh RANKS PYTHON ARGUMENT...        e.g.  scripts/launch.sh 2 .venv/bin/python demos/demo_chain_links.py
#
# The mpirun is the one that belongs to PYTHON's mpi4py, whatever comes first on PATH.
set -euo pipefail

if [ $# -lt 3 ] || ! [[ $1 =~ ^[1-9][0-9]*$ ]]; then
  echo "launch.sh needs RANKS PYTHON ARGUMENT... with a positive number of ranks, got: $*" >&2
  exit 2
fi
ranks=$1 python=$2
shift 2
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)

set -a
# shellcheck source=scripts/environment
. "$root/scripts/environment"
set +a
export PYTHONPATH=$root${PYTHONPATH:+:$PYTHONPATH} # so that a Python without the package installed finds it too

mpirun_of() {
  local prefix
  for prefix in $("$1" -c 'import sys; print(sys.prefix, sys.base_prefix)'); do
    if [ -x "$prefix/bin/mpirun" ]; then
      echo "$prefix/bin/mpirun"
      return
    fi
  done
  command -v mpirun || {
    echo "launch.sh needs mpirun for $ranks ranks, found none beside $1 or on PATH: install the MPI of its mpi4py" >&2
    exit 2
  }
}

if [ "$ranks" = 1 ]; then
  exec "$python" "$@"
fi
mpirun=$(mpirun_of "$python")
exec "$mpirun" -n "$ranks" "$python" "$@"
