"""A device for Bluesky plans: frequency in, X/Z out.

It follows Bluesky's protocols (Movable, Triggerable, Readable) without importing Bluesky or ophyd.

>>> from bluesky import RunEngine, plans                     # doctest: +SKIP
>>> device = FrequencyResponse(rig, dwell_s=8)               # doctest: +SKIP
>>> RunEngine()(plans.scan([device], device, 2.0, 3.0, 11))  # doctest: +SKIP
"""

import threading
import time
from collections import OrderedDict

__all__ = ["FrequencyResponse"]

READINGS = {
    "x_over_z": "1",
    "x_over_z_lock_in": "1",
    "x_amplitude_m": "m",
    "z_amplitude_m": "m",
    "phase_rad": "rad",
}


class _Status:
    """Bluesky's Status: whether something is done, and with what exception."""

    def __init__(self):
        self._lock = threading.Lock()
        self._ended = threading.Event()
        self._exception = None
        self._callbacks = []

    @property
    def done(self):
        return self._ended.is_set()

    @property
    def success(self):
        return self.done and self._exception is None

    def exception(self, timeout=0.0):
        if not self._ended.wait(timeout):
            raise TimeoutError("the measurement is not done")
        return self._exception

    def wait(self, timeout=None):
        if not self._ended.wait(timeout):
            raise TimeoutError("the measurement is not done")
        if self._exception is not None:
            raise self._exception

    def add_callback(self, callback):
        with self._lock:
            if not self.done:
                self._callbacks.append(callback)
                return
        callback(self)

    def end(self, exception=None):
        with self._lock:
            self._exception = exception
            self._ended.set()
            callbacks, self._callbacks = self._callbacks, []
        for callback in callbacks:
            callback(self)


class FrequencyResponse:
    """A virtual rig whose mounted set-up is measured at one frequency after another.

    ``set(frequency_hz)`` chooses the frequency, ``trigger()`` measures there (:meth:`damprig.VirtualRig.measure`) in a thread, ``read()``
    gives the readings: the frequency (``name``), X/Z and amplitudes (``name_x_over_z`` and others).

    Parameters
    ----------
    rig : VirtualRig
        A rig with a mounted set-up.
    name : str
        Prefix of the readings.
    **measure
        Arguments of every measurement: ``dwell_s``, ``settle_s`` and others.
    """

    parent = None

    def __init__(self, rig, name="rig", **measure):
        self.rig = rig
        self.name = name
        self._measure = measure
        self._frequency_hz = None
        self._row = None
        self._measured_at = time.time()
        self._set_at = time.time()

    @property
    def position(self):
        """The frequency that was set last, Hz; None before."""
        return self._frequency_hz

    @property
    def hints(self):
        """What Bluesky's callbacks plot."""
        return {"fields": [self.name, f"{self.name}_x_over_z"]}

    def set(self, frequency_hz):
        """Choose the frequency, Hz, of the next measurement."""
        status = _Status()
        try:
            self._frequency_hz = float(frequency_hz)
            self._row = None
            self._set_at = time.time()
            status.end()
        except (TypeError, ValueError) as error:
            status.end(error)
        return status

    def trigger(self):
        """Measure at the chosen frequency."""
        status = _Status()

        def measure():
            try:
                if self._frequency_hz is None:
                    raise RuntimeError(f"{self.name}: no frequency is set")
                self._row = self.rig.measure(self._frequency_hz, **self._measure)
                self._measured_at = time.time()
                status.end()
            except Exception as error:
                status.end(error)

        threading.Thread(target=measure, name=f"{self.name} measures", daemon=True).start()
        return status

    def read(self):
        """The frequency and the last measurement; NaN for what is not measured yet."""
        nan = float("nan")
        frequency_hz = nan if self._frequency_hz is None else self._frequency_hz
        readings = OrderedDict({self.name: {"value": frequency_hz, "timestamp": self._set_at}})
        for key in READINGS:
            value = nan if self._row is None else self._row[key]
            readings[f"{self.name}_{key}"] = {"value": value, "timestamp": self._measured_at}
        return readings

    def describe(self):
        """Units and types of the readings."""
        source = "damprig virtual rig"
        described = OrderedDict({self.name: {"source": source, "dtype": "number", "shape": [], "units": "Hz"}})
        for key, unit in READINGS.items():
            described[f"{self.name}_{key}"] = {"source": source, "dtype": "number", "shape": [], "units": unit}
        return described

    def read_configuration(self):
        """The arguments of the measurements."""
        now = time.time()
        return OrderedDict((f"{self.name}_{key}", {"value": value, "timestamp": now}) for key, value in self._plain().items())

    def describe_configuration(self):
        """Types of the arguments of the measurements."""
        return OrderedDict(
            (f"{self.name}_{key}", {"source": "argument", "dtype": "string" if isinstance(value, str) else "number", "shape": []})
            for key, value in self._plain().items()
        )

    def _plain(self):
        return {key: value for key, value in self._measure.items() if isinstance(value, (int, float, str))}
