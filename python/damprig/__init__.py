"""damprig in Python: simulate a damper, read a run, drive the virtual rig.

>>> import damprig
>>> result = damprig.simulate("host/cases/spid.toml")        # doctest: +SKIP
>>> run = damprig.open_run("runs/20261121-041624-hybrid")    # doctest: +SKIP
>>> rig = damprig.VirtualRig(sensors="data_sheet", seed=1)   # doctest: +SKIP

All numbers are in SI units. NumPy is imported with the first call, pandas, polars and xarray when a frame is asked for.
"""

from importlib import import_module

from . import errors
from ._damprig import __version__
from .errors import *  # noqa: F403

# Where each name is; imported when it is used first.
_PLACES = {
    "Basins": "studies",
    "Bifurcation": "studies",
    "Branches": "studies",
    "Optimisation": "studies",
    "Run": "runs",
    "Signals": "rig",
    "Simulation": "simulation",
    "Study": "studies",
    "Table": "tables",
    "VirtualRig": "rig",
    "analyse": "simulation",
    "basins": "studies",
    "bifurcation": "studies",
    "continuation": "studies",
    "evaluate": "studies",
    "open_run": "runs",
    "read_signals": "signals",
    "response_spectrum": "signals",
    "optimise": "studies",
    "simulate": "simulation",
    "study": "studies",
}

__all__ = sorted([*_PLACES, *errors.__all__, "__version__"])


def __getattr__(name):
    if name in _PLACES:
        return getattr(import_module(f".{_PLACES[name]}", __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__():
    return __all__
