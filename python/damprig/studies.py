"""Studies, optimisations and continuations from files or dicts, as ``damprig study``, ``optimise`` and ``continue`` compute them."""

from __future__ import annotations

import json
import os
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from . import _damprig
from .errors import InputError
from .tables import Table

__all__ = ["Study", "continuation", "optimise", "study"]


@dataclass(frozen=True)
class Study:
    """A computed study.

    Attributes
    ----------
    table : Table
        A row for each point: ``row``, the axes by their keys, the metrics; units in ``table.units``.
    best : dict or None
        The best point: ``row``, ``objective`` (its value) and the axes by their keys; ``None`` if no point has a value.
    path : str or None
        Where ``table.parquet`` is; ``None`` of a dict without ``out``.
    """

    table: Table
    best: dict[str, Any] | None
    path: str | None


def study(
    file: str | os.PathLike[str] | dict[str, Any],
    out: str | os.PathLike[str] | None = None,
    *,
    executor: Any = None,
) -> Study:
    """Computes a study on all cores, or on the workers of an executor; goes on where an earlier call stopped.

    Parameters
    ----------
    file : path or dict
        Study file (TOML), or a dict with the keys of one (docs/STUDIES.md). The ``case`` of a dict may be a dict too; relative files
        of a dict are those of the working directory.
    out : path, optional
        Folder of the results; ``studies/`` and the name of the file when left out. Those of a dict without it are not kept.
    executor : optional
        Any ``concurrent.futures`` executor, or a Dask ``Client``: gets one call for each part of the study that is missing, and answers
        with its rows; only the caller writes the folder. The workers must see the study's files under the same paths; of a dict whose
        ``case`` is a dict they need none, unless the case names one.

    Raises
    ------
    InputError
        The file, its case or the folder is wrong.
    """
    given = _given(file)
    if out is None and isinstance(given, dict):
        with tempfile.TemporaryDirectory(prefix="damprig-") as folder:
            done = _study(given, Path(folder) / "study", executor)
        return Study(done.table, done.best, None)
    folder = Path("studies") / Path(given).stem if out is None else Path(_path("out", out))
    return _study(given, folder, executor)


def _study(given: str | dict[str, Any], folder: Path, executor: Any) -> Study:
    if executor is None:
        _damprig.study_run(given, folder)
    else:
        _compute_on(executor, given, folder)
    native, best, address = _damprig.study_merge(given, folder)
    return Study(Table(native), best and _best(*best), address)


def _given(file: Any) -> str | dict[str, Any]:
    """The path of a file, or a dict whose case is named by its whole path, so that workers elsewhere find it."""
    if not isinstance(file, dict):
        return _path("file", file)
    case = file.get("case")
    return {**file, "case": os.path.abspath(case)} if isinstance(case, str | os.PathLike) else file


def _best(row: int, objective: float, axes: list[tuple[str, float | None, str | None]]) -> dict[str, Any]:
    values = {key: word if number is None else number for key, number, word in axes}
    return {"row": row, "objective": objective, **values}


def _compute_on(executor: Any, given: str | dict[str, Any], folder: Path) -> None:
    """Computes the missing parts on the workers of an executor; each part is written as soon as those before it are."""
    if not callable(getattr(executor, "submit", None)):
        raise InputError(f"executor: must have a method submit, as concurrent.futures and Dask have, not {type(executor).__name__}")
    parts = _damprig.study_missing(given, folder)
    there = given if isinstance(given, dict) else os.path.abspath(given)
    # Dask takes equal calls for one unless it is told otherwise.
    own = {"pure": False} if type(executor).__module__.split(".")[0] == "distributed" else {}
    futures = [executor.submit(_damprig.study_rows, there, part, **own) for part in parts]
    try:
        for place, part in enumerate(parts):
            # The rows of a part are not kept.
            future, futures[place] = futures[place], None
            _damprig.study_write(given, folder, part, future.result())
    finally:
        for future in filter(None, futures):
            future.cancel()


def optimise(file: str | os.PathLike[str] | dict[str, Any]) -> dict[str, Any]:
    """Optimises keys of a case; the answer of ``damprig optimise --json`` as a dict (docs/OPTIMISE.md).

    Parameters
    ----------
    file : path or dict
        Optimisation file (TOML), or a dict with the keys of one, whose ``case`` may be a dict too.

    Raises
    ------
    InputError
        The file or its case is wrong.
    """
    return json.loads(_damprig.optimise(_given(file)))


def continuation(file: str | os.PathLike[str] | dict[str, Any]) -> dict[str, Any]:
    """Follows periodic orbits over a parameter; the answer of ``damprig continue --json`` as a dict (docs/CONTINUE.md).

    Parameters
    ----------
    file : path or dict
        Continuation file (TOML), or a dict with the keys of one, whose ``case`` may be a dict too.

    Raises
    ------
    InputError
        The file or its case is wrong, or there is no periodic orbit to start from.
    """
    return json.loads(_damprig.continuation(_given(file)))


def _path(name: str, given: Any) -> str:
    try:
        return os.fsdecode(given)
    except TypeError:
        raise InputError(f"{name}: must be the path of a file, or a dict with the keys of one, not {type(given).__name__}") from None
