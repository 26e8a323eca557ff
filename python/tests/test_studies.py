"""Studies, optimisations and continuations from Python equal those of the command."""

import json
import os
import pickle
import shutil
import signal
import tomllib
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pyarrow.parquet as parquet
import pytest

import damprig
from damprig import studies

STUDY = """
case = "case.toml"
metrics = ["x_over_z", "cycle_spread"]
points_per_part = 5
record = { cycles = 20 }
[[axis]]
key = "particle.clearance_ratio"
from = 8
to = 14
count = 7
[[axis]]
key = "particle.start"
words = ["centre", "at_positive_wall"]
"""

CASE = """
structure = { mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0.0038 }
base = { kind = "sine", amplitude_m = 0.003, frequency_hz = 2.5 }
particle = { mass_ratio = 0.1, clearance_ratio = 10, wall = { kind = "restitution", coefficient = 0.5 } }
run = { duration_s = 20 }
"""


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "case.toml").write_text(CASE, encoding="utf-8")
    (tmp_path / "study.toml").write_text(STUDY, encoding="utf-8")
    return tmp_path


def same(one, other):
    return all(np.array_equal(one[name], other[name]) for name in one.columns)


def test_sensitivity_indices_of_a_study_are_those_of_the_command(folder, command):
    text = """
case = "case.toml"
metrics = ["rms_x_m"]
record = { cycles = 5 }
sampling = { method = "morris", count = 4 }
[[axis]]
key = "particle.clearance_ratio"
from = 8
to = 14
[[axis]]
key = "particle.wall.coefficient"
distribution = "normal"
mean = 0.5
standard_deviation = 0.05
"""
    (folder / "study.toml").write_text(text, encoding="utf-8")
    found = damprig.study(folder / "study.toml", folder / "python")
    printed = json.loads(command("study", "run", folder / "study.toml", "--out", folder / "command", "--json"))
    assert found.sensitivity == printed["sensitivity"]
    assert [index["key"] for index in found.sensitivity[0]["indices"]][::3] == ["particle.clearance_ratio", "particle.wall.coefficient"]


def test_a_study_has_the_table_of_the_command_with_units(folder, command):
    found = damprig.study(folder / "study.toml", folder / "python")
    command("study", "run", folder / "study.toml", "--out", folder / "command")
    table = parquet.read_table(folder / "command" / "table.parquet")
    assert len(found.table) == 14
    for name in ["row", "particle.clearance_ratio", "x_over_z", "cycle_spread"]:
        assert np.array_equal(found.table[name], table[name].to_numpy())
    assert list(found.table["particle.start"]) == table["particle.start"].to_pylist()
    assert found.table.units["x_over_z"] == "1"
    best = found.best
    assert best["objective"] == np.min(found.table["x_over_z"])
    assert found.table["particle.clearance_ratio"][best["row"]] == best["particle.clearance_ratio"]
    assert found.path.endswith("table.parquet")


def test_executors_make_the_same_table(folder):
    alone = damprig.study(folder / "study.toml", folder / "alone").table
    with ThreadPoolExecutor(2) as threads:
        assert same(damprig.study(folder / "study.toml", folder / "threads", executor=threads).table, alone)
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as processes:
        found = damprig.study(folder / "study.toml", folder / "processes", executor=processes)
        assert same(found.table, alone)


def test_progress_is_told_up_to_all_points_with_and_without_an_executor(folder, capfd):
    told = []
    damprig.study(folder / "study.toml", folder / "alone", progress=lambda done, points: told.append((done, points)))
    points = told[-1][1]
    assert told == sorted(told) and told[-1] == (points, points)
    told.clear()
    with ThreadPoolExecutor(2) as threads:
        damprig.study(folder / "study.toml", folder / "threads", executor=threads, progress=lambda *now: told.append(now))
    assert told == sorted(set(told)) and told[-1] == (points, points)
    damprig.study(folder / "study.toml", folder / "printed", progress=True)
    shown = capfd.readouterr().err
    assert f"\r{points} of {points} points" in shown and shown.endswith("\n")


def test_what_progress_raises_ends_the_study_and_keeps_its_parts(folder):
    class Enough(Exception):
        pass

    def tell(done, points):
        if done:
            raise Enough

    with pytest.raises(Enough):
        damprig.study(folder / "study.toml", folder / "alone", progress=tell)
    with ThreadPoolExecutor(1) as threads, pytest.raises(Enough):
        damprig.study(folder / "study.toml", folder / "out", executor=threads, progress=tell)
    assert list((folder / "out" / "parts").iterdir())
    with pytest.raises(damprig.InputError, match="progress: must be True, False or a function"):
        damprig.study(folder / "study.toml", folder / "out", progress="yes")


def test_a_finished_study_is_opened_column_by_column_and_not_joined_again(folder):
    first = damprig.study(folder / "study.toml", folder / "out")
    written = os.stat(first.path).st_mtime_ns
    shutil.rmtree(folder / "out" / "parts")
    again = damprig.study(folder / "study.toml", folder / "out")
    assert os.stat(again.path).st_mtime_ns == written
    assert again.best == first.best and same(again.table, first.table)
    assert same(pickle.loads(pickle.dumps(again)).table, first.table)
    damaged = bytearray(Path(first.path).read_bytes())
    damaged[len(damaged) // 2] ^= 1
    Path(first.path).write_bytes(damaged)
    third = damprig.study(folder / "study.toml", folder / "out")
    assert same(third.table, first.table) and bytes(damaged) != Path(first.path).read_bytes()
    third = damprig.study(folder / "study.toml", folder / "out")
    third.table["x_over_z"]
    Path(third.path).unlink()
    assert np.array_equal(third.table["x_over_z"], first.table["x_over_z"]) and len(third.table.columns) == len(first.table.columns)
    with pytest.raises(damprig.RunFolderError, match=r"table\.parquet: cannot read it"):
        third.table["row"]


def test_workers_of_one_machine_share_its_cores(folder):
    class Client:
        def nthreads(self):
            return {"tcp://10.0.0.1:4000": 2, "tcp://10.0.0.1:4001": 2, "tcp://10.0.0.2:4000": 1}

    assert studies._at_once(Client()) == 4
    with ProcessPoolExecutor(3) as processes:
        assert studies._at_once(processes) == 3
    assert studies._at_once(object()) == 1


def test_a_dask_cluster_makes_the_same_table(folder):
    distributed = pytest.importorskip("distributed")
    alone = damprig.study(folder / "study.toml", folder / "alone").table
    cluster = distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, worker_dashboard_address=None
    )
    with cluster, distributed.Client(cluster) as client:
        assert same(damprig.study(folder / "study.toml", folder / "dask", executor=client).table, alone)


class Killed:
    """A Dask client that kills the process of a worker with a part at hand."""

    def __init__(self, client):
        self.client = client
        self.processes = client.run(os.getpid)
        self.victim = None

    def submit(self, function, *arguments):
        future = self.client.submit(function, *arguments, pure=False)
        while self.victim is None:
            busy = [address for address, parts in self.client.processing().items() if parts]
            if busy:
                self.victim = self.processes[busy[0]]
                os.kill(self.victim, signal.SIGKILL)
        return future


def test_a_part_of_a_killed_dask_worker_is_computed_by_another(folder):
    distributed = pytest.importorskip("distributed")
    (folder / "study.toml").write_text(STUDY.replace("cycles = 20", "cycles = 5000"), encoding="utf-8")
    alone = damprig.study(folder / "study.toml", folder / "alone").table
    cluster = distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, worker_dashboard_address=None
    )
    with cluster, distributed.Client(cluster) as client:
        killed = Killed(client)
        assert same(damprig.study(folder / "study.toml", folder / "dask", executor=killed).table, alone)
        assert killed.victim not in client.run(os.getpid).values()


class Aborted(ProcessPoolExecutor):
    """A pool of one process that dies after two parts."""

    calls = 0

    def submit(self, function, *arguments):
        self.calls += 1
        return super().submit(function, *arguments) if self.calls <= 2 else super().submit(os.abort)


def test_parts_from_before_a_worker_died_are_kept(folder):
    alone = damprig.study(folder / "study.toml", folder / "alone").table
    with Aborted(1, mp_context=get_context("spawn")) as pool, pytest.raises(BrokenProcessPool):
        damprig.study(folder / "study.toml", folder / "out", executor=pool)
    parts = folder / "out" / "parts"
    kept = {path.name: path.stat().st_mtime_ns for path in parts.iterdir()}
    assert sorted(kept) == ["00000000.parquet", "00000001.parquet"]
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        assert same(damprig.study(folder / "study.toml", folder / "out", executor=pool).table, alone)
    assert all((parts / name).stat().st_mtime_ns == written for name, written in kept.items())


def test_rows_of_a_worker_with_another_case_are_refused(folder):
    class Elsewhere(ThreadPoolExecutor):
        def submit(self, function, *arguments):
            (folder / "case.toml").write_text(CASE.replace("0.0038", "0.0039"), encoding="utf-8")
            rows = function(*arguments)
            (folder / "case.toml").write_text(CASE, encoding="utf-8")
            return super().submit(lambda: rows)

    with Elsewhere(1) as threads, pytest.raises(damprig.InputError, match="another study, case, version or build"):
        damprig.study(folder / "study.toml", folder / "out", executor=threads)
    assert not (folder / "out" / "parts").exists()


def test_an_optimisation_and_a_continuation_are_those_of_the_command(folder, command):
    (folder / "optimise.toml").write_text(
        'case = "case.toml"\nobjective = "x_over_z"\nevaluations = 100\nrecord = { cycles = 10 }\n'
        '[[variable]]\nkey = "particle.clearance_ratio"\nfrom = 8\nto = 14\n',
        encoding="utf-8",
    )
    assert damprig.optimise(folder / "optimise.toml") == json.loads(command("optimise", folder / "optimise.toml", "--json"))
    (folder / "continue.toml").write_text(
        'case = "case.toml"\nparameter = "particle.clearance_ratio"\nfrom = 9\nto = 12\nrestarts = 0\n', encoding="utf-8"
    )
    found = damprig.continuation(folder / "continue.toml")
    assert found == json.loads(command("continue", folder / "continue.toml", "--json"))


def test_dicts_are_computed_as_their_files(folder, monkeypatch):
    monkeypatch.chdir(folder)
    study, case = tomllib.loads(STUDY), tomllib.loads(CASE)
    expected = damprig.study("study.toml", "out")
    for given in [study, {**study, "case": case}, {**study, "case": folder / "case.toml"}]:
        found = damprig.study(given)
        assert same(found.table, expected.table) and found.best == expected.best and found.path is None
    assert damprig.study(study, "kept").path.endswith("table.parquet")
    with ThreadPoolExecutor(2) as threads:
        assert same(damprig.study(study, "shared", executor=threads).table, expected.table)
        assert same(damprig.study(study, executor=threads).table, expected.table)
    variable = {"key": "particle.clearance_ratio", "from": np.float64(8), "to": 14}
    optimise = {"case": case, "objective": "x_over_z", "evaluations": 100, "record": {"cycles": 10}, "variable": [variable]}
    assert damprig.optimise({**optimise, "case": "case.toml"})["objective"] == damprig.optimise(optimise)["objective"]
    follow = {"case": case, "parameter": "particle.clearance_ratio", "from": 9, "to": 12, "restarts": 0}
    assert damprig.continuation({**follow, "case": "case.toml"})["branches"] == damprig.continuation(follow)["branches"]


KEYS = ["particle.clearance_ratio", "particle.wall.coefficient"]


def test_points_are_evaluated_as_a_study_of_them_and_as_single_simulations(folder):
    points = np.random.default_rng(3).uniform([8, 0.3], [14, 0.8], (40, 2))
    metrics = ["max_abs_x_m", "impacts_per_cycle"]
    found = damprig.evaluate(folder / "case.toml", KEYS, points, metrics, record={"cycles": 20})
    rows = ["particle.clearance_ratio,particle.wall.coefficient", *(f"{d!r},{e!r}" for d, e in points.tolist())]
    (folder / "design.csv").write_text("\n".join(rows), encoding="utf-8")
    study = f'case = "case.toml"\nmetrics = {json.dumps(metrics)}\npoints = "design.csv"\nrecord = {{ cycles = 20 }}\n'
    (folder / "points.toml").write_text(study, encoding="utf-8")
    table = damprig.study(folder / "points.toml", folder / "points").table
    assert found.shape == (40, 2)
    assert np.array_equal(found, np.column_stack([table[name] for name in metrics]))
    assert np.array_equal(np.column_stack([table[key] for key in KEYS]), points)
    case = tomllib.loads(CASE)
    case["particle"]["clearance_ratio"], case["particle"]["wall"]["coefficient"] = points[7].tolist()
    single = damprig.simulate({**case, "run": {"duration_s": 8}}).summary["max_abs_x_m"]
    assert abs(found[7, 0] / single - 1) < 1e-9


def test_a_single_metric_over_a_band_has_one_value_for_each_point(folder):
    band = {"key": "base.frequency_ratio", "from": 0.95, "to": 1.05, "count": 5, "reduce": "maximum"}
    points = [[9.0], [12.0], [9.0]]
    found = damprig.evaluate(tomllib.loads(CASE), KEYS[:1], points, "x_over_z", axis=[band], record={"cycles": 20})
    assert found.shape == (3,) and found[0] == found[2] != found[1]
    alone = damprig.evaluate(tomllib.loads(CASE), KEYS[:1], points, "x_over_z", record={"cycles": 20})
    assert np.all(found >= alone)


def test_functions_of_the_motion_are_metrics_beside_those_by_name():
    case = tomllib.loads(CASE)
    points = [[9.0, 0.4], [12.0, 0.6], [13.0, 0.5]]

    def late_impacts(motion):
        return np.sum(motion.impacts.time > motion.time[-1] / 2)

    found = damprig.evaluate(case, KEYS, points, [late_impacts, "max_abs_x_m", lambda motion: np.max(np.abs(motion.x))])
    for row, point in zip(found, points, strict=True):
        motion = damprig.simulate(case, set=dict(zip(KEYS, point, strict=True)))
        assert row[0] == late_impacts(motion) and row[2] == np.max(np.abs(motion.x))
        # The rows of the motion are 200 a period.
        assert abs(row[1] / row[2] - 1) < 1e-3
    assert np.array_equal(damprig.evaluate(case, KEYS, points, late_impacts), found[:, 0])


def test_a_function_that_fails_or_gets_what_it_cannot_use_says_so():
    case = tomllib.loads(CASE)

    def fails(motion):
        raise ZeroDivisionError("of the function")

    with pytest.raises(ZeroDivisionError, match="of the function"):
        damprig.evaluate(case, KEYS[:1], [[9.0]] * 20, fails)
    band = {"key": "base.frequency_ratio", "from": 0.95, "to": 1.05, "count": 5, "reduce": "maximum"}
    for given in [{"axis": [band]}, {"record": {"cycles": 5}}]:
        with pytest.raises(damprig.InputError, match="leave out"):
            damprig.evaluate(case, KEYS[:1], [[9.0]], fails, **given)
    with pytest.raises(damprig.InputError, match="clearance_ratoi"):
        damprig.evaluate(case, ["particle.clearance_ratoi"], [[9.0]], fails)


# Contacts with a soft wall that fall on one instant.
NOT_TOLD_APART = """
force = { kind = "sine", amplitude_n = 1, frequency_hz = 8 }
run = { duration_s = 2 }
storey = [
    { mass_kg = 10, stiffness_n_per_m = 10000, damping_n_s_per_m = 4 },
    { mass_kg = 20, stiffness_n_per_m = 4000, damping_n_s_per_m = 4 },
    { mass_kg = 20, stiffness_n_per_m = 10000, damping_n_s_per_m = 4 },
]
friction_damper = [{ place = "floor 3", force_n = 0.5 }]
[[particle]]
place = "floor 1"
mass_kg = 1
clearance_m = 0.004
wall = { kind = "voigt", stiffness_n_per_m = 1000, damping_n_s_per_m = 0, release = "zero_force" }
start = "at_negative_wall"
"""


def test_points_with_events_that_are_not_resolved_are_warned_of():
    with pytest.warns(UserWarning, match="at 1 of 2 points, first at point 1"):
        damprig.evaluate(tomllib.loads(NOT_TOLD_APART), ["particle.friction_coefficient"], [[0.1], [0.0]], "rms_x_m")


def test_a_bifurcation_diagram_is_that_of_the_command(command, project, tmp_path):
    case = project / "host/cases/spid.toml"
    options = ["--axis", "particle.clearance_ratio=12:13:3", "--settle-cycles", "20", "--cycles", "5"]
    command("study", "bifurcation", case, *options, "--out", tmp_path / "diagram", cwd=tmp_path)
    expected = parquet.read_table(tmp_path / "diagram/bifurcation.parquet")
    key = "particle.clearance_ratio"
    found = damprig.bifurcation(case, key, [12, 12.5, 13], settle_cycles=20, cycles=5)
    assert len(found) == expected.num_rows == 30
    for name in expected.column_names:
        assert list(found[name]) == expected[name].to_pylist(), name
    up = damprig.bifurcation(tomllib.loads(case.read_text()), key, np.linspace(12, 13, 3), direction="up", settle_cycles=20, cycles=5)
    assert np.array_equal(up["x_m"], found["x_m"][:15])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"values": [13, 12]}, "rising order"),
        ({"values": [1.0]}, "two or more"),
        ({"direction": "left"}, "'both', 'up' or 'down'"),
        ({"direction": ["up"]}, "'both', 'up' or 'down'"),
        ({"key": None}, "key = None"),
        ({"key": "particle.clearance_m = 3 #"}, "with its tables"),
        ({"cycles": 1_000_000, "values": np.arange(1.0, 101.0)}, "40000000 or fewer"),
        ({"cycles": 0}, "from 1 to 1000000"),
        ({"settle_cycles": 1.5}, "whole number"),
        ({"key": "particle.clearence_ratio"}, "clearence_ratio"),
        ({"key": "particle.wall.coefficient", "values": [0.5, 1.5]}, r"1\.5(.|\n)*key and values"),
    ],
)
def test_a_wrong_bifurcation_is_refused(change, words):
    given = {"key": "particle.clearance_ratio", "values": [12, 13], **change}
    with pytest.raises(damprig.InputError, match=words):
        damprig.bifurcation(tomllib.loads(CASE), **given)


def test_ctrl_c_stops_a_long_evaluation(interrupted):
    # It would take hours.
    call = f"damprig.evaluate({tomllib.loads(CASE)!r}, {KEYS[:1]!r}, [[9.0]] * 4, 'rms_x_m', record={{'cycles': 1e9}})"
    assert interrupted("damprig.evaluate", call) == "interrupted"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"keys": "particle.clearance_ratio"}, "list of keys"),
        ({"points": [1.0, 2.0]}, r"shape \(2,\)"),
        ({"points": [[1.0]]}, r"\(n, 2\)"),
        ({"points": [["a", "b"]]}, "real numbers"),
        ({"points": [[9.0, 0.5], [np.nan, 0.5]]}, "point 1: particle.clearance_ratio = NaN"),
        ({"points": np.empty((0, 2))}, "no point"),
        ({"points": [[9.0, 0.5], [9.0, 1.5]]}, r"particle.wall.coefficient.* 1\.5(.|\n)*points = .points."),
        ({"keys": ["particle.clearance_ratio", "particle.wall.coeff"]}, "coeff"),
        ({"metrics": "x_over"}, "x_over_z"),
        ({"axis": [{"key": "base.frequency_hz", "values": [2.4, 2.5]}]}, "reduce"),
        ({"record": {"cycle": 3}}, "cycle"),
    ],
)
def test_wrong_points_are_refused_with_what_is_wrong(change, words):
    given = {"case": tomllib.loads(CASE), "keys": KEYS, "points": [[9.0, 0.5]], "metrics": "x_over_z", **change}
    with pytest.raises(damprig.InputError, match=words):
        damprig.evaluate(**given)


def test_a_wrong_dict_is_refused_as_its_file_is(folder):
    study = tomllib.loads(STUDY)
    with pytest.raises(damprig.InputError, match="must be of x_over_z"):
        damprig.study({**study, "metrics": ["x_over"]})
    with pytest.raises(damprig.InputError, match="particle.wall.coefficient"):
        wall = {"kind": "restitution", "coefficient": 2}
        case = tomllib.loads(CASE)
        damprig.study({**study, "case": {**case, "particle": {**case["particle"], "wall": wall}}})
    with pytest.raises(damprig.InputError, match="absent.toml"):
        damprig.continuation({"case": "absent.toml", "parameter": "particle.clearance_ratio", "from": 9, "to": 12})


def test_wrong_arguments_are_named(folder):
    with pytest.raises(damprig.InputError, match="study.tom"):
        damprig.study(folder / "study.tom")
    with pytest.raises(damprig.InputError, match="must be the path of a file, or a dict with the keys of one, not int"):
        damprig.study(3)
    with pytest.raises(damprig.InputError, match="`case` is missing"):
        damprig.study({})
    with pytest.raises(damprig.InputError, match="submit"):
        damprig.study(folder / "study.toml", folder / "out", executor=3)
    with pytest.raises(damprig.InputError, match="no periodic|case.toml|unknown key|parameter"):
        (folder / "wrong.toml").write_text('case = "case.toml"\nparameter = "tmd.mass_ratio"\nfrom = 1\nto = 2\n', encoding="utf-8")
        damprig.continuation(folder / "wrong.toml")
