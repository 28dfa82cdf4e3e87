"""What a user's code raises says whose it is; what it raises on purpose passes."""

from __future__ import annotations

import logging

import pytest
from mpi4py import MPI

from fenics_contact.errors import (
    InvalidDesignError,
    InvalidInputError,
    UserCodeError,
    collective,
    collectively,
    together,
)
from fenics_contact.errors.kinds import safe_log, user_code


def failing(error: BaseException) -> None:
    with user_code("the load of the test"):
        raise error


@pytest.mark.parametrize("error", [ZeroDivisionError("by nothing"), SystemExit(3), OSError()])
def test_a_failure_names_function_error_and_line(error: BaseException) -> None:
    with pytest.raises(UserCodeError) as caught:
        failing(error)
    words = f"the load of the test failed with {type(error).__name__}"
    assert str(caught.value).startswith(words)
    line = failing.__code__.co_firstlineno + 2
    assert f"({__file__}, line {line}): fix it" in str(caught.value)
    assert caught.value.__cause__ is error


@pytest.mark.parametrize("error", [InvalidDesignError("no such design"), KeyboardInterrupt()])
def test_errors_of_this_package_and_interrupts_pass(error: BaseException) -> None:
    with pytest.raises(type(error)) as caught:
        failing(error)
    assert caught.value is error


def test_an_error_that_cannot_be_shown_is_told() -> None:
    class Mute(Exception):
        def __str__(self) -> str:
            raise ValueError

    with pytest.raises(UserCodeError, match="Mute: a message that cannot be shown"):
        failing(Mute())


@pytest.mark.parametrize("error", [ZeroDivisionError(), SystemExit(3), KeyboardInterrupt()])
def test_on_one_rank_errors_are_what_they_are(error: BaseException) -> None:
    with pytest.raises(type(error)) as caught, together(MPI.COMM_SELF):
        raise error
    assert caught.value is error
    with pytest.raises(type(error)) as caught, collective(MPI.COMM_SELF, "a test", closed=True, users=True):
        raise error
    assert caught.value is error


class Failing(logging.Handler):
    def emit(self, record: logging.LogRecord) -> None:
        raise ZeroDivisionError("a bug in a handler")


def test_a_handler_that_fails_is_shown_and_stops_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    logger = logging.Logger("a logger of its own")
    logger.addHandler(Failing())
    safe_log(logger.info, "%d products", 3)
    shown = capsys.readouterr().err
    assert "ZeroDivisionError: a bug in a handler" in shown
    assert "%d products" in shown


def test_a_report_names_its_own_place() -> None:
    logger, heard = logging.Logger("a logger of its own"), []
    handler = logging.Handler()
    handler.emit = heard.append  # type: ignore[method-assign]
    logger.addHandler(handler)
    safe_log(logger.info, "%d products", 3, extra={"progress": 1})
    assert (heard[0].getMessage(), heard[0].filename, heard[0].progress) == (
        "3 products",
        "test_user_code.py",
        1,
    )


def test_calls_without_a_communicator_or_in_another_order_say_what_they_take() -> None:
    @collectively("solve", lambda scene, comm, **_: comm)
    def solve(scene: object, comm: MPI.Comm, *, tolerance: float = 1.0) -> str:
        return "solved"

    @collectively("write", lambda result, problem: problem.comm)
    def write(result: object, problem: object) -> None: ...

    assert solve("scene", MPI.COMM_SELF, tolerance=0.1) == "solved"
    with pytest.raises(InvalidInputError, match=r"solve takes \(scene, comm, tolerance\), got \(str\): "):
        solve("scene")  # type: ignore[call-arg]
    with pytest.raises(InvalidInputError, match=r"got \(str, NoneType, tolerance=float\): give"):
        solve("scene", None, tolerance=0.1)  # type: ignore[arg-type]
    words = r"write takes \(result, problem\), got \(int, str\)"
    with pytest.raises(InvalidInputError, match=words) as caught:
        write(1, "result")
    assert isinstance(caught.value.__cause__, AttributeError)
