"""Runs every example of docs/PYTHON.md and docs/MATLAB.md, and the notebook."""

import json
import os
import re
import shutil
import subprocess
import warnings

import nbformat
import numpy as np
import pytest
from nbclient import NotebookClient

import damprig


def blocks(project, document, language):
    text = (project / "docs" / document).read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```", text, flags=re.MULTILINE | re.DOTALL)


@pytest.fixture
def clone(project, tmp_path, monkeypatch):
    """A folder that looks like a clone to the examples."""
    (tmp_path / "host").symlink_to(project / "host")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_every_example_of_the_python_page_runs(project, clone, capsys):
    examples = blocks(project, "PYTHON.md", "python")
    assert len(examples) >= 8
    names = {}
    for number, example in enumerate(examples):
        exec(compile(example, f"docs/PYTHON.md, example {number + 1}", "exec"), names)  # noqa: S102
    assert "complete []" in capsys.readouterr().out
    # What the page shows is what it says.
    assert names["row"]["x_over_z"] > 1 and names["pulse"]["max_abs_x_m"][0] > 1e-3 and len(names["after"].faults) == 1
    assert sum("seq_num" in document for document in names["rows"]) == 3 and len(names["largest_x_m"]) == 3


def test_the_notebook_runs(project):
    path = project / "python/notebooks/first_steps.ipynb"
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(path.parent)}}).execute()
    outputs = [output for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs]
    assert sum("image/png" in output.get("data", {}) for output in outputs) == 5
    assert any("the emergency stop is pressed" in output.get("text", "") for output in outputs)


OCTAVE = shutil.which("octave-cli") or shutil.which("octave")


@pytest.fixture
def exported(short_run, clone, command):
    """The run and the files that docs/MATLAB.md reads."""
    shutil.copytree(short_run.path, clone / "runs/short")
    command("runs", "export", "runs/short", "--format", "mat", "--out", "short.mat", cwd=clone)
    command("simulate", "host/cases/spid.toml", "--out", "spid.mat", cwd=clone)
    (clone / "spid.json").write_text(command("simulate", "host/cases/spid.toml", "--json", cwd=clone))
    return clone


@pytest.mark.skipif(OCTAVE is None, reason="Octave is not installed")
def test_octave_reads_what_the_matlab_page_says(project, exported, short_run):
    examples = [example for example in blocks(project, "MATLAB.md", "matlab") if "% MATLAB only" not in example]
    assert len(examples) >= 3
    last = """
    out = struct('ratio', results.x_over_z, 'rows', numel(samples.x_m), 'points', manifest.points_taken, ...
                 'largest', max(abs(motion.x_m)), 'impacts', numel(printed.impacts), 'unit', units.samples.x_m);
    file = fopen('out.json', 'w'); fputs(file, jsonencode(out)); fclose(file);
    """
    (exported / "page.m").write_text("\n".join([*examples, last]))
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run([OCTAVE, "--no-gui", "--no-init-file", "page.m"], cwd=exported, env=environment,
                          capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    out = json.loads((exported / "out.json").read_text())
    assert np.array(out["ratio"]) == pytest.approx(short_run.results["x_over_z"], rel=1e-14)
    assert (out["rows"], out["points"], out["unit"]) == (len(short_run.samples), 6, "m")
    case = damprig.simulate(exported / "host/cases/spid.toml")
    assert out["largest"] == pytest.approx(np.abs(case.x).max(), rel=1e-14) and out["impacts"] == len(case.impacts)


def test_the_python_bridge_of_the_matlab_page_has_its_calls(project, exported):
    """MATLAB calls a function of Python with keyword arguments as `py.damprig.simulate(path, rate_hz=…)`; here Python does."""
    (bridge,) = [example for example in blocks(project, "MATLAB.md", "matlab") if "py.damprig" in example]
    for call in re.findall(r"py\.(damprig\.\w+)\(", bridge):
        assert callable(getattr(damprig, call.split(".")[1])), call
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert len(damprig.simulate("host/cases/spid.toml", rate_hz=1000.0).x) == 40_001
