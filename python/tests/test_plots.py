"""Figures with matplotlib: what they show are the numbers of the results, in the colours of the command."""

import sys

import matplotlib
import numpy as np
import pytest
from matplotlib import pyplot
from matplotlib.colors import to_hex

import damprig

matplotlib.use("Agg")


@pytest.fixture(autouse=True)
def closed():
    yield
    pyplot.close("all")


def lines(ax):
    """The curves with a name, by name."""
    return {line.get_label(): line for line in ax.lines if not line.get_label().startswith("_")}


def study(spid, *axes, metrics=("x_over_z",)):
    return damprig.study({"case": spid, "metrics": list(metrics), "axis": list(axes)})


CLEARANCE = {"key": "particle.clearance_ratio", "from": 8, "to": 14, "count": 4}
RESTITUTION = {"key": "particle.wall.coefficient", "from": 0.3, "to": 0.6, "count": 3}


def test_a_motion_shows_structure_particle_walls_base_and_impacts(spid):
    spid["particle"]["offset_m"] = 0.004
    result = damprig.simulate(spid)
    ax = result.plot()
    drawn = lines(ax)
    assert set(drawn) == {"x structure", "y second mass", "z base", "walls", "impacts"}
    assert np.array_equal(drawn["x structure"].get_ydata(), 1e3 * result.x)
    assert np.allclose(drawn["walls"].get_ydata(), 1e3 * (result.x + 0.004 + 0.03), rtol=1e-14)
    assert np.array_equal(drawn["impacts"].get_xdata(), result.impacts.time)
    # Impacts lie on the walls.
    walls = np.array([result.impacts.y - side * 0.03 - 0.004 for side in (1, -1)])
    near = np.interp(result.impacts.time, result.time, result.x)
    assert np.abs(walls - near).min(axis=0).max() < 1e-3
    assert ax.get_ylabel() == "Displacement (mm)" and ax.get_title(loc="left") == result.name
    assert to_hex(drawn["y second mass"].get_color()) == "#0072b2"


@pytest.mark.parametrize("name", ["boring-bar", "frame", "hybrid", "many-particles", "soft-wall", "tmd"])
def test_every_kind_of_case_has_a_figure(project, name):
    drawn = lines(damprig.simulate(project / f"host/cases/{name}.toml").plot())
    assert "x structure" in drawn and all(len(line.get_xdata()) for line in drawn.values())


def test_a_study_over_one_axis_is_a_curve_with_its_best_point(spid):
    computed = study(spid, CLEARANCE, metrics=["x_over_z", "max_abs_x_m"])
    figure, ax = pyplot.subplots()
    assert computed.plot(ax=ax) is ax
    assert np.array_equal(ax.lines[0].get_xydata().T, [computed.table[name] for name in ("particle.clearance_ratio", "x_over_z")])
    assert lines(ax)["best"].get_xydata().tolist() == [[computed.best["particle.clearance_ratio"], computed.best["objective"]]]
    other = computed.plot("max_abs_x_m")
    assert np.array_equal(other.lines[0].get_ydata(), 1e3 * computed.table["max_abs_x_m"])
    assert other.get_ylabel() == "largest |x| (mm)" and "best" not in lines(other)


def test_the_best_point_is_that_of_the_objective_and_an_axis_keeps_its_scale(spid):
    file = {"case": spid, "metrics": ["x_over_z", "impacts_per_cycle"], "objective": "impacts_per_cycle", "axis": [{**CLEARANCE, "scale": "log"}]}
    computed = damprig.study(file)
    ax = computed.plot()
    row = computed.table.row(computed.best["row"])
    assert lines(ax)["best"].get_xydata().tolist() == [[row["particle.clearance_ratio"], row["impacts_per_cycle"]]]
    assert ax.get_xscale() == "log" and "best" not in lines(computed.plot("x_over_z"))


def test_a_study_over_two_axes_is_a_map_of_its_table(spid):
    computed = study(spid, CLEARANCE, RESTITUTION)
    ax = computed.plot()
    (drawn,) = ax.collections
    shown = drawn.get_array().reshape(3, 4)
    for x, y, value in zip(*(computed.table[name] for name in (*computed.axes, "x_over_z"))):
        column, row = np.flatnonzero(np.linspace(8, 14, 4) == x)[0], round((y - 0.3) / 0.15)
        assert shown[row, column] == value
    assert computed.axes == {"particle.clearance_ratio": "linear", "particle.wall.coefficient": "linear"}


def test_a_study_over_three_axes_has_a_curve_for_each_combination_of_the_others(spid):
    computed = study(spid, CLEARANCE, {"key": "particle.mass_ratio", "values": [0.05, 0.1]}, {"key": "particle.start", "words": ["centre", "at_negative_wall"]})
    names = [line.get_label() for line in computed.plot().lines]
    assert names[:4] == [f"particle.mass_ratio = {ratio}, {word}" for ratio in (0.05, 0.1) for word in ("centre", "at_negative_wall")]
    many = study(spid, CLEARANCE, {**RESTITUTION, "count": 5}, {"key": "particle.mass_ratio", "from": 0.05, "to": 0.1, "count": 5})
    with pytest.raises(damprig.InputError, match="25 curves"):
        many.plot()


def test_a_bifurcation_diagram_has_a_dot_for_each_cycle(spid):
    diagram = damprig.bifurcation(spid, "particle.clearance_ratio", [10, 11, 12], settle_cycles=20, cycles=5)
    ax = diagram.plot()
    dots = [line for line in ax.lines if len(line.get_xdata())]
    assert [len(line.get_xdata()) for line in dots] == [15, 15]
    assert np.array_equal(dots[0].get_ydata(), 1e3 * diagram["cycle_max_m"][diagram["direction"] == "up"])
    assert diagram.plot("x_m").get_ylabel() == "x at drive phase 0 (mm)"
    with pytest.raises(damprig.InputError, match="must be one of x_m, "):
        diagram.plot("y_m")


def test_basins_show_the_attractor_of_each_start(spid):
    spid["base"]["frequency_hz"] = 2.2
    starts = {"initial.x_m": np.linspace(-0.05, 0.05, 9), "initial.v_m_per_s": np.linspace(-0.8, 0.8, 7)}
    found = damprig.basins(spid, starts)
    assert len(found.starts) == 63 and found.attractors["starts"].sum() == (found.starts["attractor"] > 0).sum()
    ax = found.plot()
    (drawn,) = ax.collections
    assert np.array_equal(np.ravel(drawn.get_array()), found.starts["attractor"])
    assert ax.get_xlabel() == "initial.x_m (m)" and len(lines(ax)) >= len(found.attractors)
    with pytest.raises(damprig.InputError, match="two keys"):
        damprig.basins(spid, {"initial.x_m": [0, 1]})
    with pytest.raises(damprig.InputError, match="initial.x_m: value 1 is 0.0: must be finite numbers in rising order"):
        damprig.basins(spid, {**starts, "initial.x_m": [1, 0]})
    with pytest.raises(damprig.InputError, match="two keys of `initial`"):
        damprig.basins(spid, {"initial.x_m": [0, 1], 3: [2, 3]})
    with pytest.raises(damprig.InputError, match="is no start"):
        damprig.basins(spid, {"initial.x_m": [0, 1], "base.frequency_hz": [2, 3]})


def test_branches_are_solid_where_stable_and_name_their_special_points(spid):
    found = damprig.continuation({"case": spid, "parameter": "particle.clearance_ratio", "from": 9, "to": 15})
    ax = found.plot()
    special = {point["kind"] for branch in found["branches"] for point in branch["special_points"]}
    assert "Neimark-Sacker" in special and {name.split(": ")[1] for name in lines(ax) if ": " in name} == special
    for dash, is_stable in (("-", True), ("--", False)):
        drawn = {x for line in ax.lines if line.get_linestyle() == dash for x in line.get_xdata()[:-1]}
        wanted = {orbit["parameter"] for branch in found["branches"] for orbit in branch["orbits"][:-1] if orbit["is_stable"] == is_stable}
        assert drawn == wanted
    assert found["case"] == ax.get_title(loc="left")


def test_an_optimisation_shows_its_band_and_its_front(spid):
    file = {
        "case": spid,
        "name": "clearance",
        "objective": "max_x_over_z",
        "variable": [{"key": "particle.clearance_ratio", "values": [9, 10, 11, 12]}],
        "axis": [{"key": "base.frequency_hz", "from": 2.4, "to": 2.6, "count": 3, "reduce": "maximum"}],
        "record": {"settle_cycles": 50, "cycles": 20},
    }
    answer = damprig.optimise(file)
    drawn = lines(answer.plot())
    assert np.array_equal(drawn["clearance"].get_ydata(), [point["value"] for point in answer["over_band"]])
    with pytest.raises(damprig.InputError, match=r"no `\[front\]`"):
        answer.plot(front=True)
    answer = damprig.optimise({**file, "front": {"metric": "impacts_per_cycle", "count": 5}})
    points = answer["front"]["points"]
    assert answer.plot(front=True).lines[0].get_xydata().tolist() == [[point["second"], point["objective"]] for point in points]


def test_a_run_has_a_curve_for_each_set_up_and_hollow_points_where_not_steady(short_run):
    run = short_run
    ax = run.plot()
    assert set(lines(ax)) == set(run.results["set_up"])
    of_bare = lines(ax)["bare"]
    own = run.results["set_up"] == "bare"
    assert np.array_equal(of_bare.get_ydata(), run.results["x_over_z"][own])
    hollow = [line for line in ax.lines if line.get_marker() == "o" and line.get_markerfacecolor() == "white"]
    unsettled = ~np.isin(run.results["steadiness"], ("steady", "stationary"))
    assert sum(len(line.get_xdata()) for line in hollow) == unsettled.sum()
    assert run.plot("phase_rad").get_ylabel() == "phase of x relative to z (°)"
    with pytest.raises(damprig.InputError, match="quantity = 'x' is not allowed"):
        run.plot("x")


def test_without_matplotlib_the_error_says_what_to_install(spid, monkeypatch):
    result = damprig.simulate(spid)
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    monkeypatch.delitem(sys.modules, "matplotlib.pyplot", raising=False)
    with pytest.raises(ModuleNotFoundError, match="pip install matplotlib"):
        result.plot()
