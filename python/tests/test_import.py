"""The package itself: what an import costs, and that its stubs name what it has."""

import ast
import subprocess
import sys
from pathlib import Path

import damprig

LIMIT_S = 0.05

IMPORT = """
import time
begun = time.perf_counter()
import damprig
spent_s = time.perf_counter() - begun
import sys
print(spent_s, *(name for name in ("numpy", "pandas", "polars", "xarray") if name in sys.modules))
"""


def imported():
    return subprocess.run([sys.executable, "-c", IMPORT], capture_output=True, text=True, check=True).stdout.split()


def test_an_import_takes_less_than_50_ms_and_imports_no_large_package():
    # The best of five: another process may hold the processor.
    attempts = [imported() for _ in range(5)]
    assert min(float(first) for first, *_ in attempts) < LIMIT_S, attempts
    assert all(not others for _, *others in attempts), attempts


def test_the_stubs_name_everything_that_the_package_has():
    stubs = ast.parse(Path(damprig.__file__).with_name("__init__.pyi").read_text())
    named = {alias.asname or alias.name for node in stubs.body if isinstance(node, ast.ImportFrom) for alias in node.names}
    named |= {node.target.id for node in stubs.body if isinstance(node, ast.AnnAssign)}
    assert named == set(damprig.__all__)
    assert Path(damprig.__file__).with_name("py.typed").exists()


def test_everything_public_has_a_docstring():
    for name in damprig.__all__:
        assert name == "__version__" or getattr(damprig, name).__doc__, name


def test_an_unknown_name_is_an_attribute_error():
    assert not hasattr(damprig, "nothing")
