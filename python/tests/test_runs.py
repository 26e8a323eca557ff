"""Run folders: the tables as another reader has them, and damage that is named."""

import shutil

import numpy as np
import pyarrow.parquet as pq
import pytest

import damprig


def test_every_table_is_what_another_reader_of_parquet_finds(short_run):
    for name in ("results", "samples", "impacts"):
        other = pq.read_table(short_run.path / f"{name}.parquet")
        table = getattr(short_run, name)
        assert list(table.columns) == other.column_names and len(table) == other.num_rows > 0, name
        for field in other.schema:
            own, wanted = table[field.name], other[field.name].to_numpy()
            if own.dtype == object:
                assert own.tolist() == wanted.tolist(), field.name
            else:
                assert own.dtype == field.type.to_pandas_dtype(), field.name
                assert np.array_equal(own, wanted, equal_nan=own.dtype.kind == "f"), field.name
            assert table.units[field.name] == field.metadata[b"unit"].decode()


def test_a_run_has_its_manifest_parameters_and_campaign(short_run, project):
    assert short_run.status == "complete" and short_run.campaign == "short" and short_run.problems == []
    assert short_run.manifest["points_taken"] == 6
    model = short_run.parameters["hybrid"]["model"]
    assert model["structure"]["mass_kg"] == 1.6 and model["particle"]["clearance_m"] == pytest.approx(0.0075)
    assert short_run.campaign_text == (project / "host/campaigns/short.toml").read_text()
    assert len(short_run.transients) == 0


def test_frames_of_every_library_have_the_same_values(short_run):
    table = short_run.results
    pandas, polars, xarray = (table.frame(library) for library in ("pandas", "polars", "xarray"))
    for name in ("x_over_z", "start_tick", "steady", "set_up", "steadiness"):
        values = table[name].tolist()
        assert pandas[name].tolist() == polars[name].to_list() == xarray[name].values.tolist() == values, name
    assert str(pandas["set_up"].dtype) == "category"
    assert pandas.attrs["units"]["frequency_hz"] == xarray["frequency_hz"].attrs["units"] == "Hz"


def test_an_unknown_column_is_named_with_those_that_there_are(short_run):
    with pytest.raises(KeyError, match="no column 'x'.*x_over_z"):
        short_run.results["x"]


@pytest.fixture
def copied(short_run, tmp_path):
    return shutil.copytree(short_run.path, tmp_path / "copy")


def test_a_changed_file_is_named_and_the_rest_is_read(copied):
    (copied / "campaign.toml").write_text((copied / "campaign.toml").read_text().replace("0.0038", "0.0039"))
    with pytest.warns(damprig.RunFolderWarning, match="campaign.toml"):
        run = damprig.open_run(copied)
    assert any("campaign.toml" in problem for problem in run.problems)
    assert len(run.results) == 6
    assert damprig.open_run(copied, verify=False).problems == []


def test_samples_that_are_cut_off_warn_and_results_are_read(copied):
    content = (copied / "samples.parquet").read_bytes()
    (copied / "samples.parquet").write_bytes(content[: len(content) // 2])
    with pytest.warns(damprig.RunFolderWarning):
        run = damprig.open_run(copied)
    assert any("samples.parquet" in problem for problem in run.problems)
    with pytest.warns(damprig.RunFolderWarning, match="samples.parquet"):
        assert len(run.samples) == 0
    assert len(run.results) == 6


def test_damaged_results_are_an_error_that_names_the_file(copied):
    (copied / "results.parquet").write_bytes(b"PAR1 nothing PAR1")
    with pytest.warns(damprig.RunFolderWarning):
        run = damprig.open_run(copied)
    with pytest.raises(damprig.RunFolderError, match="results.parquet"):
        len(run.results)


def test_what_is_no_run_is_refused_with_a_hint(tmp_path, copied, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(damprig.RunFolderError, match="there is no run"):
        damprig.open_run("nothing")
    with pytest.raises(damprig.RunFolderError, match="this folder is no run.*\n.*copy"):
        damprig.open_run(tmp_path)
    (copied / "manifest.json").write_text('{"format": 99}')
    with pytest.raises(damprig.RunFolderError, match="format 99"):
        damprig.open_run(copied)
