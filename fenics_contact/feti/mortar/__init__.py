"""placeholder until the branch is merged."""

from typing import Any


def mortar_coupling(slave: Any, master: Any, comm: Any) -> Any:
    raise NotImplementedError
