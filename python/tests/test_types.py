"""Types of the package: a type checker finds a wrong key or word of a dict before it runs, and the right ones are those of the parsers."""

import subprocess
import sys
import tomllib
import typing
from pathlib import Path

import pytest

import damprig
from damprig import keys

RIGHT = """
import damprig
from damprig.keys import Case, Study

case: Case = {
    "structure": {"mass_kg": 1.6, "natural_frequency_hz": 2.5, "damping_ratio": 0.0038},
    "base": {"kind": "sine", "amplitude_m": 0.003, "frequency_hz": 2.5},
    "particle": {"mass_ratio": 0.1, "clearance_ratio": 10, "wall": {"kind": "restitution", "coefficient": 0.5}},
    "run": {"duration_s": 20},
}
study: Study = {"case": case, "metrics": ["x_over_z"], "axis": [{"key": "particle.clearance_ratio", "from": 8, "to": 14, "count": 7}]}
damprig.simulate(case).plot()
damprig.study(study).plot()
damprig.simulate({"structure": {"mass_kg": 1.6}})
damprig.VirtualRig(sensors="data_sheet").mount({"structure": {"mass_kg": 1.6}})
"""

WRONG = [
    ('"mass_kg": 1.6, "natural', '"mas_kg": 1.6, "natural', "mas_kg"),
    ('"kind": "restitution"', '"kind": "restitutions"', '"particle"'),
    ('"amplitude_m": 0.003', '"amplitude_m": "3 mm"', "amplitude_m"),
    ('"from": 8', '"start": 8', "start"),
    ('sensors="data_sheet"', 'sensors="data_shet"', "data_sheet"),
]


def checked(text, folder):
    """What mypy says of a program."""
    program = folder / f"program_{len(list(folder.glob('*.py')))}.py"
    program.write_text(text, encoding="utf-8")
    mypy = [sys.executable, "-m", "mypy", "--strict", "--follow-imports=silent", "--cache-dir", str(folder / "cache")]
    done = subprocess.run([*mypy, program.name], cwd=folder, capture_output=True, text=True, check=False)
    return done.returncode, done.stdout + done.stderr


def test_a_type_checker_finds_wrong_keys_and_words(tmp_path):
    status, said = checked(RIGHT, tmp_path)
    assert status == 0, said
    for right, wrong, words in WRONG:
        assert right in RIGHT
        status, said = checked(RIGHT.replace(right, wrong), tmp_path)
        assert status == 1 and words in said, f"{wrong}: {said}"


def test_the_types_are_those_of_the_parsers(project, command):
    assert (project / "python/damprig/keys.py").read_text(encoding="utf-8") == command("keys", "--python"), (
        "python/damprig/keys.py is out of date: write it anew with `damprig keys --python > python/damprig/keys.py`"
    )


def conforms(value, of):
    """Whether a value of TOML is of a type."""
    if typing.is_typeddict(of):
        fields = typing.get_type_hints(of)
        return isinstance(value, dict) and all(key in fields and conforms(one, fields[key]) for key, one in value.items())
    origin, inner = typing.get_origin(of), typing.get_args(of)
    if origin is typing.Union:
        return any(conforms(value, one) for one in inner)
    if origin is typing.Literal:
        return value in inner
    if origin is not None:
        return isinstance(value, list) and all(conforms(one, inner[0]) for one in value)
    return isinstance(value, (int, float) if of is float else of)


@pytest.mark.parametrize("kind", ["case", "campaign", "study", "optimisation", "continuation"])
def test_every_shipped_file_is_of_its_type(project, kind):
    folder = "studies" if kind == "study" else f"{kind}s"
    files = sorted((project / "host" / folder).glob("*.toml"))
    assert files
    for file in files:
        value = tomllib.loads(Path(file).read_text(encoding="utf-8"))
        assert conforms(value, getattr(keys, kind.capitalize())), file
    assert not conforms({**value, "mas_kg": 1}, getattr(keys, kind.capitalize()))


def test_the_types_are_not_imported_unless_asked_for():
    program = "import sys, damprig; damprig.simulate; damprig.study; assert 'damprig.keys' not in sys.modules"
    subprocess.run([sys.executable, "-c", program], check=True)
    assert damprig.__version__
