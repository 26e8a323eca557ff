"""Simulations: the motion against closed forms and the command, refusals, threads, Ctrl-C."""

import json
import threading

import numpy as np
import pytest

import damprig


def test_an_undamped_free_vibration_is_a_cosine():
    case = {
        "structure": {"mass_kg": 1.6, "natural_frequency_hz": 2.5, "damping_ratio": 0},
        "initial": {"x_m": 0.035},
        "run": {"duration_s": 2.0},
    }
    result = damprig.simulate(case, rate_hz=1000)
    omega = 2 * np.pi * 2.5
    # Rounding: the phase of ωt up to 31 rad has an error of a few ulp, 31 × 2.2e-16 × 10.
    assert np.abs(result.x - 0.035 * np.cos(omega * result.time)).max() < 0.035 * 7e-14
    assert np.abs(result.v + 0.035 * omega * np.sin(omega * result.time)).max() < 0.035 * omega * 7e-14
    assert len(result.time) == 2001 and result.time[-1] == 2.0
    assert np.array_equal(result.y, result.x) and not result.z.any()


def test_a_base_of_two_sines_moves_the_structure_as_their_superposition():
    t = np.arange(60_001) * 1e-3
    sines = [(2.1, 0.002, 0.0), (2.9, 0.001, 0.4)]
    z = sum(amplitude * np.sin(2 * np.pi * hertz * t + phase) for hertz, amplitude, phase in sines)
    zeta, natural_hz = 0.05, 2.5
    case = {
        "structure": {"mass_kg": 1.6, "natural_frequency_hz": natural_hz, "damping_ratio": zeta},
        "base": {"kind": "samples", "displacement_m": z, "time_step_s": 1e-3},
        "run": {"duration_s": 60},
    }
    result = damprig.simulate(case, sample_times=np.linspace(50, 60, 501))
    expected = np.zeros(501)
    for hertz, amplitude, phase in sines:
        r = hertz / natural_hz
        h = (1 + 2j * zeta * r) / (1 - r**2 + 2j * zeta * r)
        expected += (amplitude * h * np.exp(1j * (2 * np.pi * hertz * result.time + phase))).imag
    # The transient has decayed to e^(−0.05 · 2π · 2.5 · 50), 1e-17; the cubics between samples miss (Ωh)³ of the amplitude, 6e-6, and less in the mean.
    assert np.abs(result.x - expected).max() < 6e-6 * np.abs(expected).max()


def test_a_beam_has_results_at_every_place_and_of_every_damper():
    wall = {"kind": "restitution", "coefficient": 0.5}
    case = {
        "beam": {
            "kind": "cantilever",
            "length_m": 0.3,
            "bending_stiffness_n_m2": 4000,
            "mass_per_length_kg_per_m": 4,
            "damping_ratio": 0.01,
        },
        "force": {"kind": "sine", "amplitude_n": 12, "frequency_ratio": 1},
        "particle": [
            {"position_m": 0.3, "mass_kg": 0.08, "clearance_m": 2e-4, "wall": wall},
            {"position_m": 0.2, "mass_kg": 0.04, "clearance_m": 1e-4, "wall": wall},
        ],
        "run": {"duration_s": 0.2},
    }
    result = damprig.simulate(case)
    tip, inner = (next(of for of in result.places if of["place"] == name) for name in ("0.3 m", "0.2 m"))
    assert tip["max_abs_x_m"] == result.summary["max_abs_x_m"] > inner["max_abs_x_m"] > 0
    assert np.abs(result.x).max() <= tip["max_abs_x_m"]
    counts = [of["impact_count"] for of in result.impact_dampers]
    assert counts == [int((result.impacts.damper == number).sum()) for number in (1, 2)]
    assert np.isnan(result.impacts.y[result.impacts.damper == 2]).all()
    assert np.abs(result.y - result.x).max() <= 2e-4 * (1 + 1e-9)
    assert sum(of["energy_share"] for of in result.mode_shares) == pytest.approx(1, rel=1e-12)


def test_every_time_that_is_asked_for_has_its_row():
    random = np.random.default_rng(29)
    for _ in range(2000):
        duration_s = random.uniform(0.1, 3.0)
        case = {
            "structure": {"mass_kg": 1.6, "natural_frequency_hz": random.uniform(1.0, 9.0), "damping_ratio": 0.0038},
            "particle": {"mass_ratio": 0.1, "clearance_m": 0.01, "wall": {"kind": "restitution", "coefficient": 0.6}},
            "initial": {"x_m": 0.035},
            "run": {"duration_s": duration_s},
        }
        times = np.sort(random.uniform(0.0, duration_s, 50))
        times[-1] = duration_s
        assert np.array_equal(damprig.simulate(case, sample_times=times).time, times)
        assert len(damprig.simulate(case, sample_times=[duration_s]).time) == 1
        rows = int(random.integers(1, 200))
        assert len(damprig.simulate(case, rate_hz=rows / duration_s).time) == rows + 1


def test_the_base_of_a_sine_is_the_sine(spid):
    result = damprig.simulate(spid, rate_hz=500)
    wanted = 0.003 * np.sin(2 * np.pi * 2.5 * result.time)
    # The series of the base within an arc are cut below 1e-15 of the amplitude; the phase reaches 126 rad.
    assert np.abs(result.z - wanted).max() < 0.003 * 1e-12


def test_the_particle_stays_between_its_walls_and_impacts_where_they_are(spid):
    result = damprig.simulate(spid, rate_hz=2000)
    clearance_m = 0.03
    assert np.abs(result.y - result.x).max() <= clearance_m * (1 + 1e-9)
    assert len(result.impacts) == result.summary["impact_count"] > 20
    assert set(result.impacts.side.tolist()) == {-1, 1}
    assert (np.diff(result.impacts.time) > 0).all() and (result.impacts.approach_speed > 0).all()


def test_states_and_impacts_are_bit_for_bit_those_of_the_command(command, project, tmp_path):
    case = project / "host/cases/spid.toml"
    times = np.linspace(0.1, 40, 400)
    text = case.read_text().replace("duration_s = 40", f"duration_s = 40, sample_times_s = {times.tolist()}")
    copy = tmp_path / "spid.toml"
    copy.write_text(text)
    printed = json.loads(command("simulate", copy, "--json"))
    for result in (damprig.simulate(case, sample_times=times), damprig.simulate(copy)):
        assert np.array_equal(result.time, times)
        for name, key in (("x", "x_m"), ("v", "v_m_per_s"), ("y", "y_m"), ("u", "u_m_per_s")):
            assert np.array_equal(getattr(result, name), printed[key]), name
        assert result.summary == printed["summary"]
        assert result.impacts.time.tolist() == [impact["t_s"] for impact in printed["impacts"]]


@pytest.mark.parametrize("name", ["friction-damper", "hybrid", "soft-wall", "tmd", "record"])
def test_every_shipped_case_has_the_summary_that_the_command_prints(command, project, name):
    case = project / f"host/cases/{name}.toml"
    result = damprig.simulate(case)
    printed = json.loads(command("simulate", case, "--json"))
    assert result.summary == printed["summary"]
    assert result.time[-1] == pytest.approx(result.parameters["duration_s"], rel=1e-3)
    assert np.abs(result.x).max() <= result.summary["max_abs_x_m"] * (1 + 1e-12)


def test_numpy_scalars_and_arrays_are_numbers_of_a_case(spid):
    plain = damprig.simulate({**spid, "run": {"duration_s": 2.0, "sample_times_s": [0.5, 1.0]}})
    spid["structure"]["mass_kg"] = np.float64(1.6)
    spid["particle"]["clearance_ratio"] = np.int64(10)
    spid["run"] = {"duration_s": np.float32(2.0), "sample_times_s": np.array([0.5, 1.0])}
    assert np.array_equal(damprig.simulate(spid).x, plain.x)


def test_a_record_of_a_dict_is_found_from_the_working_directory(project, monkeypatch):
    monkeypatch.chdir(project / "host/cases")
    case = {
        "structure": {"mass_kg": 1.6, "natural_frequency_hz": 2.5, "damping_ratio": 0.0038},
        "base": {"kind": "record", "file": "shake.csv", "quantity": "acceleration", "unit": "g"},
        "run": {"duration_s": 12},
    }
    assert np.abs(damprig.simulate(case).z).max() > 0


def test_an_unusual_value_warns_and_is_used(spid):
    spid["structure"]["damping_ratio"] = 0.3
    with pytest.warns(damprig.UnusualValueWarning, match="damping_ratio"):
        damprig.simulate(spid)


def test_values_that_are_set_replace_those_of_the_case(project):
    case = project / "host/cases/spid.toml"
    motion = damprig.simulate(case, set={"run.duration_s": 2, "particle.start": "at_negative_wall", "particle.wall.coefficient": np.float64(0.3)})
    assert motion.time[-1] == 2 and motion.y[0] < motion.x[0]
    assert motion.parameters["set_up"]["particle"]["wall"] == {"Restitution": {"coefficient": 0.3}}
    with pytest.raises(damprig.InputError, match="particle.wall.coeficient"):
        damprig.simulate(case, set={"particle.wall.coeficient": 0.3})
    with pytest.raises(damprig.InputError, match="must be a dict"):
        damprig.simulate(case, set=["particle.wall.coefficient"])


def test_frames_have_the_columns_and_their_units(spid):
    result = damprig.simulate(spid, rate_hz=100)
    frame = result.frame()
    assert list(frame.columns) == ["time", "x", "v", "y", "u", "z"] and frame.attrs["units"]["v"] == "m/s"
    assert np.array_equal(frame["x"], result.x)
    assert np.array_equal(result.frame("polars")["x"].to_numpy(), result.x)
    assert result.frame("xarray")["x"].attrs["units"] == "m"
    with pytest.raises(damprig.InputError, match="spark.*pandas, polars, xarray"):
        result.frame("spark")


def refused(match, case, **arguments):
    with pytest.raises(damprig.InputError, match=match) as caught:
        damprig.simulate(case, **arguments)
    return str(caught.value)


def test_refusals_name_key_value_and_what_is_allowed(spid, tmp_path):
    spid["structure"]["mass_kg"] = -1
    spid["structure"]["natural_frequency"] = spid["structure"].pop("natural_frequency_hz")
    message = refused("structure.mass_kg` = -1", spid)
    assert "must be greater than 0" in message and "write `natural_frequency_hz`" in message
    refused("cannot read .*nothing.toml", tmp_path / "nothing.toml")
    refused("must be the path of a file, or a dict", 7)


@pytest.mark.parametrize(
    ("value", "match"),
    [
        (None, r'case\["run"\]\["duration_s"\]: None is not allowed; leave the key out'),
        (np.ones((2, 3)), r"an array of shape \(2, 3\) is not allowed; it must have one dimension"),
        (1j, "a value of type complex is not allowed"),
        (10**30, "is beyond"),
        (float("nan"), "duration_s"),
    ],
)
def test_a_value_that_no_file_can_have_is_named_with_its_place(spid, value, match):
    spid["run"]["duration_s"] = value
    refused(match, spid)


@pytest.mark.parametrize(
    ("arguments", "match"),
    [
        ({"sample_times": np.ones((2, 3))}, r"sample_times has the shape \(2, 3\): must have one dimension"),
        ({"sample_times": ["a"]}, "sample_times has the dtype"),
        ({"sample_times": [[1], [1, 2]]}, "sample_times"),
        ({"sample_times": [2.0, 1.0]}, r"sample_times\[1\] = 1 is not allowed: must be in rising order, from 0 to duration_s = 8"),
        ({"sample_times": [9.0]}, r"sample_times\[0\] = 9"),
        ({"sample_times": [float("nan")]}, r"sample_times\[0\] = NaN"),
        ({"rate_hz": 0}, "rate_hz = 0 is not allowed: must be above 0"),
        ({"rate_hz": "fast"}, "rate_hz = 'fast' is not allowed: must be one real number"),
        ({"rate_hz": 1e9}, "rows: must be 4e7 or fewer; lower rate_hz"),
        ({"rate_hz": 10, "sample_times": [1.0]}, "both given"),
    ],
)
def test_wrong_arguments_are_named_with_their_value(spid, arguments, match):
    refused(match, spid, **arguments)


def long(spid, duration_s):
    return {**spid, "run": {"duration_s": duration_s, "sample_times_s": [duration_s]}}


def test_another_thread_runs_during_a_simulation(spid):
    begun, over = threading.Event(), threading.Event()
    counted = 0

    def count():
        nonlocal counted
        begun.set()
        while not over.is_set():
            counted += 1

    thread = threading.Thread(target=count)
    thread.start()
    begun.wait()
    before = counted
    damprig.simulate(long(spid, 20_000.0))
    after = counted
    over.set()
    thread.join()
    # A lock that were held throughout would leave a handful of turns at both ends.
    assert after - before > 10_000


def test_two_threads_simulate_at_once(spid):
    results = []
    slow = threading.Thread(target=lambda: results.append(damprig.simulate(long(spid, 100_000.0))))
    slow.start()
    quick = damprig.simulate(spid)
    # The short simulation began later and ended while the long one went on.
    assert results == []
    slow.join()
    assert results[0].summary["simulated_s"] == 100_000.0
    assert np.array_equal(quick.x, damprig.simulate(spid).x)


def test_ctrl_c_stops_a_long_simulation(spid, interrupted):
    # It would take hours.
    assert interrupted("damprig.simulate", f"damprig.simulate({long(spid, 1e9)!r})") == "interrupted"


def test_an_analysis_is_that_of_the_command(command, spid, tmp_path):
    # Long enough to be on the periodic orbit.
    case = {**spid, "run": {"duration_s": 40}}
    file = tmp_path / "case.json"
    file.write_text(json.dumps(case))
    expected = json.loads(command("simulate", str(file), "--analyse", "--json"))["analysis"]
    assert damprig.analyse(case) == damprig.analyse(file) == expected
    largest = expected["driven"]["sensitivities"]["of"][0]
    assert largest["key"] == "base.frequency_hz" and largest["max_abs_x"] < -5


def test_a_run_on_a_record_has_sensitivities_to_its_keys(project, command):
    file = project / "host/cases/record.toml"
    found = damprig.analyse(file)
    assert found == json.loads(command("simulate", str(file), "--analyse", "--json"))["analysis"]
    assert "energy" not in found and found["driven"] is None
    assert found["sensitivities"]["run"] == {"left_out": [], "grazing": []}
    assert {of["key"] for of in found["sensitivities"]["of"]} >= {"particle.clearance_m", "friction_damper.force_n"}


def test_what_has_no_analysis_is_refused(project):
    with pytest.raises(damprig.InputError, match="analyse is not available for `many_particles`"):
        damprig.analyse(project / "host/cases/many-particles.toml")