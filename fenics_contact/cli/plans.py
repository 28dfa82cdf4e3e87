"""Preview of what will be built and written."""

from __future__ import annotations

from fenics_contact.cli.desk import Console, facts
from fenics_contact.scene_file import SceneFile


def show_plan(console: Console, file: SceneFile, *, sensitivity: bool = False) -> None:
    """Print the plan of a scene. Collective."""
    plan = file.scene.plan(file.partitions, sensitivity=sensitivity)
    rows = {line[:15].strip(): line[16:] for line in str(plan).splitlines()}
    if file.steps and not sensitivity:
        rows["load steps"] = str(len(file.steps))
    console.say(f"{file.title}: {file.source.name} on {console.ranks}")
    console.show(facts(rows))


def show_outputs(console: Console, file: SceneFile, *, draws: bool) -> None:
    """Report what a run would write."""
    output = file.document.output
    pictures = f", pictures of {', '.join(output.pictures)}" if draws and output.pictures else ""
    kinds = f", {', '.join(output.files)} files" if output.files else ""
    shapes = (
        f", {', '.join(output.design)} files of the design" if file.document.design and output.design else ""
    )
    console.say(f"would write to {file.folder}/: result.json{kinds}{shapes}{pictures}")
    console.say("nothing was solved (--dry-run)")
