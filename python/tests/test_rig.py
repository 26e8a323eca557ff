"""The virtual rig: against closed forms and the command; repeatable; faults, refusals, Ctrl-C."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import damprig


def mounted(set_up, **arguments):
    rig = damprig.VirtualRig(**arguments)
    rig.mount(set_up)
    return rig


def test_a_bare_structure_has_the_transmissibility_of_its_closed_form(bare):
    rig = mounted(bare)
    # Off resonance; a transient that decays with 17 s is 2e-6 of itself after settling.
    for frequency_hz in (1.5, 3.5):
        row = rig.measure(frequency_hz, settle_s=220.0, dwell_s=20.0)
        ratio, damping = frequency_hz / 2.5, 0.0038
        wanted = np.sqrt((1 + (2 * damping * ratio) ** 2) / ((1 - ratio**2) ** 2 + (2 * damping * ratio) ** 2))
        # The mean over a tick is lower than a sample by (Ωh)²/24 ≤ 2e-5, in x as in z; single precision and the transient
        # leave 1e-5; a cycle's maximum over ticks misses the peak by at most (Ωh)²/8 = 6e-5.
        assert row["x_over_z_lock_in"] == pytest.approx(wanted, rel=2e-5)
        assert row["x_over_z"] == pytest.approx(wanted, rel=1e-4)
        assert row["steadiness"] == "steady" and row["frequency_hz"] == frequency_hz


def test_a_campaign_gives_the_bits_of_the_command(short_run, command, project, tmp_path):
    command("run", project / "host/campaigns/short.toml", "--out", tmp_path / "run")
    other = damprig.open_run(tmp_path / "run")
    for name in ("results", "samples", "impacts"):
        for column, values in getattr(short_run, name).columns.items():
            wanted = getattr(other, name)[column]
            assert np.array_equal(values, wanted, equal_nan=values.dtype.kind == "f"), (name, column)
    assert sorted(file.name for file in short_run.path.iterdir()) == sorted(file.name for file in other.path.iterdir())


def test_a_point_is_that_of_a_campaign_with_the_same_set_up(short_run, project):
    set_up = {
        "structure": {"mass_kg": 1.6, "natural_frequency_hz": 2.5, "damping_ratio": 0.0038},
        "base_amplitude_m": 0.0015,
        "particle": {"mass_ratio": 0.1, "clearance_ratio": 5, "wall": {"kind": "restitution", "coefficient": 0.47}},
        "friction_damper": {"friction_ratio": 0.4},
    }
    rig = mounted(set_up)
    results = damprig.VirtualRig().run(project / "host/campaigns/short.toml", out=short_run.path.parent / "again").results
    assert results["x_over_z"].tolist() == short_run.results["x_over_z"].tolist()
    row = rig.measure(2.5, settle_s=1.0, dwell_s=4.0)
    at = (results["set_up"] == "hybrid") & (results["frequency_hz"] == 2.5)
    # The campaign's sensors have 5 µm of noise and steps of 10 µm on 8 mm: each moves X/Z by less than 2e-3.
    assert row["x_over_z"] == pytest.approx(results["x_over_z"][at][0], rel=4e-3)


def test_the_same_calls_give_the_same_bits_and_another_seed_others(damped):
    def rows(seed):
        rig = mounted(damped, seed=seed, noise_rms_m=5e-6, sensors="data_sheet")
        return [rig.measure(frequency_hz, dwell_s=4.0) for frequency_hz in (2.4, 2.5)]

    # Not equality of dicts: a NaN differs from itself.
    assert str(rows(3)) == str(rows(3))
    assert rows(3)[0]["x_over_z"] != rows(4)[0]["x_over_z"]


def test_sensors_of_the_data_sheet_read_otherwise_than_ideal_ones(bare):
    ideal, sheet = (mounted(bare, sensors=sensors).measure(2.0, dwell_s=4.0) for sensors in ("ideal", "data_sheet"))
    assert ideal["x_over_z"] != sheet["x_over_z"]
    # Linearity of 0.1 % and filters of z and x alike.
    assert ideal["x_over_z"] == pytest.approx(sheet["x_over_z"], rel=0.05)


def test_every_tick_arrives_and_the_base_follows_the_drive(bare):
    rig = mounted(bare)
    names = list(rig.signal_units)[:16]
    rig.start(frequency_hz=2.0, signals=names)
    parts = [rig.advance(1.5), rig.advance(0.001), rig.advance(2.0)]
    time = np.concatenate([part.time for part in parts])
    assert np.array_equal(np.round(time * 1000), np.arange(3501)) and list(parts[0].signals) == names
    drive = np.concatenate([part["drive"] for part in parts])
    base = np.concatenate([part["z"] for part in parts])
    assert np.abs(drive).max() == pytest.approx(0.0004, rel=1e-6)
    # The last second has two whole cycles. Means over a tick are lower by (Ωh)²/24 = 7e-6; lines between ticks by (Ωh)²/8 = 2e-5.
    turn = np.exp(-2j * np.pi * 2.0 * time[-1000:])
    amplitude = 2 * abs(np.mean(base[-1000:] * turn))
    assert amplitude == pytest.approx(0.0004, rel=4e-5)
    assert np.sqrt(2) * np.std(base[-1000:]) == pytest.approx(amplitude, rel=4e-5)
    assert parts[0].units["x"] == "m" and parts[0].frame()["x"].dtype == np.float32


def test_events_are_data(damped):
    rig = mounted(damped)
    rig.start({"kind": "stepped_sine", "frequencies_hz": [2.4], "start": "from_rest", "dwell_s": 4.0})
    events = rig.advance(8.0).events
    kinds = [event["event"] for event in events]
    assert kinds.count("point") == kinds.count("finished") == 1 and kinds.count("impact") > 10
    assert rig.status()["state"] == "idle" and rig.values()["impacts"] >= kinds.count("impact")


def test_the_emergency_stop_latches_a_fault_until_it_is_released_and_cleared(damped):
    rig = mounted(damped)
    rig.start(frequency_hz=2.4)
    assert rig.advance(2.0).faults == []
    rig.emergency_stop()
    (fault,) = rig.advance(0.1).faults
    assert fault["cause"] == "the emergency stop is pressed" and fault["tick"] in (2000, 2001, 2002)
    assert rig.status()["fault"]["cause"] == fault["cause"]
    drive = rig.advance(3.0)["drive"]
    assert drive[-1] == 0
    with pytest.raises(damprig.RigError, match="release the emergency stop"):
        rig.clear_fault()
    with pytest.raises(damprig.RigError, match="emergency stop is pressed"):
        rig.measure(2.4)
    rig.release_emergency_stop()
    rig.rest()
    assert rig.status()["fault"] is None
    assert rig.measure(2.4, dwell_s=4.0)["x_over_z"] > 1


def test_an_interlock_is_an_exception_with_cause_value_and_limit(damped):
    # A prediction above the limit of a hard wall's force warns only: contacts of a real wall may be longer.
    rig = mounted(damped, settings={"safety": {"wall_force_n": 50.0}})
    with pytest.warns(damprig.UnusualValueWarning, match="force on a wall"), pytest.raises(damprig.FaultError) as caught:
        rig.measure(2.5, dwell_s=8.0)
    fault = caught.value
    assert "wall" in fault.cause and fault.cause in str(fault) and fault.value >= fault.limit == 50.0
    rig.rest()
    assert rig.status()["state"] == "idle"


def test_refusals_name_what_is_wrong(bare, tmp_path):
    rig = damprig.VirtualRig()
    with pytest.raises(damprig.RigError, match="no set-up is mounted"):
        rig.measure(2.5)
    with pytest.raises(damprig.RigError, match="no experiment is started"):
        rig.advance(1.0)
    with pytest.raises(damprig.InputError, match="base_amplitude_m"):
        rig.mount({"structure": bare["structure"]})
    with pytest.raises(damprig.InputError, match="must be a dict"):
        rig.mount("bare")
    rig.mount(bare)
    with pytest.raises(damprig.InputError, match="frequencies_hz"):
        rig.measure(-1)
    with pytest.raises(damprig.InputError, match="would leave the displacement limit"):
        rig.measure(2.5, base_amplitude_m=0.003)
    with pytest.raises(damprig.InputError, match="the device has the signals"):
        rig.start(frequency_hz=2.5, signals=["velocity"])
    with pytest.raises(damprig.InputError, match="seconds = 'long'"):
        rig.start(frequency_hz=2.5)
        rig.advance("long")
    (tmp_path / "full").mkdir()
    (tmp_path / "full/file").touch()
    with pytest.raises(damprig.RunFolderError, match="not empty"):
        rig.run({"name": "a", "set_up": [{"name": "b", **bare}], "experiment": [SWEEP]}, out=tmp_path / "full")


SWEEP = {"kind": "stepped_sine", "frequencies_hz": [2.0], "start": "from_rest", "dwell_s": 3.0}


def test_settings_of_a_board_act_and_wrong_ones_are_named(bare):
    with pytest.raises(damprig.InputError, match="safety.limits"):
        damprig.VirtualRig({"safety": {"limits": {"structure": 0.01}}})
    rig = mounted(bare, settings={"safety": {"limits": {"structure_m": 0.005}}})
    with pytest.raises(damprig.InputError, match="limit ±5 mm"):
        rig.measure(2.4)
    with pytest.raises(damprig.InputError, match="data_sheet"):
        damprig.VirtualRig(sensors="perfect")


def test_a_free_vibration_gives_the_damping_of_the_structure(bare):
    rig = mounted(bare)
    row = rig.experiment({"kind": "free_vibration", "start_m": 0.02, "measure_s": 12.0})
    # Of single-precision samples at 1 kHz over ten cycles.
    assert row["damping_ratio"][0] == pytest.approx(0.0038, rel=2e-3)


def test_ctrl_c_stops_an_experiment_and_the_rig_goes_on(bare, interrupted):
    # Eleven days on the rig.
    prepare = f"rig = damprig.VirtualRig(); rig.mount({bare!r})"
    after = 'print(rig.status()["state"], rig.measure(2.0, dwell_s=4.0)["cycles"])'
    shown = interrupted("damprig.VirtualRig._call", "rig.measure(2.0, dwell_s=9e5)", prepare, after)
    assert shown == "interrupted\nidle 8"


def test_threads_share_a_rig_one_call_after_the_other(bare):
    rig = mounted(bare)
    with ThreadPoolExecutor() as pool:
        rows = list(pool.map(lambda frequency_hz: rig.measure(frequency_hz, dwell_s=4.0), [1.9, 2.0, 2.1]))
    alone = [mounted(bare).measure(frequency_hz, dwell_s=4.0) for frequency_hz in (1.9, 2.0, 2.1)]
    # Each point starts from rest, whatever came before.
    assert [row["x_over_z"] for row in rows] == [row["x_over_z"] for row in alone]
