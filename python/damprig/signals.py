"""Measured signals of any file that ``damprig inspect`` knows, in the form of SEP005, and response spectra."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _damprig

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

__all__ = ["read_signals", "response_spectrum"]

# The letters of SEP005.
_QUANTITIES = {"acceleration": "a", "velocity": "v", "displacement": "d", "force": "f"}


def read_signals(file: str | os.PathLike[str]) -> list[dict[str, Any]]:
    """Read the signals of a measured file: CSV, UFF, AT2, V2, COSMOS, WAV, MATLAB, HDF5 or Parquet (docs/FILES.md).

    Parameters
    ----------
    file : path
        The file; ``"file#3"`` or ``"file#name"`` selects one of its signals.

    Returns
    -------
    list of dict
        A signal over time has the form of SEP005, which sdypy and pyOMA2 take: ``data`` (shape ``(n,)``, in the unit of the file),
        ``name``, ``unit_str``, ``fs`` in Hz where the times are even, else ``time`` in s; ``quantity`` (``"a"``, ``"v"``, ``"d"`` or
        ``"f"``) where the file states a unit of one. ``start_s`` is its first time and ``si`` the SI units per unit of it, if known.
        A signal over frequency has ``frequency`` in Hz in place of the times, and complex ``data`` where the file has them.
        ``remark`` says what a user must know of the signal, or is absent.

    Raises
    ------
    InputError
        The file cannot be read, or is damaged: with the line or byte.
    """
    return [_signal(native) for native in _damprig.read_signals(os.fspath(file))]


def _signal(native: dict[str, Any]) -> dict[str, Any]:
    signal = {key: native[key] for key in ("data", "name", "unit_str")}
    if "step_s" in native:
        signal["fs"] = 1.0 / native["step_s"]
        signal["start_s"] = native["start_s"]
    for key in ("time", "frequency"):
        if key in native:
            signal[key] = native[key]
    if native["kind"] in _QUANTITIES:
        signal["quantity"] = _QUANTITIES[native["kind"]]
    remarks = [text for text in (native["remark"], native.get("unknown")) if text]
    if remarks:
        signal["remark"] = "; ".join(remarks)
    if native["si"] is not None:
        signal["si"] = native["si"]
    return signal


def response_spectrum(
    record: str | os.PathLike[str],
    *,
    damping: ArrayLike = 0.05,
    periods_s: ArrayLike | None = None,
    method: str = "exact",
    unit: str | None = None,
    sensitivity: str | None = None,
) -> dict[str, np.ndarray]:
    """Response spectra of an acceleration record, as ``damprig spectrum`` computes them (docs/SPECTRUM.md).

    Parameters
    ----------
    record : path
        File with an acceleration over time; ``"file#name"`` selects one of several signals.
    damping : float or array of shape (d,)
        Damping ratios, 0 or more and below 1.
    periods_s : array of shape (p,), optional
        Periods, s, greater than 0; 200 from 0.02 s to 10 s in even ratios when left out.
    method : str
        ``"exact"``: maxima between the samples too; ``"at-samples"``: at the samples only, as agencies publish them; ``"newmark"``.
    unit, sensitivity : str, optional
        What the file does not state: ``"g"``; of a voltage ``"mV"`` and ``"100 mV/g"``.

    Returns
    -------
    dict of str to numpy.ndarray
        ``damping_ratio`` of shape ``(d,)``, ``period_s`` of shape ``(p,)``, and of shape ``(d, p)`` the largest displacement relative to
        the ground ``sd_m``, its velocity ``sv_m_per_s``, the absolute acceleration ``sa_m_per_s2``, and the pseudo values
        ``psv_m_per_s`` = ω·Sd and ``psa_m_per_s2`` = ω²·Sd.

    Raises
    ------
    InputError
        A record that cannot be used, or a value out of its range.
    """
    ratios = np.atleast_1d(np.asarray(damping, dtype=float))
    periods = np.geomspace(0.02, 10.0, 200) if periods_s is None else np.atleast_1d(np.asarray(periods_s, dtype=float))
    columns = _damprig.response_spectrum(
        os.fspath(record), ratios.tolist(), periods.tolist(), method, unit, sensitivity
    )
    places = {"damping_ratio": ratios, "period_s": periods}
    shape = (len(ratios), len(periods))
    return {name: places[name] if name in places else values.reshape(shape) for name, values in columns.items()}
