#!/usr/bin/env bash
# Do what a new user does in the first ten minutes, and write every command and what it printed to
# docs/first_ten_minutes.md. Run it in a fresh clone on a fresh Debian: scripts/first_ten_minutes.sh
set -uo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
page=docs/first_ten_minutes.md
mkdir -p output
draft=$(mktemp output/first_ten_minutes.XXXXXX)
mine=$(mktemp -d output/mine.XXXXXX) # the user's own files, shown as if they lay in the project's folder
begun=$SECONDS
failed=0

say() { printf '%s\n\n' "$@" >>"$draft"; }

# run EXPECTED-STATUS COMMAND: write the command, what it printed (both streams) and how long it took.
run() {
  local expected=$1 command=$2 before=$SECONDS status=0 printed
  printed=$(bash -c "$command" 2>&1 </dev/null) || status=$?
  printed=$(sed -e "s#$mine/##g" -e "s#$PWD/##g" <<<"$printed")
  {
    printf '```console\n$ %s\n' "${command//"$mine/"/}"
    [ -z "$printed" ] || printf '%s\n' "$printed"
    [ "$status" = 0 ] || printf '$ echo $?\n%s\n' "$status"
    printf '```\n\n'
    printf '*%s*\n\n' "$((SECONDS - before)) s"
  } >>"$draft"
  [ "$status" = "$expected" ] || { printf 'exit status %s, expected %s: %s\n%s\n' "$status" "$expected" "$command" "$printed" >&2; failed=1; }
}

# file NAME LANGUAGE: write a file from standard input, and show it.
file() {
  cat >"$mine/$1"
  { printf '```%s\n' "$2"; cat "$mine/$1"; printf '```\n\n'; } >>"$draft"
}

picture() { printf '![%s](%s)\n\n' "$1" "$2" >>"$draft"; }

release=$(. /etc/os-release && echo "$PRETTY_NAME")
say '# The first ten minutes' \
  "Every command that a new user types and what it printed, nothing skipped, on a fresh $release with nothing but \`git\`, \`make\` and root. The page is written by \`scripts/first_ten_minutes.sh\`, which types them; below each is how long it took on two cores. On a terminal a few lines more show how far the work is while it goes on." \
  '## The picture' \
  'In the folder that `git clone` made, one command sets up everything and optimises the shape of two chain links:'
run 0 'make demo'
picture 'Two chain links, von Mises stress' pictures/chain_links_stress.png
say 'That is `output/chain_links/stress_after.png`. The same folder has more pictures, files for ParaView and `result.json` with every number:'
run 0 'ls output/chain_links'
run 0 '.venv/bin/fenics-contact view output/chain_links'
say '## What is installed' 'Which versions were found, and whether the linear algebra is fast:'
run 0 '.venv/bin/fenics-contact info'
say '## A scene without Python' 'A scene can be a text file. This one comes with the project:'
run 0 'cat demos/scenes/two_blocks.toml'
run 0 '.venv/bin/fenics-contact run demos/scenes/two_blocks.toml'
picture 'Two blocks, von Mises stress' pictures/first_ten_minutes_two_blocks.png
say 'Two MPI ranks find the same:'
run 0 'scripts/launch.sh 2 .venv/bin/python -m fenics_contact run demos/scenes/two_blocks.toml'
say '## A mistake' 'In a copy of the file, the name of a surface is misspelt:'
run 0 "sed 's/surface = \"z1\" }/surface = \"top\" }/' demos/scenes/two_blocks.toml > $mine/my_blocks.toml"
run 2 ".venv/bin/fenics-contact run $mine/my_blocks.toml"
say '## A scene of your own in Python' 'The first scene of the front page as `first.py`, with numbers printed at the end:'
file first.py python <<'PYTHON'
from mpi4py import MPI
from fenics_contact import (
    Body, ContactPair, Coulomb, RigidPlane, Scene, Status, Support, Surface, Traction, gallery,
    materials, pictures, solve_scene,
)

mesh = gallery.block((0, 0, 0), (2, 1, 1), (32, 16, 16))                    # mm
scene = Scene(
    bodies={"block": Body(mesh, materials.IsotropicElasticity(2.1e5, 0.3))},  # N/mm²
    supports=[Support("block", "x0")],
    loads=[Traction("block", "z1", (200.0, 0.0, -500.0))],          # N/mm²
    contacts=[ContactPair(Surface("block", "z0"), RigidPlane((0, 0, 0), (0, 0, 1)), Coulomb(0.3))],
)
state = solve_scene(scene, MPI.COMM_WORLD)
pictures.plot_contact_pressure(state, "output/first.png")
errors = state.estimate_errors()  # all ranks together

if MPI.COMM_WORLD.rank == 0:
    print(f"normal force {state.contact.normal_force.sum():.1f} N")
    print(f"{state.contact.count(Status.STICK)} points stick, {state.contact.count(Status.SLIP)} slip")
    print(errors)
PYTHON
run 0 ".venv/bin/python $mine/first.py"
picture 'Contact pressure and status under the block' pictures/first_ten_minutes_block.png
run 0 "scripts/launch.sh 2 .venv/bin/python $mine/first.py"
say '## A notebook' '`.venv/bin/jupyter lab notebooks` opens the notebooks in a browser. This runs the first of them from top to bottom:'
run 0 'make notebooks NOTEBOOKS=01'
say '## Where to go from here' \
  "These commands took $((SECONDS - begun)) s. Next: [a first scene](guide/first_scene.md), [the other demos](gallery.md) (\`make help\` lists everything), [scene files](guide/command_line.md), [what accuracy costs](studies/README.md)."

cp output/two_blocks/stress.png docs/pictures/first_ten_minutes_two_blocks.png
cp output/first.png docs/pictures/first_ten_minutes_block.png
[ "$failed" = 0 ] && mv "$draft" $page && chmod 644 $page
rm -rf "$mine" "$draft"
exit "$failed"
