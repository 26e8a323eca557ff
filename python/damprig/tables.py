"""Tables of the host as NumPy arrays with units, and as frames of pandas, polars or xarray."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any

import numpy as np

from . import _damprig

__all__ = ["Table"]

_damprig.load_numpy()

FRAMES = ("pandas", "polars", "xarray")


class Table:
    """A table with named columns, each with its unit and meaning.

    Attributes
    ----------
    columns : mapping of str to numpy.ndarray
        Every column, shape ``(rows,)``; a column of names has the dtype ``object``. Each is made when it is used first.
    units : dict of str to str
        Unit of each column: ``"1"`` for ratios and counts, ``""`` for names and flags.
    descriptions : dict of str to str
        Meaning of each column, where the table has it.
    """

    def __init__(self, native: dict[str, Any]) -> None:
        self._native = native["columns"]
        self.units: dict[str, str] = native["units"]
        self.descriptions: dict[str, str] = native["descriptions"]
        self.columns: Mapping[str, np.ndarray] = _LazyColumns(list(self._native), partial(_plain_of, self._native))

    def __getitem__(self, name: str) -> np.ndarray:
        try:
            return self.columns[name]
        except KeyError:
            raise KeyError(f"there is no column {name!r}; the columns are {', '.join(self._native)}") from None

    def __len__(self) -> int:
        return len(next(iter(self.columns.values()))) if self._native else 0

    def __repr__(self) -> str:
        return f"<damprig.Table: {len(self)} rows of {', '.join(self._native)}>"

    def row(self, place: int) -> dict[str, Any]:
        """A row as a dict of plain values of Python."""
        return {name: values[place : place + 1].tolist()[0] for name, values in self.columns.items()}

    def frame(self, library: str = "pandas") -> Any:
        """The table as a frame of ``"pandas"`` or ``"polars"``, or a Dataset of ``"xarray"``.

        pandas has the units in ``frame.attrs["units"]``, xarray in ``dataset[name].attrs["units"]``; polars has no place for them,
        use :attr:`units`.
        """
        if library == "pandas":
            return self._pandas()
        if library == "polars":
            return self._polars()
        if library == "xarray":
            return self._xarray()
        from .errors import InputError

        raise InputError(f"library = {library!r} is not allowed: must be one of {', '.join(FRAMES)}")

    def _pandas(self) -> Any:
        import pandas as pd

        def column(values: Any) -> Any:
            return pd.Categorical.from_codes(values[0], values[1]) if isinstance(values, tuple) else values

        frame = pd.DataFrame({name: column(values) for name, values in self._native.items()})
        frame.attrs["units"] = dict(self.units)
        frame.attrs["descriptions"] = dict(self.descriptions)
        return frame

    def _polars(self) -> Any:
        import polars as pl

        frame = {}
        for name, values in self._native.items():
            frame[name] = pl.Series(self.columns[name].tolist(), dtype=pl.String) if isinstance(values, tuple) else values
        return pl.DataFrame(frame)

    def _xarray(self) -> Any:
        import xarray as xr

        dataset = xr.Dataset({name: ("row", values) for name, values in self.columns.items()})
        for name in self._native:
            dataset[name].attrs["units"] = self.units[name]
            if self.descriptions[name]:
                dataset[name].attrs["long_name"] = self.descriptions[name]
        return dataset


class StoredTable(Table):
    """A table in a file, whose columns are read when they are used first."""

    def __init__(self, stored: Any) -> None:
        head = stored.head()
        super().__init__({**head, "columns": _LazyColumns(list(head["columns"]), partial(_read, stored))})


class _LazyColumns(Mapping[str, Any]):
    """Columns by name; each is made when it is used first, and kept."""

    def __init__(self, names: list[str], make: Callable[[str], Any]) -> None:
        self._names, self._make, self._made = names, make, {}

    def __getitem__(self, name: str) -> Any:
        if name not in self._names:
            raise KeyError(name)
        if name not in self._made:
            self._made[name] = self._make(name)
        return self._made[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)


def _read(stored: Any, name: str) -> Any:
    return stored.column(name)["columns"][name]


def _plain_of(native: Mapping[str, Any], name: str) -> np.ndarray:
    return _plain(native[name])


def _plain(values: Any) -> np.ndarray:
    """The array of a column; names from their codes."""
    if not isinstance(values, tuple):
        return values
    codes, names = values
    # A code of -1 is no name.
    return np.array([*names, ""], dtype=object)[codes]
