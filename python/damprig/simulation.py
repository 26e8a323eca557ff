"""Simulates a case exactly, as ``damprig simulate`` does."""

from __future__ import annotations

import json
import warnings
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _damprig
from .errors import InputError, UnusualValueWarning
from .numbers import real_array
from .plots import plot_motion
from .tables import Table

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping

    from numpy.typing import ArrayLike

    from .keys import Case

__all__ = ["Accumulations", "Contacts", "Impacts", "Simulation", "analyse", "simulate"]


@dataclass(frozen=True)
class Impacts:
    """The impacts of the particle, or its first touches of a soft wall; arrays of shape ``(n,)``, the first million.

    Attributes
    ----------
    time : numpy.ndarray
        s.
    side : numpy.ndarray of int8
        +1 where y − x = +d, −1 where y − x = −d.
    approach_speed : numpy.ndarray
        abs(x′ − y′) just before, m/s.
    y : numpy.ndarray
        Displacement of the particle, m; not a number of a particle other than that of ``Simulation.y``.
    damper : numpy.ndarray of uint32
        Number of the impact damper, from 1.
    """

    time: np.ndarray
    side: np.ndarray
    approach_speed: np.ndarray
    y: np.ndarray
    damper: np.ndarray

    def __len__(self) -> int:
        return len(self.time)


@dataclass(frozen=True)
class Contacts:
    """Contacts with Hertz walls that have ended; arrays of shape ``(n,)``, the first million.

    Attributes
    ----------
    time : numpy.ndarray
        First touch, s.
    side : numpy.ndarray of int8
        +1 where y − x = +d, −1 where y − x = −d.
    approach_speed : numpy.ndarray
        abs(x′ − y′) at the first touch, m/s; 0 where the particle began to press from rest.
    duration : numpy.ndarray
        From the first touch until the penetration is zero, s.
    peak_force : numpy.ndarray
        Largest force, N.
    restitution : numpy.ndarray
        Separation speed over approach speed; not a number where the particle began to press from rest.
    damper : numpy.ndarray of uint32
        Number of the impact damper, from 1.
    """

    time: np.ndarray
    side: np.ndarray
    approach_speed: np.ndarray
    duration: np.ndarray
    peak_force: np.ndarray
    restitution: np.ndarray
    damper: np.ndarray

    def __len__(self) -> int:
        return len(self.time)


@dataclass(frozen=True)
class Accumulations:
    """Chatters that ended with the particle at rest on a wall; arrays of shape ``(n,)``. The impacts of their tails are summed, neither
    listed nor counted.

    Attributes
    ----------
    time : numpy.ndarray
        End of the chatter, s.
    side : numpy.ndarray of int8
        +1 where y − x = +d, −1 where y − x = −d.
    """

    time: np.ndarray
    side: np.ndarray

    def __len__(self) -> int:
        return len(self.time)


@dataclass(frozen=True)
class Simulation:
    """A simulated motion. Arrays have the shape ``(rows,)``.

    Attributes
    ----------
    name : str
        Name of the case.
    time : numpy.ndarray
        s.
    x, v : numpy.ndarray
        Displacement (m) and velocity (m/s) of the structure.
    y, u : numpy.ndarray
        Displacement (m) and velocity (m/s) of the particle or the tuned mass; equal to x and v without one.
    z : numpy.ndarray
        Displacement of the base, m.
    impacts : Impacts
        The impacts.
    contacts : Contacts
        The contacts with Hertz walls; none at other walls.
    accumulations : Accumulations
        The chatters that ended on a wall.
    summary : dict
        Statistics of the whole run; each key ends with its unit.
    places : list of dict
        Of a structure with several places: ``place``, ``max_abs_x_m``, ``max_abs_x_minus_z_m``, ``rms_x_m`` and
        ``max_abs_acceleration_m_per_s2`` (absolute, between impacts) of each, of a frame ``max_abs_drift_m`` (relative to the floor below, or
        to the base) too; empty otherwise.
    impact_dampers : list of dict
        Of a structure with several places: ``place``, ``impact_count`` and ``max_approach_speed_m_per_s`` of each; empty otherwise.
    mode_shares : list of dict
        Of a structure with several places, from the lowest mode up: ``frequency_hz``, ``energy_share`` (its mean energy over that of all modes,
        0 to 1) and ``rms_x_m`` (of its part of x); empty otherwise.
    parameters : dict
        The set-up in SI units as it was simulated; each key ends with its unit.
    units : dict of str to str
        Units of the arrays.
    """

    name: str
    time: np.ndarray
    x: np.ndarray
    v: np.ndarray
    y: np.ndarray
    u: np.ndarray
    z: np.ndarray
    impacts: Impacts
    contacts: Contacts
    accumulations: Accumulations
    summary: dict[str, Any]
    places: list[dict[str, Any]]
    impact_dampers: list[dict[str, Any]]
    mode_shares: list[dict[str, Any]]
    parameters: dict[str, Any]
    units: dict[str, str] = field(
        default_factory=lambda: {"time": "s", "x": "m", "v": "m/s", "y": "m", "u": "m/s", "z": "m"},
    )

    def __repr__(self) -> str:
        return f"<damprig.Simulation {self.name}: {len(self.time)} rows, {len(self.impacts)} impacts>"

    def frame(self, library: str = "pandas") -> Any:
        """The motion as a frame of ``"pandas"`` or ``"polars"``, or a Dataset of ``"xarray"``; see :meth:`damprig.Table.frame`."""
        columns = {name: getattr(self, name) for name in self.units}
        return Table({"columns": columns, "units": self.units, "descriptions": dict.fromkeys(columns, "")}).frame(library)

    def plot(self, ax: Any = None) -> Any:
        """Draw structure, second mass between its walls, base and impacts over time with matplotlib; returns the axes."""
        return plot_motion(self, ax)


def analyse(case: str | os.PathLike[str] | Case | dict[str, Any]) -> dict[str, Any]:
    """Analyse a case: the ``analysis`` of ``damprig simulate --analyse --json`` as a dict.

    It has the energy balance (``energy``) and the end of the run (``driven``): whether the motion repeats, its periodic orbit with Floquet
    multipliers, and ``sensitivities``: exact relative changes of the largest ``|x|``, the RMS of x and the speed of the fastest impact per relative change
    of each quantity, through every impact, stick and slip. Every other quantity keeps its value in SI units, but stiffness and dashpot of
    the structure follow from M, fn and ζ. ``holds_within`` is the relative change at which, to first order, an event appears or vanishes.
    ``driven`` is ``None`` without a sine, on a record and with several places; ``energy`` is missing on a record and with several places.
    Without them ``no_orbit`` or ``no_sensitivities`` says why. A motion that is not periodic has ``lyapunov``: the mean of ln(growth) of a small
    disturbance in a drive period, with its standard error.

    Where these are missing, ``sensitivities`` beside ``driven`` are by every number in the case, whose other keys stay as they are: of the periodic
    motion that the run ends on, whose drive periods and multipliers ``run`` has, or else of the whole run.

    Parameters
    ----------
    case : path or dict
        A case file (TOML or JSON), or a dict with the keys of one (docs/KEYS.md).

    Raises
    ------
    InputError
        The case is wrong, or has spheres.
    """
    unusual, analysis = _damprig.analyse(case)
    for warning in unusual:
        warnings.warn(warning, UnusualValueWarning, stacklevel=2)
    return json.loads(analysis)


def simulate(
    case: str | os.PathLike[str] | Case | dict[str, Any],
    *,
    set: Mapping[str, Any] | None = None,
    sample_times: ArrayLike | None = None,
    rate_hz: float | None = None,
) -> Simulation:
    """Simulate a case exactly: every impact, stick and slip is located.

    Parameters
    ----------
    case : path or dict
        A case file (TOML or JSON), or a dict with the keys of one (docs/KEYS.md). Relative files of a dict are those of the working
        directory. Arrays and scalars of NumPy are allowed.
    set : dict of str, optional
        Values in place of the case's, by their keys with tables: ``{"particle.wall.coefficient": 0.5}``, as ``--set`` of the command.
    sample_times : array_like of shape (n,), optional
        Times of the rows, s, in rising order, from 0 to the case's ``duration_s``.
    rate_hz : float, optional
        Rows per second from 0 to the end. Without either: ``run.sample_times_s`` of the case, or else 200 rows per drive or natural
        period, whichever is shorter; with a record at least its sample rate.

    Returns
    -------
    Simulation

    Raises
    ------
    InputError
        The case or an argument is wrong: all problems with line, key, value, what is allowed and the likely fix.

    Notes
    -----
    Other threads run meanwhile, and may simulate too. Ctrl-C raises KeyboardInterrupt.
    """
    if sample_times is not None and rate_hz is not None:
        raise InputError("sample_times and rate_hz are both given: give one of them")
    times = None if sample_times is None else _times(sample_times)
    done = _damprig.simulate(case, _assignments(set or {}), times, None if rate_hz is None else _number("rate_hz", rate_hz))
    for warning in done.pop("warnings"):
        warnings.warn(warning, UnusualValueWarning, stacklevel=2)
    done["summary"] = json.loads(done["summary"])
    done["parameters"] = json.loads(done["parameters"])
    several_places = json.loads(done.pop("several_places")) or {}
    for name in ("places", "impact_dampers", "mode_shares"):
        done[name] = several_places.get(name, [])
    done["impacts"] = Impacts(**done["impacts"])
    done["contacts"] = Contacts(**done["contacts"])
    done["accumulations"] = Accumulations(**done["accumulations"])
    listed, counted = len(done["impacts"]), done["summary"]["impact_count"]
    if counted > listed:
        message = f"the result lists the first {listed} of {counted} impacts; `damprig simulate --out` writes them all"
        warnings.warn(message, UserWarning, stacklevel=2)
    return Simulation(**done)


def _assignments(values: Mapping[str, Any]) -> list[str]:
    try:
        return [f"{key}={json.dumps(value, default=lambda array: array.tolist())}" for key, value in values.items()]
    except (AttributeError, TypeError) as error:
        message = f"set = {values!r} is not allowed: must be a dict from keys of the case to numbers, words or lists"
        raise InputError(message) from error


def _times(sample_times: ArrayLike) -> list[float]:
    times = real_array("sample_times", sample_times)
    if times.ndim != 1:
        raise InputError(f"sample_times has the shape {times.shape}: must have one dimension")
    return times.tolist()


def _number(name: str, value: Any) -> float:
    array = np.asarray(value)
    if array.dtype.kind not in "iuf" or array.ndim != 0:
        raise InputError(f"{name} = {value!r} is not allowed: must be one real number")
    return float(array)
