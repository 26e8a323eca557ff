"""The virtual rig: the controller's own code and a simulated plant in this process."""

from __future__ import annotations

import json
import math
import os
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from . import _damprig
from .errors import InputError, RigError, UnusualValueWarning
from .runs import Run, open_run
from .tables import Table

if TYPE_CHECKING:
    from . import keys

__all__ = ["Signals", "VirtualRig"]

TICK_HZ = 1000


@dataclass(frozen=True)
class Signals:
    """What the controller sent while time passed.

    Attributes
    ----------
    time : numpy.ndarray of shape (rows,)
        Time since the start of the experiment, s.
    signals : dict of str to numpy.ndarray of shape (rows,)
        The recorded signals, in single precision as the controller has them.
    units : dict of str to str
        Unit of each signal; "" for one without.
    events : list of dict
        ``point``, ``transient``, ``impact``, ``spring``, ``fault`` and ``finished`` in their order; each with ``event``, ``tick``,
        ``time`` (s) and its own values.
    """

    time: np.ndarray
    signals: dict[str, np.ndarray]
    units: dict[str, str]
    events: list[dict[str, Any]]

    def __getitem__(self, name: str) -> np.ndarray:
        try:
            return self.signals[name]
        except KeyError:
            raise KeyError(f"the signal {name!r} was not recorded; recorded are {', '.join(self.signals)}") from None

    def __len__(self) -> int:
        return len(self.time)

    def __repr__(self) -> str:
        return f"<damprig.Signals: {len(self)} rows of {', '.join(self.signals)}; {len(self.events)} events>"

    @property
    def faults(self) -> list[dict[str, Any]]:
        """The faults among the events: dicts with ``cause``, ``tick``, ``value`` and ``limit``."""
        return [event for event in self.events if event["event"] == "fault"]

    def frame(self, library: str = "pandas") -> Any:
        """The signals as a frame of ``"pandas"`` or ``"polars"``, or a Dataset of ``"xarray"``; see :meth:`damprig.Table.frame`."""
        columns = {"time": self.time, **self.signals}
        units = {"time": "s", **self.units}
        return Table({"columns": columns, "units": units, "descriptions": dict.fromkeys(columns, "")}).frame(library)


class VirtualRig:
    """A rig in this process: the controller's code, as on the board, and a simulated plant.

    Time passes only within calls. The same calls on a new rig with the same seed give the same numbers.

    Parameters
    ----------
    settings : path or dict, optional
        The board's settings, as ``damprig settings export`` writes them; those left out, and all without it, are as delivered.
    sensors : {"ideal", "data_sheet"} or dict
        Errors of the simulated sensors of a mounted set-up: none, those of the data sheet, or the keys of ``[rig.sensors]``. A
        campaign given to :meth:`run` has its own.
    seed : int
        Seed of the sensors' noise, and of where a particle with an unknown start lies.
    noise_rms_m : float
        RMS noise of a displacement sample, m.
    single_precision : bool
        Simulate the plant in single precision, as the emulated board does.

    Raises
    ------
    InputError
        An argument or the settings are wrong.
    """

    def __init__(
        self,
        settings: str | os.PathLike[str] | dict[str, Any] | None = None,
        sensors: Literal["ideal", "data_sheet"] | keys.CampaignRigSensors | dict[str, Any] = "ideal",
        *,
        seed: int = 1,
        noise_rms_m: float = 0.0,
        single_precision: bool = False,
    ) -> None:
        self._rig = {"noise_seed": seed, "sensor_noise_rms_m": noise_rms_m, "sensors": _sensors(sensors)}
        self._native = _damprig.NativeRig(settings, bool(single_precision))
        self._set_up: dict[str, Any] | None = None
        self._is_started = False
        self.signal_units: dict[str, str] = dict(self._native.signals())

    def __repr__(self) -> str:
        mounted = "nothing mounted" if self._set_up is None else f"{self._set_up['name']} mounted"
        return f"<damprig.VirtualRig: {mounted}, {self.status()['state']}>"

    def mount(self, set_up: keys.CampaignSetUp | dict[str, Any]) -> None:
        """Mount a set-up: a dict with the keys of ``[[set_up]]`` of a campaign (structure, dampers, ``base_amplitude_m``). A ``name`` is
        not needed.

        Raises
        ------
        InputError
            The set-up is wrong: all problems.
        """
        if not isinstance(set_up, dict):
            raise InputError(f"set_up: must be a dict with the keys of a set-up, not {type(set_up).__name__}")
        set_up = {"name": "mounted", **set_up}
        placeholder = {"kind": "stepped_sine", "frequencies_hz": [1.0], "start": "from_rest", "dwell_s": 10.0}
        self._call(self._native.check, self._campaign(set_up, placeholder))
        self._set_up = set_up

    def measure(
        self,
        frequency_hz: float,
        *,
        dwell_s: float = 32.0,
        settle_s: float = 0.0,
        base_amplitude_m: float | None = None,
        **experiment: Any,
    ) -> dict[str, Any]:
        """Measure one frequency as a campaign does: the structure comes to rest, the base moves, X/Z is measured.

        Parameters
        ----------
        frequency_hz : float
            Drive frequency, Hz.
        dwell_s, settle_s : float
            The time that is measured, and the time before it, s.
        base_amplitude_m : float, optional
            Z, m; that of the set-up without it.
        **experiment
            Further keys of a stepped sine (docs/KEYS.md): ``start``, ``ramp_s``, ``steady``, ``drive`` and others.

        Returns
        -------
        dict
            The row of the results: ``x_over_z``, ``x_amplitude_m``, ``phase_rad``, ``steadiness`` and others; each name ends with its
            unit.

        Raises
        ------
        FaultError
            An interlock ended the drive.
        InputError
            A value is wrong, or the predicted motion leaves a limit.
        """
        point = {"frequencies_hz": [frequency_hz], "dwell_s": dwell_s, "settle_s": settle_s}
        stepped = {"kind": "stepped_sine", "start": "from_rest", **point, **experiment}
        self._is_started = False
        campaign = self._campaign(self._mounted(base_amplitude_m), stepped)
        return Table(self._call(self._native.measure, campaign)["points"]).row(0)

    def experiment(self, experiment: keys.CampaignExperiment | dict[str, Any], *, base_amplitude_m: float | None = None) -> Table:
        """Run an experiment on the mounted set-up: a dict with the keys of ``[[experiment]]`` of a campaign.

        Returns
        -------
        Table
            A row per point of a stepped sine; else the row of the record, pulse or free vibration.
        """
        self._is_started = False
        done = self._call(self._native.measure, self._campaign(self._mounted(base_amplitude_m), experiment))
        points = Table(done["points"])
        return points if len(points) else Table(done["transients"])

    def start(
        self,
        experiment: keys.CampaignExperiment | dict[str, Any] | None = None,
        *,
        frequency_hz: float | None = None,
        duration_s: float = 600.0,
        base_amplitude_m: float | None = None,
        signals: Sequence[str] = ("x", "z", "drive", "frequency"),
        rate_hz: float = 1000,
    ) -> None:
        """Start an experiment and leave its time to :meth:`advance`.

        Parameters
        ----------
        experiment : dict, optional
            The keys of ``[[experiment]]``. Without it: a sine of ``frequency_hz`` for ``duration_s``, or until :meth:`stop`.
        base_amplitude_m : float, optional
            Z, m; that of the set-up without it.
        signals : sequence of str
            Names of up to 16 signals to record; :attr:`signal_units` has all.
        rate_hz : float
            Rows per second: 1000 divided by a whole number.
        """
        if (experiment is None) == (frequency_hz is None):
            raise InputError("give either an experiment or frequency_hz")
        if experiment is None:
            experiment = {"kind": "stepped_sine", "frequencies_hz": [frequency_hz], "start": "from_rest", "dwell_s": duration_s}
        telemetry = {"rate_hz": rate_hz, "signals": list(signals)}
        self._is_started = False
        self._call(self._native.start, self._campaign(self._mounted(base_amplitude_m), experiment, telemetry))
        self._is_started = True

    def advance(self, seconds: float) -> Signals:
        """Let time pass on the rig.

        Parameters
        ----------
        seconds : float
            Time, s; rounded to whole ticks of 1 ms.

        Returns
        -------
        Signals
            The rows and events since the last call. A fault is an event; the rig then stays in its safe state.
        """
        if not self._is_started:
            raise RigError("no experiment is started: start one with start()")
        if not (isinstance(seconds, (int, float, np.number)) and math.isfinite(seconds) and 0 <= seconds <= 4e6):
            raise InputError(f"seconds = {seconds!r} is not allowed: must be a number from 0 to 4e6")
        done = self._native.advance(round(float(seconds) * TICK_HZ))
        done["events"] = json.loads(done["events"])
        return Signals(**done)

    def values(self) -> dict[str, float]:
        """The values of all signals in the last tick: a dict of name to float, in the units of :attr:`signal_units`."""
        return dict(zip(self.signal_units, self._native.values(), strict=True))

    def status(self) -> dict[str, Any]:
        """State, tick, latched ``fault`` (or None), safety and friction spring: a dict."""
        return json.loads(self._native.status())

    def stop(self) -> None:
        """End the experiment and wait until the drive is off. A fault stays latched."""
        self._native.stop()

    def emergency_stop(self) -> None:
        """Press the emergency stop. It stays pressed until :meth:`release_emergency_stop`; the fault stays latched after that."""
        self._native.emergency_stop(True)

    def release_emergency_stop(self) -> None:
        """Release the emergency stop."""
        self._native.emergency_stop(False)

    def clear_fault(self) -> None:
        """Clear a latched fault.

        Raises
        ------
        RigError
            The rig is not safe yet: the structure rings, or the emergency stop is pressed. :meth:`rest` waits for it.
        """
        self._native.clear_fault()

    def rest(self) -> None:
        """Stop the drive, let time pass until the structure is at rest, and clear a fault."""
        self._native.rest()

    def run(self, campaign: str | os.PathLike[str] | keys.Campaign | dict[str, Any], out: str | os.PathLike[str] | None = None) -> Run:
        """Run a whole campaign into a run folder, as ``damprig run`` does.

        Parameters
        ----------
        campaign : path or dict
            A campaign file (TOML), or a dict with its keys.
        out : path, optional
            A new or empty folder; ``runs/<date>-<campaign>-<short id>`` without it.

        Returns
        -------
        Run
            The recorded run.

        Raises
        ------
        FaultError, RigError
            The run ended early. What was measured is in the folder; ``damprig run --resume`` continues it.
        """
        self._is_started = False
        return open_run(self._call(self._native.run, campaign, None if out is None else os.fspath(out)))

    def _call(self, native: Callable[..., Any], *arguments: Any) -> Any:
        """Calls, and warns of what is unusual even when the call fails."""
        try:
            return native(*arguments)
        finally:
            for warning in self._native.take_warnings():
                warnings.warn(warning, UnusualValueWarning, stacklevel=3)

    def _mounted(self, base_amplitude_m: float | None) -> dict[str, Any]:
        if self._set_up is None:
            raise RigError("no set-up is mounted: mount one with mount()")
        changed = {} if base_amplitude_m is None else {"base_amplitude_m": base_amplitude_m}
        return {**self._set_up, **changed}

    def _campaign(
        self, set_up: dict[str, Any], experiment: dict[str, Any], telemetry: dict[str, Any] | None = None
    ) -> dict[str, Any]:
        telemetry = {"rate_hz": 0} if telemetry is None else telemetry
        return {"name": "python", "rig": self._rig, "telemetry": telemetry, "set_up": [set_up], "experiment": [experiment]}


def _sensors(sensors: str | keys.CampaignRigSensors | dict[str, Any]) -> dict[str, Any]:
    if isinstance(sensors, dict):
        return sensors
    if sensors in ("ideal", "data_sheet"):
        return {"kind": sensors}
    raise InputError(f'sensors = {sensors!r} is not allowed: must be "ideal", "data_sheet" or a dict with the keys of [rig.sensors]')

