"""The virtual rig: the controller's own code and a simulated plant in this process."""

import json
import math
import os
import warnings
from dataclasses import dataclass

import numpy as np

from . import _damprig
from .errors import InputError, RigError, UnusualValueWarning
from .runs import open_run
from .tables import Table

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
    signals: dict
    units: dict
    events: list

    def __getitem__(self, name):
        try:
            return self.signals[name]
        except KeyError:
            raise KeyError(f"the signal {name!r} was not recorded; recorded are {', '.join(self.signals)}") from None

    def __len__(self):
        return len(self.time)

    def __repr__(self):
        return f"<damprig.Signals: {len(self)} rows of {', '.join(self.signals)}; {len(self.events)} events>"

    @property
    def faults(self):
        """The faults among the events: dicts with ``cause``, ``tick``, ``value`` and ``limit``."""
        return [event for event in self.events if event["event"] == "fault"]

    def frame(self, library="pandas"):
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

    def __init__(self, settings=None, sensors="ideal", *, seed=1, noise_rms_m=0.0, single_precision=False):
        self._rig = {"noise_seed": seed, "sensor_noise_rms_m": noise_rms_m, "sensors": _sensors(sensors)}
        self._native = _damprig.NativeRig(settings, bool(single_precision))
        self._set_up = None
        self._is_started = False
        self.signal_units = dict(self._native.signals())

    def __repr__(self):
        mounted = "nothing mounted" if self._set_up is None else f"{self._set_up['name']} mounted"
        return f"<damprig.VirtualRig: {mounted}, {self.status()['state']}>"

    def mount(self, set_up):
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

    def measure(self, frequency_hz, *, dwell_s=32.0, settle_s=0.0, base_amplitude_m=None, **experiment):
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
        stepped = {"kind": "stepped_sine", "frequencies_hz": [frequency_hz], "start": "from_rest"}
        stepped |= {"dwell_s": dwell_s, "settle_s": settle_s, **experiment}
        table = self.experiment(stepped, base_amplitude_m=base_amplitude_m)
        return {name: values[0].item() if isinstance(values, np.ndarray) and values.dtype != object else values[0]
                for name, values in table.columns.items()}

    def experiment(self, experiment, *, base_amplitude_m=None):
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
        experiment=None,
        *,
        frequency_hz=None,
        duration_s=600.0,
        base_amplitude_m=None,
        signals=("x", "z", "drive", "frequency"),
        rate_hz=1000,
    ):
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

    def advance(self, seconds):
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

    def values(self):
        """The values of all signals in the last tick: a dict of name to float, in the units of :attr:`signal_units`."""
        return dict(zip(self.signal_units, self._native.values(), strict=True))

    def status(self):
        """State, tick, latched ``fault`` (or None), safety and friction spring: a dict."""
        return json.loads(self._native.status())

    def stop(self):
        """End the experiment and wait until the drive is off. A fault stays latched."""
        self._native.stop()

    def emergency_stop(self):
        """Press the emergency stop. It stays pressed until :meth:`release_emergency_stop`; the fault stays latched after that."""
        self._native.emergency_stop(True)

    def release_emergency_stop(self):
        """Release the emergency stop."""
        self._native.emergency_stop(False)

    def clear_fault(self):
        """Clear a latched fault.

        Raises
        ------
        RigError
            The rig is not safe yet: the structure rings, or the emergency stop is pressed. :meth:`rest` waits for it.
        """
        self._native.clear_fault()

    def rest(self):
        """Stop the drive, let time pass until the structure is at rest, and clear a fault."""
        self._native.rest()

    def run(self, campaign, out=None):
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

    def _call(self, native, *arguments):
        """Calls, and warns of what is unusual even when the call fails."""
        try:
            return native(*arguments)
        finally:
            for warning in self._native.take_warnings():
                warnings.warn(warning, UnusualValueWarning, stacklevel=3)

    def _mounted(self, base_amplitude_m):
        if self._set_up is None:
            raise RigError("no set-up is mounted: mount one with mount()")
        changed = {} if base_amplitude_m is None else {"base_amplitude_m": base_amplitude_m}
        return {**self._set_up, **changed}

    def _campaign(self, set_up, experiment, telemetry=None):
        telemetry = {"rate_hz": 0} if telemetry is None else telemetry
        return {"name": "python", "rig": self._rig, "telemetry": telemetry, "set_up": [set_up], "experiment": [experiment]}


def _sensors(sensors):
    if isinstance(sensors, dict):
        return sensors
    if sensors in ("ideal", "data_sheet"):
        return {"kind": sensors}
    raise InputError(f'sensors = {sensors!r} is not allowed: must be "ideal", "data_sheet" or a dict with the keys of [rig.sensors]')

