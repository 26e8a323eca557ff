"""Studies, optimisations and continuations from files or dicts, as ``damprig study``, ``optimise`` and ``continue`` compute them."""

from __future__ import annotations

import json
import operator
import os
import re
import sys
import tempfile
import time
import warnings
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _damprig
from .errors import InputError
from .numbers import real_array
from .plots import plot_basins, plot_bifurcation, plot_branches, plot_optimisation, plot_study
from .simulation import simulate
from .tables import StoredTable, Table

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import ArrayLike

    from . import keys
    from .keys import Case
    from .simulation import Simulation

    #: A number of a motion.
    Metric = Callable[[Simulation], float]
    #: Gets the points done and all points of a study.
    Tell = Callable[[int, int], object]

__all__ = ["Basins", "Bifurcation", "Branches", "Optimisation", "Study", "basins", "bifurcation", "continuation", "evaluate", "optimise", "study"]


@dataclass(frozen=True)
class Study:
    """A computed study.

    Attributes
    ----------
    table : Table
        A row for each point: ``row``, the axes by their keys, the metrics; units in ``table.units``.
    axes : dict of str to str
        The keys of its axes, each with its scale: ``"linear"`` or ``"log"``.
    objective : str
        The column whose best value ``best`` has.
    best : dict or None
        The best point: ``row``, ``objective`` (its value) and the axes by their keys; ``None`` if no point has a value.
    sensitivity : list of dict
        Sensitivity indices of each metric, as ``damprig study run --json`` prints them; empty of a study whose ``sampling`` is not for them.
    path : str or None
        Where ``table.parquet`` is; ``None`` of a dict without ``out``.
    """

    table: Table
    axes: dict[str, str]
    objective: str
    best: dict[str, Any] | None
    sensitivity: list[dict[str, Any]]
    path: str | None

    def plot(self, metric: str | None = None, ax: Any = None) -> Any:
        """Draw a metric, the first one when left out, over the axes with matplotlib: curves, or a map over two axes of numbers.

        Returns the axes of matplotlib: ``ax``, or those of a new figure.
        """
        return plot_study(self, metric, ax)


class Bifurcation(Table):
    """The sampled cycles of a bifurcation diagram: a :class:`damprig.Table` with a row for each.

    Attributes
    ----------
    key : str
        The swept key of the case.
    """

    def __init__(self, native: dict[str, Any], key: str) -> None:
        super().__init__(native)
        self.key = key

    def plot(self, column: str = "cycle_max_m", ax: Any = None) -> Any:
        """Draw a column over the key with matplotlib, up and down; returns the axes."""
        return plot_bifurcation(self, column, ax)


@dataclass(frozen=True)
class Basins:
    """Basins of attraction.

    Attributes
    ----------
    keys : tuple of str
        The two keys of the starts.
    starts : Table
        A row for each start: its keys, ``attractor`` (a number from 1, 0 if there is none), ``passed_wall`` and its last state at drive phase 0.
    attractors : Table
        A row for each attractor: ``starts``, ``share``, ``period_cycles``, ``impacts``, ``max_abs_x_m`` and a state at drive phase 0.
    """

    keys: tuple[str, str]
    starts: Table
    attractors: Table

    def plot(self, ax: Any = None) -> Any:
        """Draw the attractor of each start with matplotlib; returns the axes."""
        return plot_basins(self, ax)


class Optimisation(dict):
    """The answer of an optimisation: a dict as ``damprig optimise --json`` prints it."""

    def plot(self, ax: Any = None, *, front: bool = False) -> Any:
        """Draw the objective's metric over the band with matplotlib, beside alternatives and bare structure, or the ``front``; returns the axes."""
        return plot_optimisation(self, ax, front=front)


class Branches(dict):
    """Branches of periodic orbits: a dict as ``damprig continue --json`` prints it."""

    def plot(self, ax: Any = None) -> Any:
        """Draw the largest ``|x|`` over the parameter with matplotlib: stable orbits solid, unstable ones dashed; returns the axes."""
        return plot_branches(self, ax)


def study(
    file: str | os.PathLike[str] | keys.Study | dict[str, Any],
    out: str | os.PathLike[str] | None = None,
    *,
    executor: Any = None,
    progress: bool | Callable[[int, int], object] = False,
) -> Study:
    """Computes a study on all cores, or on the workers of an executor; goes on where an earlier call stopped.

    A study that is finished is opened, if its table has the digest with which it was written: a column is read when it is used first, so
    that one of many millions of points takes little memory.

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
        ``case`` is a dict they need none, unless the case names one. The workers of a pool, and those of a cluster on one machine, share
        its cores evenly.
    progress : bool or function, optional
        ``True`` prints points done and time left to standard error. A function gets the points done and all points, again and again; what
        it raises ends the study, whose parts so far are kept.

    Raises
    ------
    InputError
        The file, its case or the folder is wrong.
    """
    given = _given(file)
    if not (isinstance(progress, bool) or callable(progress)):
        raise InputError(f"progress: must be True, False or a function of the points done and all points, not {type(progress).__name__}")
    tell = (_printed() if progress else None) if isinstance(progress, bool) else progress
    if out is None and isinstance(given, dict):
        with tempfile.TemporaryDirectory(prefix="damprig-") as folder:
            done = _study(given, Path(folder) / "study", executor, tell)
            dict(done.table.columns)  # Read before the folder goes.
        return replace(done, path=None)
    folder = Path("studies") / Path(given).stem if out is None else Path(_path("out", out))
    return _study(given, folder, executor, tell)


def _study(given: str | dict[str, Any], folder: Path, executor: Any, tell: Tell | None) -> Study:
    joined = _damprig.study_open(given, folder)
    if joined is None:
        if executor is None:
            _damprig.study_run(given, folder, tell)
        else:
            _compute_on(executor, given, folder, tell)
        joined = _damprig.study_join(given, folder)
    stored, axes, objective, best, sensitivity, address = joined
    scales = {key: "log" if is_log else "linear" for key, is_log in axes}
    return Study(StoredTable(stored), scales, objective, best and _best(*best), json.loads(sensitivity), address)


def _printed() -> Tell:
    """Prints points done and time left in one line of standard error."""
    start: list[float] = []

    def tell(done: int, points: int) -> None:
        start[:] = start or [time.monotonic(), done]
        elapsed_s, computed = time.monotonic() - start[0], done - start[1]
        left = f", {elapsed_s * (points - done) / computed:.0f} s left" if computed else ""
        print(f"\r{done} of {points} points{left:<20}", end="" if done < points else "\n", file=sys.stderr, flush=True)

    return tell


def _given(file: Any) -> str | dict[str, Any]:
    """The path of a file, or a dict whose case is named by its whole path, so that workers elsewhere find it."""
    if not isinstance(file, dict):
        return _path("file", file)
    case = file.get("case")
    return {**file, "case": os.path.abspath(case)} if isinstance(case, str | os.PathLike) else file


def _best(row: int, objective: float, axes: list[tuple[str, float | None, str | None]]) -> dict[str, Any]:
    values = {key: word if number is None else number for key, number, word in axes}
    return {"row": row, "objective": objective, **values}


def _compute_on(executor: Any, given: str | dict[str, Any], folder: Path, tell: Tell | None) -> None:
    """Computes the missing parts on the workers of an executor; each part is written as soon as those before it are."""
    if not callable(getattr(executor, "submit", None)):
        raise InputError(f"executor: must have a method submit, as concurrent.futures and Dask have, not {type(executor).__name__}")
    parts, points = _damprig.study_missing(given, folder)
    done = points - sum(rows for _, rows in parts)
    there = given if isinstance(given, dict) else os.path.abspath(given)
    # Dask takes equal calls for one unless it is told otherwise.
    own = {"pure": False} if type(executor).__module__.split(".")[0] == "distributed" else {}
    at_once = min(_at_once(executor), len(parts))
    futures = [executor.submit(_damprig.study_rows, there, part, at_once, **own) for part, _ in parts]
    try:
        for place, (part, rows) in enumerate(parts):
            # The rows of a part are not kept.
            future, futures[place] = futures[place], None
            _damprig.study_write(given, folder, part, future.result())
            done += rows
            if tell:
                tell(done, points)
    finally:
        for future in filter(None, futures):
            future.cancel()


def _at_once(executor: Any) -> int:
    """How many parts are computed on one machine at the same time."""
    if callable(getattr(executor, "nthreads", None)):  # A client of Dask: threads of each worker's address, tcp://host:port.
        threads: dict[str, int] = {}
        for address, count in executor.nthreads().items():
            host = address.rsplit(":", 1)[0]
            threads[host] = threads.get(host, 0) + count
        return max(threads.values(), default=1)
    return getattr(executor, "_max_workers", 1)  # Of the pools of concurrent.futures, which tell it in no other way.


def evaluate(
    case: str | os.PathLike[str] | Case | dict[str, Any],
    keys: Sequence[str],
    points: ArrayLike,
    metrics: str | Metric | Sequence[str | Metric],
    *,
    axis: Sequence[keys.StudyAxis | dict[str, Any]] = (),
    record: keys.StudyRecord | dict[str, Any] | None = None,
) -> np.ndarray:
    """Metrics of a case at many points, on all cores: for SALib, pymoo, Optuna, SciPy and what else draws points.

    Parameters
    ----------
    case : path or dict
        A case file, or a dict with the keys of one.
    keys : sequence of str
        What varies: keys of the case with their tables, as ``"particle.clearance_m"``.
    points : array_like of shape (n, len(keys))
        The values of the keys at each point, in the units of the keys.
    metrics : str, function or a sequence of them
        What is computed; docs/STUDIES.md lists the metrics by name. A function of yours takes the :class:`damprig.Simulation` of a point, the whole
        ``run`` of the case, and returns a number; it is called in several threads at once.
    axis : sequence of dict, optional
        Axes of a study with ``reduce``, over which each point is judged: a band of frequencies.
    record : dict, optional
        What is counted of each simulation, as in a study: ``{"settle_cycles": 200, "cycles": 100}``. As the case's ``run`` says when left
        out.

    Returns
    -------
    numpy.ndarray of shape (n, len(metrics)), or (n,) for a single metric
        In SI units; not a number where a metric does not exist.

    Raises
    ------
    InputError
        The case, a key or a value is wrong; nothing is returned then.
    """
    array = _points(keys, points)
    is_single = isinstance(metrics, str) or callable(metrics)
    wanted = [metrics] if is_single else list(metrics)
    names = [metric for metric in wanted if not callable(metric)]
    named = iter(_named(case, keys, array, names, axis, record).T if names or not wanted else [])
    functions = [metric for metric in wanted if callable(metric)]
    if functions and len(axis):
        raise InputError("axis is not allowed: a function among the metrics has the motion of one point; leave out `axis`")
    if record is not None and not names:
        raise InputError("record is not allowed: a function has the whole motion; leave out `record`, or count in the function")
    own = iter(_of_motions(case, keys, array, functions).T)
    values = np.column_stack([next(own if callable(metric) else named) for metric in wanted])
    return values[:, 0] if is_single else values


def _named(case: Any, keys: Any, array: np.ndarray, names: list[str], axis: Any, record: Any) -> np.ndarray:
    """Metrics by name: a row for each point."""
    given = {"case": case, "metrics": names, "points": "points", "axis": list(axis)}
    values = _damprig.evaluate(_given(given if record is None else {**given, "record": record}), list(keys), array)
    unresolved = np.flatnonzero(values[:, -1])
    if len(unresolved):
        message = f"too many events fell on one instant at {len(unresolved)} of {len(values)} points, first at point {unresolved[0]}"
        warnings.warn(message, UserWarning, stacklevel=3)
    return values[:, :-1]


def _of_motions(case: Any, keys: Any, array: np.ndarray, functions: list[Metric]) -> np.ndarray:
    """Functions of the motions: a row for each point. The motions are simulated on all cores."""

    def values(point: list[float]) -> list[float]:
        motion = simulate(case, set=dict(zip(keys, point, strict=True)))
        return [float(function(motion)) for function in functions]

    if not functions:
        return np.empty((len(array), 0))
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        try:
            return np.array(list(pool.map(values, array.tolist()))).reshape(len(array), len(functions))
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def _points(keys: Any, points: ArrayLike) -> np.ndarray:
    if isinstance(keys, str) or not all(isinstance(key, str) for key in keys):
        raise InputError(f"keys = {keys!r} is not allowed: must be a list of keys of the case")
    array = real_array("points", points)
    if array.ndim != 2 or array.shape[1] != len(keys):
        raise InputError(f"points has the shape {array.shape}: must be (n, {len(keys)}), a column for each key")
    return array


# Sampled cycles of a diagram: 2 GB.
_MAX_CYCLES = 40_000_000


def bifurcation(
    case: str | os.PathLike[str] | Case | dict[str, Any],
    key: str,
    values: ArrayLike,
    *,
    direction: str = "both",
    settle_cycles: int = 200,
    cycles: int = 60,
) -> Bifurcation:
    """Sweeps a key of a case up and down, as ``damprig study bifurcation`` does; the motion goes on from value to value.

    Parameters
    ----------
    case : path or dict
        A case file (TOML or JSON) under a sine, or a dict with the keys of one (docs/KEYS.md).
    key : str
        The key with its tables: ``"particle.clearance_ratio"``.
    values : array_like of shape (n,)
        Its values, rising, at least two.
    direction : {"both", "up", "down"}
        Directions of the sweep. Where up and down differ, two motions exist.
    settle_cycles, cycles : int
        Cycles at each value before sampling, and sampled ones.

    Returns
    -------
    Bifurcation
        A row for each sampled cycle: ``direction``, the key, ``x_m``, ``v_m_per_s``, ``y_minus_x_m`` and ``u_minus_v_m_per_s`` at the end of the cycle (the
        Poincaré section), and ``cycle_max_m``, its largest ``|x|``. A motion that repeats every k cycles has k points at a
        value, a chaotic one fills a set.

    Raises
    ------
    InputError
        The case or an argument is wrong.

    Notes
    -----
    Ctrl-C ends a sweep between two values.
    """
    if not isinstance(key, str) or not re.fullmatch(r"\w+(\.\w+)*", key):
        raise InputError(f"key = {key!r} is not allowed: must be a key with its tables, for example 'particle.clearance_ratio'")
    swept = _rising("values", values)
    directions = {"both": ["up", "down"], "up": ["up"], "down": ["down"]}.get(direction) if isinstance(direction, str) else None
    if directions is None:
        raise InputError(f"direction = {direction!r} is not allowed: must be 'both', 'up' or 'down'")
    counts = (_count("settle_cycles", settle_cycles, 0), _count("cycles", cycles, 1))
    if len(directions) * len(swept) * counts[1] > _MAX_CYCLES:
        raise InputError(f"values and cycles: {len(directions) * len(swept) * counts[1]} sampled cycles, must be {_MAX_CYCLES} or fewer")
    return Bifurcation(_damprig.bifurcation(case, key, swept.tolist(), directions, counts), key)


def basins(
    case: str | os.PathLike[str] | Case | dict[str, Any],
    starts: dict[str, ArrayLike],
    *,
    cycles: int = 3000,
) -> Basins:
    """Follows every start of a grid until its motion repeats, as ``damprig study basins`` does: which attractor does it end on?

    Parameters
    ----------
    case : path or dict
        A case file (TOML or JSON) under a sine, or a dict with the keys of one (docs/KEYS.md).
    starts : dict of str to array_like
        Two keys of ``initial``, each with its rising values: ``{"initial.x_m": np.linspace(-0.05, 0.05, 51), "initial.v_m_per_s": …}``.
    cycles : int
        Most cycles of a start, at least 264; a motion that has not settled by then, or does not repeat within 16 cycles, has no attractor.

    Raises
    ------
    InputError
        The case or a start is wrong.

    Notes
    -----
    Motions whose states agree within 0.1 % are one attractor. The place of a particle that meets no wall, and of a structure that its friction
    damper holds, does not count. Ctrl-C raises KeyboardInterrupt.
    """
    if not isinstance(starts, dict) or len(starts) != 2 or not all(isinstance(key, str) for key in starts):
        raise InputError("starts: must be a dict of two keys of `initial` with their values, for example 'initial.x_m' and 'initial.v_m_per_s'")
    axes = [(key, _rising(key, values).tolist()) for key, values in starts.items()]
    native, attractors, unresolved = _damprig.basins(case, axes, _count("cycles", cycles, 264))
    if unresolved:
        message = f"too many events fell on one instant in {unresolved} of {len(axes[0][1]) * len(axes[1][1])} motions"
        warnings.warn(message, UserWarning, stacklevel=2)
    first, second = starts
    return Basins((first, second), Table(native), Table(attractors))


def _rising(name: str, values: ArrayLike) -> np.ndarray:
    array = real_array(name, values)
    if array.ndim != 1 or len(array) < 2:
        raise InputError(f"{name} has the shape {array.shape}: must be a list of two or more numbers in rising order")
    wrong = np.flatnonzero(~np.isfinite(array) | np.append(False, ~(np.diff(array) > 0)))
    if len(wrong):
        raise InputError(f"{name}: value {wrong[0]} is {array[wrong[0]]}: must be finite numbers in rising order")
    return array


def _count(name: str, given: Any, least: int) -> int:
    try:
        number = operator.index(given)
    except TypeError:
        number = -1
    if not least <= number <= 1_000_000:
        raise InputError(f"{name} = {given!r} is not allowed: must be a whole number from {least} to 1000000")
    return number


def optimise(file: str | os.PathLike[str] | keys.Optimisation | dict[str, Any]) -> Optimisation:
    """Optimises keys of a case; the answer of ``damprig optimise --json`` as a dict with ``plot()`` (docs/OPTIMISE.md).

    Parameters
    ----------
    file : path or dict
        Optimisation file (TOML), or a dict with the keys of one, whose ``case`` may be a dict too.

    Raises
    ------
    InputError
        The file or its case is wrong.
    """
    return Optimisation(json.loads(_damprig.optimise(_given(file))))


def continuation(file: str | os.PathLike[str] | keys.Continuation | dict[str, Any]) -> Branches:
    """Follows periodic orbits over a parameter; the answer of ``damprig continue --json`` as a dict with ``plot()`` (docs/CONTINUE.md).

    Parameters
    ----------
    file : path or dict
        Continuation file (TOML), or a dict with the keys of one, whose ``case`` may be a dict too.

    Raises
    ------
    InputError
        The file or its case is wrong, or there is no periodic orbit to start from.
    """
    return Branches(json.loads(_damprig.continuation(_given(file))))


def _path(name: str, given: Any) -> str:
    try:
        return os.fsdecode(given)
    except TypeError:
        raise InputError(f"{name}: must be the path of a file, or a dict with the keys of one, not {type(given).__name__}") from None
