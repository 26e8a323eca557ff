"""Studies, optimisations and continuations from their files, as ``damprig study``, ``optimise`` and ``continue`` compute them."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from . import _damprig
from .errors import InputError
from .tables import Table

__all__ = ["Study", "continuation", "optimise", "study"]

# Shares of a study for an executor that does not say how many workers it has.
SHARES = 8


@dataclass(frozen=True)
class Study:
    """A computed study.

    Attributes
    ----------
    table : Table
        A row for each point: ``row``, the axes by their keys, the metrics; units in ``table.units``.
    best : dict or None
        The best point: ``row``, ``objective`` (its value) and the axes by their keys; ``None`` if no point has a value.
    path : str
        Where ``table.parquet`` is.
    """

    table: Table
    best: dict[str, Any] | None
    path: str


def study(
    file: str | os.PathLike[str],
    out: str | os.PathLike[str] | None = None,
    *,
    executor: Any = None,
    shares: int | None = None,
) -> Study:
    """Computes a study on all cores, or on the workers of an executor; goes on where an earlier call stopped.

    Parameters
    ----------
    file : path
        Study file (TOML); docs/STUDIES.md.
    out : path, optional
        Folder of the results; ``studies/`` and the name of the file when left out. The workers of an executor must see the
        folder and the file under the same paths.
    executor : optional
        Any ``concurrent.futures`` executor, or a Dask ``Client``: gets one call for each share of the study's parts.
    shares : int, optional
        Number of shares for the executor; the number of its workers when it says so, else 8.

    Raises
    ------
    InputError
        The file, its case or the folder is wrong.
    """
    path = _path("file", file)
    folder = Path("studies") / Path(path).stem if out is None else Path(_path("out", out))
    if executor is None:
        if shares is not None:
            raise InputError("shares = … is for an executor: leave it out, or give executor")
        _damprig.study_run(path, folder)
    else:
        _share_out(executor, os.path.abspath(path), os.path.abspath(folder), shares)
    native, best, address = _damprig.study_merge(path, folder)
    return Study(Table(native), best and _best(*best), address)


def _best(row: int, objective: float, axes: list[tuple[str, float | None, str | None]]) -> dict[str, Any]:
    values = {key: word if number is None else number for key, number, word in axes}
    return {"row": row, "objective": objective, **values}


def _share_out(executor: Any, file: str, out: str, shares: int | None) -> None:
    if not callable(getattr(executor, "submit", None)):
        raise InputError(f"executor: must have a method submit, as concurrent.futures and Dask have, not {type(executor).__name__}")
    count = shares if shares is not None else getattr(executor, "_max_workers", None) or SHARES
    if not isinstance(count, int) or count < 1:
        raise InputError(f"shares = {count!r} is not allowed: must be a whole number of 1 or more")
    # Dask takes equal calls for one unless it is told otherwise.
    own = {"pure": False} if type(executor).__module__.split(".")[0] == "distributed" else {}
    futures = [executor.submit(_damprig.study_work, file, out, f"{i}/{count}", **own) for i in range(1, count + 1)]
    for future in futures:
        future.result()


def optimise(file: str | os.PathLike[str]) -> dict[str, Any]:
    """Optimises keys of a case; the answer of ``damprig optimise --json`` as a dict (docs/OPTIMISE.md).

    Raises
    ------
    InputError
        The file or its case is wrong.
    """
    return json.loads(_damprig.optimise(_path("file", file)))


def continuation(file: str | os.PathLike[str]) -> dict[str, Any]:
    """Follows periodic orbits over a parameter; the answer of ``damprig continue --json`` as a dict (docs/CONTINUE.md).

    Raises
    ------
    InputError
        The file or its case is wrong, or there is no periodic orbit to start from.
    """
    return json.loads(_damprig.continuation(_path("file", file)))


def _path(name: str, given: Any) -> str:
    try:
        return os.fsdecode(given)
    except TypeError:
        raise InputError(f"{name}: must be the path of a file, not {type(given).__name__}") from None
