"""What the tests share: the project's files, the command to compare with, a rig, and a recorded run."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import damprig

PROJECT = Path(__file__).resolve().parents[2]

STRUCTURE = {"mass_kg": 1.6, "natural_frequency_hz": 2.5, "damping_ratio": 0.0038}
PARTICLE = {"mass_ratio": 0.1, "clearance_ratio": 5, "wall": {"kind": "restitution", "coefficient": 0.47}}


@pytest.fixture(scope="session")
def project():
    return PROJECT


@pytest.fixture(scope="session")
def command():
    """Runs the damprig command: its standard output."""
    program = os.environ["DAMPRIG_COMMAND"]

    def run(*arguments, cwd=None):
        done = subprocess.run([program, *map(str, arguments)], cwd=cwd, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        return done.stdout

    return run


@pytest.fixture
def spid():
    """A structure with an impact damper, as a case has it."""
    return {
        "structure": dict(STRUCTURE),
        "particle": {**PARTICLE, "clearance_ratio": 10},
        "base": {"kind": "sine", "amplitude_m": 0.003, "frequency_hz": 2.5},
        "run": {"duration_s": 8.0},
    }


@pytest.fixture
def bare():
    """A bare structure, as a campaign has it."""
    return {"structure": dict(STRUCTURE), "base_amplitude_m": 0.0004}


@pytest.fixture
def damped():
    """A structure with an impact damper, as a campaign has it."""
    return {"structure": dict(STRUCTURE), "particle": dict(PARTICLE), "base_amplitude_m": 0.0015}


@pytest.fixture(scope="session")
def short_run(tmp_path_factory):
    """The campaign short.toml on the virtual rig, from Python."""
    folder = tmp_path_factory.mktemp("runs") / "short"
    return damprig.VirtualRig().run(PROJECT / "host/campaigns/short.toml", out=folder)


INTERRUPTED = """
import os, signal, sys, threading, time
import damprig
signal.signal(signal.SIGINT, signal.default_int_handler)
main = threading.get_ident()
PREPARE
code = FUNCTION.__code__

def interrupt():
    # The main thread stays in the function while native code works, which lets this thread run.
    seen = 0
    while seen < 1000:
        frame = sys._current_frames()[main]
        while frame is not None:
            seen += frame.f_code is code
            frame = frame.f_back
    os.kill(os.getpid(), signal.SIGINT)

threading.Thread(target=interrupt, daemon=True).start()
try:
    CALL
except KeyboardInterrupt:
    print("interrupted")
AFTER
"""


@pytest.fixture
def interrupted():
    """Makes a call in a new process and sends SIGINT to it when it is in `function`; gives what it prints."""
    if sys.platform == "win32":
        pytest.skip("signals of POSIX")

    def run(function, call, prepare="", after=""):
        script = INTERRUPTED.replace("FUNCTION", function).replace("CALL", call)
        script = script.replace("PREPARE", prepare).replace("AFTER", after)
        done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=120, check=False)
        assert done.returncode == 0, done.stderr
        return done.stdout.strip()

    return run
