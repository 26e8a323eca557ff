"""Measured signals of files, runs as signals (SEP005), response spectra."""

import json

import numpy as np
import pytest
from sdypy_sep005 import Sep005Data

import damprig


@pytest.fixture
def record(tmp_path):
    """A sine of 1 Hz and 0.2 g over 20 periods."""
    t = np.arange(2001) * 0.01
    file = tmp_path / "quake.csv"
    rows = (f"{time:.2f},{value:.9f}" for time, value in zip(t, 0.2 * np.sin(2 * np.pi * t), strict=True))
    file.write_text("t_s,a_g\n" + "\n".join(rows) + "\n")
    return file


def test_a_signal_over_time_has_the_form_of_sep005(record):
    (signal,) = damprig.read_signals(record)
    Sep005Data.model_validate(signal)
    assert signal["quantity"] == "a" and signal["unit_str"] == "g" and signal["si"] == pytest.approx(9.80665)
    assert signal["fs"] == pytest.approx(100.0) and signal["start_s"] == 0.0
    assert signal["data"].shape == (2001,) and signal["data"].max() == pytest.approx(0.2)


def test_a_run_gives_histories_and_responses_as_signals(short_run):
    signals = short_run.signals()
    over_time = [signal for signal in signals if "frequency" not in signal]
    responses = [signal for signal in signals if "frequency" in signal]
    for signal in over_time:
        Sep005Data.model_validate(signal)
    assert "d" in {signal.get("quantity") for signal in over_time}
    results = short_run.results
    measured = sum(len(response["data"]) for response in responses)
    assert measured == len(results)
    ratios = np.sort(np.abs(np.concatenate([response["data"] for response in responses])))
    assert np.allclose(ratios, np.sort(results["x_amplitude_m"] / results["z_amplitude_m"]), rtol=1e-6)


def test_a_file_that_cannot_be_read_is_an_input_error(tmp_path):
    (tmp_path / "bad.csv").write_text("t_s,x_mm\n0,1\n1,x\n")
    with pytest.raises(damprig.InputError, match="line 3, column 2"):
        damprig.read_signals(tmp_path / "bad.csv")


def test_a_response_spectrum_is_that_of_the_command(record, command):
    found = damprig.response_spectrum(record, damping=[0.02, 0.05], periods_s=[0.5, 1.0, 2.0])
    printed = json.loads(command("spectrum", record, "--damping", "0.02,0.05", "--periods", "0.5,1,2", "--json"))
    assert found["sd_m"].shape == (2, 3)
    assert found["sd_m"].ravel().tolist() == [point["sd_m"] for point in printed["spectra"]]
    # At resonance of a steady sine: a/(2ζω²), nearly reached after 20 periods of ζ = 0.05.
    assert found["sd_m"][1, 1] == pytest.approx(0.2 * 9.80665 / (0.1 * (2 * np.pi) ** 2), rel=0.005)


def test_what_is_no_spectrum_is_an_input_error(record):
    for arguments, words in [
        ({"damping": 1.0}, "damping = 1"),
        ({"periods_s": [0.0]}, "periods_s = 0"),
        ({"method": "guess"}, "at-samples"),
        ({"unit": "parsec"}, "unit"),
        ({"sensitivity": "0 mV/g"}, "greater than 0"),
    ]:
        with pytest.raises(damprig.InputError, match=words):
            damprig.response_spectrum(record, **arguments)
