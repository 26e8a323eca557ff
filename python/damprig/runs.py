"""Reads run folders through the host's own reader, which checks them and names what is damaged."""

from __future__ import annotations

import json
import os
import tempfile
import warnings
from functools import cached_property
from pathlib import Path
from typing import Any

from . import _damprig
from .errors import RunFolderWarning
from .plots import plot_run
from .signals import read_signals
from .tables import Table

__all__ = ["Run", "open_run"]


class Run:
    """A run folder, opened for reading. Tables are read when they are used first.

    Attributes
    ----------
    path : pathlib.Path
        Where it is.
    manifest : dict
        Everything that is not a table (docs/RUN_FOLDER.md).
    problems : list of str
        What verification found damaged or incomplete; empty if the folder is intact.
    findings : list of str
        What verification found in order.
    """

    def __init__(self, folder: str | os.PathLike[str], verify: bool = True) -> None:
        self._reader = _damprig.RunReader(os.fspath(folder))
        self.path = Path(self._reader.path)
        self.manifest: dict[str, Any] = json.loads(self._reader.manifest())
        found = self._reader.verify() if verify else []
        self.findings = [text for good, text in found if good]
        self.problems = [text for good, text in found if not good]

    def __repr__(self) -> str:
        return f"<damprig.Run {self.path}: {self.status}, {self.manifest['points_taken']} of {self.manifest['points_planned']} points>"

    @property
    def campaign(self) -> str:
        """Name of the campaign."""
        return self.manifest["campaign"]

    @property
    def campaign_text(self) -> str:
        """The campaign as it was run (TOML)."""
        return (self.path / "campaign.toml").read_text(encoding="utf-8")

    @property
    def status(self) -> str:
        """How the run ended, in words: ``"complete"``, or why not."""
        return self._reader.ending()

    @cached_property
    def parameters(self) -> dict[str, dict[str, Any]]:
        """The set-ups by name, each with its parameters in SI units; each key ends with its unit."""
        return {set_up["name"]: set_up for set_up in self.manifest["set_ups"]}

    @cached_property
    def results(self) -> Table:
        """A row per measured point (set-up, experiment, frequency): a :class:`damprig.Table`."""
        return Table(self._reader.results())

    @cached_property
    def transients(self) -> Table:
        """A row per record, pulse and free vibration: a :class:`damprig.Table`, empty if there are none."""
        return Table(self._reader.transients())

    @cached_property
    def impacts(self) -> Table:
        """A row per measured impact: a :class:`damprig.Table`, empty if there are none."""
        return Table(self._reader.impacts())

    @cached_property
    def samples(self) -> Table:
        """The telemetry, a row per sample: a :class:`damprig.Table`. Files that cannot be read give a RunFolderWarning."""
        table, damaged = self._reader.samples()
        for problem in damaged:
            warnings.warn(problem, RunFolderWarning, stacklevel=2)
        return Table(table)

    def plot(self, quantity: str = "x_over_z", ax: Any = None) -> Any:
        """Draw a column of the results over frequency with matplotlib, a curve for each set-up and experiment; returns the axes.

        Points that are neither steady nor stationary are hollow.
        """
        return plot_run(self, quantity, ax)

    def signals(self) -> list[dict[str, Any]]:
        """Time histories and frequency responses of the run, as :func:`damprig.read_signals` gives them (SEP005).

        They are those of ``damprig runs export --format uff``: a history for each signal, set-up, experiment and frequency, and X/Z for
        each sweep.
        """
        with tempfile.TemporaryDirectory() as folder:
            file = os.path.join(folder, "run.uff")
            self._reader.write_uff(file)
            return read_signals(file)


def open_run(folder: str | os.PathLike[str], *, verify: bool = True) -> Run:
    """Open a run folder.

    Parameters
    ----------
    folder : path
        The folder of a run, or the name of one below ``./runs`` (the end of its name is enough).
    verify : bool
        Compare every file with its checksum, as ``damprig runs verify`` does. What is wrong is in ``run.problems``, and is warned of
        (RunFolderWarning). It reads the whole folder once.

    Returns
    -------
    Run

    Raises
    ------
    RunFolderError
        There is no such run, or its manifest cannot be read.
    """
    run = Run(folder, verify)
    for problem in run.problems:
        warnings.warn(f"{run.path}: {problem}", RunFolderWarning, stacklevel=2)
    return run
