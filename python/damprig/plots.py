"""Figures of results with matplotlib, with the colours, marks and units of the command's figures.

Each function draws into ``ax``, or into a new figure, and returns the axes: titles, limits and further curves are the caller's.
"""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _damprig
from .errors import InputError

if TYPE_CHECKING:
    from .runs import Run
    from .simulation import Simulation
    from .studies import Basins, Bifurcation, Branches, Optimisation, Study

__all__ = ["plot_basins", "plot_bifurcation", "plot_branches", "plot_motion", "plot_optimisation", "plot_run", "plot_study"]

_PALETTE = _damprig.palette()
_COLOURS: list[str] = _PALETTE["colours"]
_INK, _WALL, _MARKED = _PALETTE["ink"], _PALETTE["wall"], _PALETTE["marked"]

# Most curves of a figure.
_MAX_CURVES = 24

# Labels of the columns of a bifurcation diagram.
_SAMPLED = {
    "x_m": "x at drive phase 0 (mm)",
    "v_m_per_s": "x′ at drive phase 0 (m/s)",
    "y_minus_x_m": "y − x at drive phase 0 (mm)",
    "u_minus_v_m_per_s": "y′ − x′ at drive phase 0 (m/s)",
    "cycle_max_m": "cycle maximum of |x| (mm)",
}

# Marks of special points: the shapes of the command's figures.
_MARKS = {
    "fold": ("F", "^"),
    "period doubling": ("PD", "s"),
    "Neimark-Sacker": ("NS", "D"),
    "symmetry breaking": ("SB", "v"),
    "branch point": ("BP", "X"),
    "grazing": ("G", "o"),
}


def plot_motion(simulation: Simulation, ax: Any = None) -> Any:
    """Displacements over time: structure, second mass between its walls, base, impacts."""
    ax = _axes(ax)
    scale, unit = _length_scale(simulation.x, simulation.y, simulation.z)
    time = simulation.time
    walls = _walls(simulation)
    impacts = simulation.impacts
    # Impacts of a damper at another place have no y here.
    seen = np.isfinite(impacts.y)
    has_second = bool(np.any(simulation.y != simulation.x))
    for offset_m in walls:
        ax.plot(time, scale * (simulation.x + offset_m), color=_WALL, lw=0.8, label="walls" if offset_m == walls[0] else None)
    if np.any(simulation.z):
        ax.plot(time, scale * simulation.z, color=_COLOURS[6], lw=1, label="z base")
    if has_second:
        ax.plot(time, scale * simulation.y, color=_COLOURS[3], lw=1, label="y second mass")
    ax.plot(time, scale * simulation.x, color=_COLOURS[0], lw=1.4, label="x structure")
    if seen.any():
        ax.plot(impacts.time[seen], scale * impacts.y[seen], ".", color=_MARKED, ms=4, label="impacts")
    return _labelled(ax, "Time (s)", f"Displacement ({unit})", simulation.name)


def _walls(simulation: Simulation) -> list[float]:
    """y − x at the walls, m."""
    particle = simulation.parameters.get("set_up", {}).get("particle")
    if particle is None:
        return []
    offset_m = particle.get("cavity", {}).get("offset_m", 0.0)
    return [offset_m + particle["clearance_m"], offset_m - particle["clearance_m"]]


def plot_study(study: Study, metric: str | None = None, ax: Any = None) -> Any:
    """A metric over the axes: curves, or a map of two axes with numbers; the best point is ringed if it is that of the metric."""
    table = study.table
    metrics = [name for name in table.columns if name not in ("row", "unresolved", *study.axes)]
    metric = _one_of("metric", study.objective if metric is None else metric, metrics)
    varied = [key for key in study.axes if len(_distinct(table[key])) > 1]
    numbers = [key for key in varied if table[key].dtype != object]
    if not numbers:
        raise InputError("plot() needs an axis with two or more numbers, and the study has none: see `study.table`")
    scale, label = _shown(table, metric)
    values = scale * np.asarray(table[metric], dtype=float)
    ax = _axes(ax)
    best = study.best if metric == study.objective else None
    if len(varied) == 2 and len(numbers) == 2:
        across, up = (_distinct(table[key]) for key in numbers)
        x, y = (np.asarray(table[key], dtype=float) for key in numbers)
        if len(across) * len(up) == len(table):
            order = np.lexsort((x, y))
            drawn = ax.pcolormesh(across, up, values[order].reshape(len(up), len(across)), shading="nearest", cmap="viridis")
        else:
            drawn = ax.scatter(x, y, c=values, cmap="viridis", s=12)
        ax.figure.colorbar(drawn, ax=ax, label=label)
        if best is not None:
            ax.plot([best[numbers[0]]], [best[numbers[1]]], "o", mfc="none", mec=_MARKED, mew=2, ms=10, label="best")
        _labelled(ax, _key_label(table, numbers[0]), _key_label(table, numbers[1]), "")
        ax.set_xscale(study.axes[numbers[0]])
        ax.set_yscale(study.axes[numbers[1]])
        ax.grid(visible=False)
        return ax
    x_key, others = numbers[0], [key for key in varied if key != numbers[0]]
    combinations = list(product(*(_distinct(table[key]) for key in others)))
    if len(combinations) > _MAX_CURVES:
        raise InputError(f"the study has {len(combinations)} curves over {x_key}: a figure has {_MAX_CURVES} or fewer; see `study.table`")
    x = np.asarray(table[x_key], dtype=float)
    for place, combination in enumerate(combinations):
        own = np.ones(len(table), dtype=bool)
        for key, value in zip(others, combination):
            own &= table[key] == value
        order = np.flatnonzero(own)[np.argsort(x[own], kind="stable")]
        name = ", ".join(f"{key} = {value:.6g}" if not isinstance(value, str) else value for key, value in zip(others, combination))
        ax.plot(x[order], values[order], ".-" if len(order) < 60 else "-", color=_COLOURS[place % len(_COLOURS)], label=name or None)
    if best is not None:
        ax.plot([best[x_key]], values[np.asarray(table["row"]) == best["row"]], "o", mfc="none", mec=_MARKED, mew=2, ms=10, label="best")
    ax.set_xscale(study.axes[x_key])
    return _labelled(ax, _key_label(table, x_key), label, "")


def plot_basins(basins: Basins, ax: Any = None) -> Any:
    """The attractor of each start in its colour; white has none."""
    from matplotlib.colors import ListedColormap

    ax = _axes(ax)
    across, up = (np.unique(basins.starts[key]) for key in basins.keys)
    number = basins.starts["attractor"].astype(int)
    # Black is that of text. Attractors beyond the colours have them again.
    colours = _COLOURS[1:-1]
    passed = basins.starts["passed_wall"]
    place = np.where(number == 0, np.where(passed, -1, 0), 1 + (number - 1) % len(colours))
    drawn = ListedColormap([_WALL, "#ffffff", *colours])
    shown = place.reshape(len(up), len(across))
    ax.pcolormesh(across, up, shown, shading="nearest", cmap=drawn, vmin=-1.5, vmax=len(colours) + 0.5)
    rows = [basins.attractors.row(place) for place in range(min(len(basins.attractors), len(colours)))]
    for row in rows:
        words = f"{row['attractor']}: {_counted(row['impacts'], 'impact')} in {_counted(row['period_cycles'], 'cycle')}, max |x| {1e3 * row['max_abs_x_m']:.4g} mm"
        ax.plot([], [], "s", color=colours[row["attractor"] - 1], label=f"{words}, {100 * row['share']:.3g} %")
    for starts, face, words in ((place == 0, "white", "does not settle or repeat"), (place == -1, _WALL, "particle passes its wall")):
        if starts.any():
            ax.plot([], [], "s", mfc=face, mec=_INK, label=f"{words}, {100 * starts.mean():.3g} %")
    _labelled(ax, *(_key_label(basins.starts, key) for key in basins.keys), "")
    ax.grid(visible=False)
    return ax


def plot_bifurcation(table: Bifurcation, column: str = "cycle_max_m", ax: Any = None) -> Any:
    """A column of the sampled cycles over the swept key, up and down."""
    ax = _axes(ax)
    columns = [name for name in table.columns if name not in ("direction", table.key)]
    scale, _ = _shown(table, _one_of("column", column, columns))
    label = _SAMPLED[column]
    # The many dots of a diagram are small.
    size = 1.2 if len(table) > 5_000 else 4
    for direction, colour in (("up", _COLOURS[3]), ("down", _COLOURS[5])):
        own = table["direction"] == direction
        if own.any():
            ax.plot(table[table.key][own], scale * table[column][own], ".", ms=size, mew=0, color=colour)
            ax.plot([], [], "o", ms=4, color=colour, label=direction)
    return _labelled(ax, _key_label(table, table.key), label, "")


def plot_branches(branches: Branches, ax: Any = None) -> Any:
    """The largest ``|x|`` of periodic orbits over the parameter: stable ones solid, unstable ones dashed, special points marked."""
    ax = _axes(ax)
    used = set()
    for branch in branches["branches"]:
        colour = _COLOURS[(branch["number"] - 1) % len(_COLOURS)]
        orbits = branch["orbits"]
        at = np.array([[orbit["parameter"], 1e3 * orbit["max_abs_x_m"]] for orbit in orbits]).reshape(-1, 2)
        stable = np.array([orbit["is_stable"] for orbit in orbits], dtype=bool)
        ends = [0, *(np.flatnonzero(np.diff(stable)) + 1), len(orbits)]
        for start, end in zip(ends, ends[1:]):
            # A run reaches to the first orbit of the next one.
            ax.plot(*at[start : end + 1].T, "-" if stable[start] else "--", color=colour, lw=1.6)
        for special in branch["special_points"]:
            kind = special["kind"]
            short, mark = _MARKS[kind]
            face = "white" if kind == "grazing" else colour
            label = None if kind in used else f"{short}: {kind}"
            used.add(kind)
            ax.plot([special["parameter"]], [1e3 * special["max_abs_x_m"]], mark, mfc=face, mec=colour, ms=6, ls="none", label=label)
    for words, dash in (("stable", "-"), ("unstable", "--")):
        ax.plot([], [], dash, color=_INK, label=words)
    return _labelled(ax, branches["parameter"], "max |x| (mm)", branches["case"])


def plot_optimisation(optimisation: Optimisation, ax: Any = None, *, front: bool = False) -> Any:
    """The objective's metric over the band, of the optimum, its alternatives and the bare structure; or the front of two objectives."""
    scale, unit = _scale_of(optimisation["unit"])
    objective = _with_unit(optimisation["metric"], unit)
    if front:
        found = optimisation["front"]
        if found is None:
            raise InputError("front = True: the optimisation has no `[front]`")
        ax = _axes(ax)
        second_scale, second_unit = _scale_of(found["unit"])
        at = np.array([[second_scale * point["second"], scale * point["objective"]] for point in found["points"]]).reshape(-1, 2)
        ax.plot(*at.T, "o", color=_COLOURS[0], ms=4)
        knee = [place for place, point in enumerate(found["points"]) if point["is_knee"]]
        if knee:
            ax.plot(*at[knee].T, "o", mfc="none", mec=_MARKED, mew=2, ms=10, label="knee")
        return _labelled(ax, _with_unit(found["metric"], second_unit), objective, optimisation["name"])
    if not optimisation["over_band"]:
        raise InputError("the optimisation has no curve: its file has no `[[axis]]`")
    ax = _axes(ax)
    answers = [optimisation, *optimisation["alternatives"]]
    for place, answer in enumerate(of for of in answers if of["over_band"]):
        colour = _COLOURS[place % len(_COLOURS)]
        at, value, low, high = (np.array([point[name] for point in answer["over_band"]]) for name in ("at", "value", "low", "high"))
        if (low < high).any():
            ax.fill_between(at, scale * low, scale * high, color=colour, alpha=0.2, lw=0)
        ax.plot(at, scale * value, color=colour, lw=1.6, label=answer["name"])
    bare = [(point["at"], scale * point["bare"]) for point in optimisation["over_band"] if point["bare"] is not None]
    if bare:
        ax.plot(*np.array(bare).T, "--", color=_WALL, label="bare structure")
        # The curve of the optimum decides what is seen; the bare structure's peak is many times higher.
        highest = max(scale * point["high"] for of in answers for point in of["over_band"])
        ax.set_ylim(0, 1.3 * highest)
    band = optimisation["band"][0]
    return _labelled(ax, _with_unit(band["key"], band["unit"]), objective, optimisation["name"])


def plot_run(run: Run, quantity: str = "x_over_z", ax: Any = None) -> Any:
    """A quantity of the results over frequency, for each set-up and experiment; points that are not steady are hollow."""
    table = run.results
    if not len(table):
        raise InputError(f"{run.path}: the run has no point over frequency; see `run.transients`")
    names = [name for name in table.columns if table[name].dtype.kind == "f" and name != "frequency_hz"]
    scale, label = _shown(table, _one_of("quantity", quantity, names))
    ax = _axes(ax)
    set_ups = list(dict.fromkeys(table["set_up"]))
    curves = list(dict.fromkeys(zip(table["set_up"], table["experiment"])))
    for set_up, experiment in curves:
        own = np.flatnonzero((table["set_up"] == set_up) & (table["experiment"] == experiment))
        own = own[np.argsort(table["frequency_hz"][own], kind="stable")]
        same = [curve for curve in curves if curve[0] == set_up]
        colour = _COLOURS[set_ups.index(set_up) % len(_COLOURS)]
        dash = ("-", "--", "-.", ":")[same.index((set_up, experiment)) % 4]
        x, y = table["frequency_hz"][own], scale * table[quantity][own]
        ax.plot(x, y, dash, color=colour, lw=1.2, label=set_up if len(same) == 1 else f"{set_up}, {experiment}")
        settled = np.isin(table["steadiness"][own], ("steady", "stationary"))
        for mask, face in ((settled, colour), (~settled, "white")):
            ax.plot(x[mask], y[mask], "o", ms=4, mec=colour, mfc=face)
    return _labelled(ax, "Frequency (Hz)", label, run.campaign)


def _axes(ax: Any) -> Any:
    if ax is not None:
        return ax
    try:
        from matplotlib import pyplot
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError("plot() draws with matplotlib, which is not installed: pip install matplotlib", name=error.name) from None
    return pyplot.subplots(layout="constrained")[1]


def _labelled(ax: Any, x: str, y: str, title: str) -> Any:
    ax.set_xlabel(x)
    ax.set_ylabel(y)
    if title:
        ax.set_title(title, loc="left", fontsize="medium")
    ax.grid(visible=True, color="#dddddd", lw=0.6)
    ax.set_axisbelow(True)
    if ax.get_legend_handles_labels()[0]:
        ax.legend(fontsize="small")
    return ax


def _distinct(values: np.ndarray) -> list[Any]:
    """The values of an axis, rising, or words in their order."""
    return list(dict.fromkeys(values)) if values.dtype == object else np.unique(values).tolist()


def _shown(table: Any, column: str) -> tuple[float, str]:
    """Factor and label of a column in the unit that people read."""
    scale, unit = _scale_of(table.units[column])
    words = table.descriptions[column].split(":")[0].split(";")[0]
    if not 0 < len(words) <= 40:
        words = column
    return scale, _with_unit(words, unit)


def _scale_of(unit: str) -> tuple[float, str]:
    if unit == "m":
        return 1e3, "mm"
    if unit == "rad":
        return 180 / np.pi, "°"
    return 1.0, "" if unit == "1" else unit


def _length_scale(*lengths_m: np.ndarray) -> tuple[float, str]:
    name, scale = _damprig.length_unit(max((float(np.abs(of).max()) for of in lengths_m if len(of)), default=0.0))
    return scale, name


def _key_label(table: Any, key: str) -> str:
    unit = table.units[key]
    return _with_unit(key, "" if unit == "1" else unit)


def _with_unit(words: str, unit: str) -> str:
    return f"{words} ({unit})" if unit else words


def _counted(count: int, word: str) -> str:
    return f"{count} {word}" if count == 1 else f"{count} {word}s"


def _one_of(name: str, given: str, allowed: list[str]) -> str:
    if given not in allowed:
        raise InputError(f"{name} = {given!r} is not allowed: must be one of {', '.join(allowed)}")
    return given
