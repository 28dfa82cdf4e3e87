"""Each mistake in a scene file is reported with line, key, what is allowed and what was given."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from mpi4py import MPI

from fenics_contact import read_scene_file
from fenics_contact._scene_file.source import SceneFileError
from fenics_contact.errors import InvalidInputError
from tests.conftest import ROOT
from tests.scene_file.mistakes import MISTAKES, page, said
from tests.scene_file.texts import GOOD, changed


def test_the_file_without_mistakes_is_a_scene(tmp_path: Path) -> None:
    assert said(GOOD, tmp_path, MPI.COMM_SELF) == ""


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_is_named_with_its_line(name: str, tmp_path: Path) -> None:
    old, new, message = MISTAKES[name]
    assert said(changed((old, new)), tmp_path, MPI.COMM_SELF) == message


def test_there_are_twelve_different_mistakes_at_least() -> None:
    assert len({message for _, _, message in MISTAKES.values()}) >= 12


def test_the_page_says_what_the_package_says(tmp_path: Path) -> None:
    written = (ROOT / "docs" / "scene_file_mistakes.md").read_text(encoding="utf-8")
    assert written == page(tmp_path), (
        "make it anew: python -m tests.scene_file.mistakes > docs/scene_file_mistakes.md"
    )


def test_several_mistakes_are_all_listed_in_the_order_of_their_lines(tmp_path: Path) -> None:
    text = changed(('law = "coulomb"', 'law = "culomb"'), ("counts = [2, 2, 1]", "counts = 3"), ("z1", "z2"))
    path = tmp_path / "scene.toml"
    path.write_text(text)
    with pytest.raises(
        SceneFileError, match=r"^scene.toml has 2 mistakes:\n  line 7: .*\n  line 40: "
    ) as error:
        read_scene_file(path, MPI.COMM_SELF)
    assert [mistake.line for mistake in error.value.mistakes] == [7, 40]
    assert error.value.mistakes[1].path == ("contacts", 0, "friction", "law")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            'friction = { law = "coulomb", coefficient = 0.3 }',
            "friction = 0.3",
            "contacts.0.friction must be a table with 'law'",
        ),
        ('title = "Two blocks"', "title = 3", "line 1: title must be text in quotes, got 3"),
        (
            "counts = [2, 2, 1]",
            "counts = [9999, 9999, 9999]",
            "9999 x 9999 x 9999 cells, which take 1.2 PB",
        ),
        (
            "counts = [2, 2, 1]",
            "counts = [9999, 9999, 9999]\ngrading = [1, 0, 0]",
            "must fit into the memory",
        ),
        (
            "[solver]",
            "[[steps]]\ncount = 60_000\n[[steps]]\ncount = 60_000\n[solver]",
            "line 42: steps: a file may have at most 100000 load steps, got 120000",
        ),
        (
            "[[loads]]",
            "[[steps]]\nloads.push = [0, 0, '1/(z-z)']\n[[loads]]\nname = 'push'",
            "line 31: steps.0: the formula '1/(z-z)' must have a finite value at every node, got inf at",
        ),
        (
            "[[supports]]",
            "[[supports]]\nvalue = ['log(x-9)', 0.0, 0.0]",
            "line 28: supports.0.value: the formula",
        ),
        (
            "master = {",
            "master = { obstacle = 'distance', formula = '1/0' } #",
            "line 39: contacts.0.master.formula",
        ),
        (
            "master = {",
            "master = { type = 'plane' } #",
            "line 39: contacts.0.master must have 'obstacle', one of 'plane', 'sphere', ",
        ),
        ("value = [10.0,", "value = ['x # y',", "loads.0.value: a formula must be like '0.1 * x**2', got"),
        ("value = [10.0,", "value = ['1e400',", "loads.0.value: a formula may hold numbers"),
        ("2.1e5", "1" + 5000 * "0", "line 16: must be TOML, got 'young_modulus = 1000"),
        (
            "[solver]",
            '[[steps]]\nname = "a\\nb"\n[solver]',
            "steps.0.name must be one line of text in quotes",
        ),
        ('mesh = "lower"', 'mesh = "lower"\n"<block>" = 1', 'line 21: bodies.lower."<block>" is not known'),
        (
            "[bodies.lower]",
            "[bodies]\nx = [[]]\n[bodies.lower]",
            "line 20: bodies.x must be a table, got [[]]",
        ),
        (
            "[solver]",
            "[output]\ncheckpoint = 1\n[solver]",
            "line 43: output.checkpoint must be true or false, got 1",
        ),
        (
            "[solver]",
            "[output]\nfiles = 'vtu'\n[solver]",
            'line 43: output.files must be a list in brackets, got "vtu"',
        ),
        (
            "[solver]",
            "[output]\nfiles = ['vtk']\n[solver]",
            "line 43: output.files.0 must be one of 'vtu', 'xdmf', 'csv', got \"vtk\"",
        ),
        ("tolerance = 1e-8", "max_products = 2.5", "solver.max_products must be an integer, got 2.5"),
        ("tolerance = 1e-8", "max_products = 0", "max_products must be a number greater than 0, got 0"),
        ("tolerance = 1e-8", "newton.first = 2", "solver.newton.first must be a number of at most 1, got 2"),
        (
            "tolerance = 1e-8",
            "newton.max_steps = 0",
            "newton.max_steps must be a number greater than 0, got 0",
        ),
        ("tolerance = 1e-8", "subdomains = 0", 'solver.subdomains must be "auto", a positive integer, three'),
        (
            "tolerance = 1e-8",
            "subdomains = {uper = 2}",
            "solver.subdomains.uper must be a body, one of 'lower', 'upper'",
        ),
        (
            "[solver]",
            "[[steps]]\nloads.push = 3\n[solver]",
            'steps.0.loads.push must be the name of a load, one of none, got "push"',
        ),
        ("[[supports]]", '[[supports]]\nvalue = [0.0, "fre", 0.0]', "supports.0.value: a formula may hold"),
        (
            "[[supports]]",
            "[[supports]]\nvalue = 0.0",
            "supports.0.value must be three numbers, formulas or 'free' in brackets",
        ),
        (
            "[[supports]]",
            '[[supports]]\nvalue = ["free", "free", "free"]',
            "line 27: supports.0: Support.value must hold three entries",
        ),
        (
            "[[supports]]",
            "[[supports]]\nvalue = [0.0, 0.0]",
            "supports.0: Support.value of body 'lower' must hold three, for x, y and z",
        ),
        (
            "[materials.steel]",
            "[materials.steel]\nmodel = 'steel.py:Steel'",
            "materials.steel.young_modulus is not known",
        ),
        (
            "young_modulus = 2.1e5\npoisson_ratio = 0.3",
            "model = 'nowhere.py:Steel'",
            "materials.steel: there must be a Python file",
        ),
        ('shape = "block"', 'file = "nowhere.msh"', "meshes.lower.lower is not known"),
        (
            'mesh = "lower"',
            'mesh = "lower"\npart = "first"',
            "bodies.lower.part must be a body of the mesh 'lower'",
        ),
    ],
)
def test_further_mistakes_are_named(old: str, new: str, message: str, tmp_path: Path) -> None:
    text = GOOD.replace(old, new, 1)
    assert text != GOOD
    found = said(text, tmp_path, MPI.COMM_SELF)
    assert message in found
    assert bool(found) == bool(message)


def test_a_file_that_is_not_there_is_named() -> None:
    with pytest.raises(InvalidInputError, match=r"there must be a scene file 'nowhere\.toml', there is none"):
        read_scene_file("nowhere.toml", MPI.COMM_SELF)


def test_a_file_that_is_no_text_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_bytes(b"title = '\xff\xfe'")
    with pytest.raises(InvalidInputError, match="must be UTF-8"):
        read_scene_file(path, MPI.COMM_SELF)


def test_a_dictionary_is_checked_without_lines() -> None:
    with pytest.raises(
        SceneFileError, match=r"^the scene: the file must have 'bodies', got only meshes, materials"
    ):
        read_scene_file(
            {
                "meshes": {
                    "a": {"shape": "block", "lower": [0, 0, 0], "upper": [1, 1, 1], "counts": [1, 1, 1]}
                },
                "materials": {"a": {"young_modulus": 1.0, "poisson_ratio": 0.0}},
            },
            MPI.COMM_SELF,
        )


def test_all_ranks_report_the_same_mistake(mpirun: Callable[..., str]) -> None:
    printed = mpirun(
        """
        import tempfile
        from pathlib import Path
        from mpi4py import MPI
        from tests.scene_file.mistakes import said
        from tests.scene_file.texts import changed
        comm = MPI.COMM_WORLD
        folder = Path(comm.bcast(tempfile.mkdtemp()))
        for change in (("[solver]", "[solver"), ("coefficient = 0.3", "coefficient = -1"), ('"z1"', '"z9"')):
            found = comm.allgather(said(changed(change), folder, comm))
            assert len(set(found)) == 1, found
            if comm.rank == 0:
                print(found[0])
        from fenics_contact.errors import InvalidInputError
        from fenics_contact import read_scene_file
        mesh = {"shape": "block", "lower": [0, 0, 0], "upper": [1, 1, 1], "counts": [1, 1, 1]}
        data = {"meshes": {"m": mesh}, "materials": {"s": {"model": f"{folder}/{comm.rank}.py:A"}}}
        file = read_scene_file({**data, "bodies": {"a": {"mesh": "m", "material": "s"}}}, comm)
        if comm.rank == 0:
            code = "from fenics_contact.materials import IsotropicElasticity as E; A = lambda: E(1.0, 0.0)"
            (folder / "0.py").write_text(code)
        try:
            file.scene
        except InvalidInputError as error:
            told = comm.gather(str(error))
        if comm.rank == 0:
            print(told[0])
        """,
        2,
    )
    lines = printed.splitlines()
    assert len(lines) == 4
    assert "there must be a Python file" in lines[3], "rank 1 alone has none"
    assert lines[3].endswith("(met on rank 1)")
    assert lines[0].startswith("scene.toml, line 42: must be TOML, got '[solver'")
    assert "friction.coefficient must be a number of at least 0, a formula" in lines[1]
    assert "loads.0.surface must be a surface of the body 'upper'" in lines[2]
