"""Reads the exports of a run with scipy, pandas, h5py and pyuff and compares them with the run's Parquet files.

    check_exports.py RUN CSV_SAMPLES CSV_RESULTS CSV_IMPACTS MAT H5 UFF

Numbers of .mat, HDF5 and CSV must have the same bits; those of UFF must agree in the digits that the format has (12 for values,
6 for the abscissa). The expected histories and responses are computed here from the Parquet files alone. Exits with a
message at the first difference.
"""

import json
import pathlib
import sys

import h5py
import numpy as np
import pandas as pd
import pyuff
import scipy.io


def same_bits(read, expected, what):
    read = np.ascontiguousarray(read, dtype=np.float64).ravel()
    expected = np.ascontiguousarray(expected, dtype=np.float64).ravel()
    if read.shape != expected.shape:
        sys.exit(f"{what}: {read.shape[0]} values instead of {expected.shape[0]}")
    different = (read.view(np.uint64) != expected.view(np.uint64)) & ~(np.isnan(read) & np.isnan(expected))
    if different.any():
        first = int(np.argmax(different))
        sys.exit(f"{what}, row {first}: {read[first]!r} instead of {expected[first]!r}")


def same_digits(read, expected, digits, what):
    # A number printed with n significant digits has an error of at most half a unit of the last digit.
    read, expected = np.atleast_1d(read), np.atleast_1d(expected)
    if read.shape != expected.shape:
        sys.exit(f"{what}: {read.shape} values instead of {expected.shape}")
    allowed = 0.5 * 10.0 ** (1 - digits) * np.abs(expected) * (1 + 1e-9)
    if (np.abs(read - expected) > allowed).any():
        sys.exit(f"{what}: off by {np.max(np.abs(read - expected))}")


def is_text(column):
    return not (pd.api.types.is_numeric_dtype(column) or pd.api.types.is_bool_dtype(column))


def check_csv(path, table):
    read = pd.read_csv(path, float_precision="round_trip", keep_default_na=False, na_values=["NaN"])
    names = [name.split(" [")[0] for name in read.columns]
    if names != list(table.columns):
        sys.exit(f"{path}: columns {names} instead of {list(table.columns)}")
    for name, column in zip(names, read.columns):
        expected = table[name]
        if is_text(expected):
            if list(read[column].astype(str)) != list(expected.astype(str)):
                sys.exit(f"{path}: {name} differs")
        elif pd.api.types.is_bool_dtype(expected):
            if list(read[column]) != list(expected):
                sys.exit(f"{path}: {name} differs")
        elif expected.dtype == np.float32:
            # CSV has the shortest text of a single-precision value; read as double it rounds to that value.
            same_bits(read[column].to_numpy().astype(np.float32), expected, f"{path}: {name}")
        else:
            same_bits(read[column], expected, f"{path}: {name}")


def parameters(manifest):
    """The parameters of each set-up that an export must have, by set-up."""
    for record in manifest["set_ups"]:
        model = record["model"]
        particle, tmd = model["particle"] or {}, model["tmd"] or {}
        wall = particle.get("wall", {})
        yield {
            "mass_kg": model["structure"]["mass_kg"],
            "stiffness_n_per_m": model["structure"]["stiffness_n_per_m"],
            "particle_mass_kg": particle.get("mass_kg", np.nan),
            "clearance_m": particle.get("clearance_m", np.nan),
            "restitution": wall.get("Restitution", {}).get("coefficient", np.nan),
            "wall_stiffness_n_per_m": wall.get("Voigt", {}).get("stiffness_n_per_m", np.nan),
            "wall_damping_n_s_per_m": wall.get("Voigt", {}).get("damping_n_s_per_m", np.nan),
            "internal_friction": particle.get("friction_coefficient", np.nan),
            "damping_n_s_per_m": model["structure"]["damping_n_s_per_m"],
            "gravity_m_per_s2": model["gravity_m_per_s2"],
            "tuned_stiffness_n_per_m": tmd.get("stiffness_n_per_m", np.nan),
            "tuned_damping_n_s_per_m": tmd.get("damping_n_s_per_m", np.nan),
            "has_unmodelled_damper": record.get("has_unmodelled_damper", False),
            "friction_force_n": (model["friction_damper"] or {}).get("force_n", np.nan),
            "tuned_mass_kg": tmd.get("mass_kg", np.nan),
        }


def check_parameters(read, manifest, what):
    for place, (record, expected) in enumerate(zip(manifest["set_ups"], parameters(manifest))):
        for name, value in expected.items():
            found = np.atleast_1d(read[name])[place]
            if not np.array_equal(found, value, equal_nan=True):
                sys.exit(f"{what}.{name} of {record['name']} is {found} and not {value}")


def check_tables(path, tables, read, values_of, names_of):
    """Compares every column of every table that the run has. `values_of` gives a column as the file has it, `names_of` the
    texts that these values stand for."""
    for word, table in tables.items():
        if table is None:
            if word in read:
                sys.exit(f"{path}: {word} is there though the run has none")
            continue
        for name in table.columns:
            values, expected, what = values_of(word, name), table[name], f"{path}: {word}.{name}"
            if not is_text(expected):
                same_bits(values, expected.astype(np.float64), what)
            elif list(np.atleast_1d(names_of(word, name, values))) != list(expected.astype(str)):
                sys.exit(f"{what} differs")


def check_h5(path, tables, manifest):
    with h5py.File(path) as read:
        facts = {"campaign": manifest["campaign"], "started": manifest["started"], "tick_hz": manifest["device"]["tick_hz"]}
        for name, expected in facts.items():
            found = read.attrs[name]
            if found != expected:
                sys.exit(f"{path}: {name} is {found!r} and not {expected!r}")
        def names(word, name, values):
            if f"{name}_names" not in read[word]:
                return read[word][name].asstr()[()]
            return read[word][f"{name}_names"].asstr()[()][values.astype(int)] if len(values) else []

        check_tables(path, tables, read, lambda word, name: read[word][name][()], names)
        for signal in manifest["signals"]:
            found = read["samples"][signal["name"]].attrs.get("unit", "")
            if found != signal["unit"]:
                sys.exit(f"{path}: unit of {signal['name']} is {found!r}")
        names = list(read["set_ups"]["name"].asstr()[()])
        if names != [record["name"] for record in manifest["set_ups"]]:
            sys.exit(f"{path}: set-ups {names}")
        check_parameters(read["set_ups"], manifest, f"{path}: set_ups")


def check_mat(path, tables, manifest):
    read = scipy.io.loadmat(path, simplify_cells=True)
    if read["run"]["campaign"] != manifest["campaign"] or read["run"]["started"] != manifest["started"]:
        sys.exit(f"{path}: run differs from the manifest")
    if read["run"]["tick_hz"] != manifest["device"]["tick_hz"]:
        sys.exit(f"{path}: tick_hz differs")
    for fact, stated in manifest.get("plan", {}).items():
        if isinstance(stated, str) and fact in read["run"] and read["run"][fact] != stated:
            sys.exit(f"{path}: run.{fact} is {read['run'][fact]!r} and not {stated!r}")
    for field, key in (("set_up_names", "name"), ("set_up_labels", "label")):
        listed = list(np.atleast_1d(read["run"][field]))
        if listed != [record[key] for record in manifest["set_ups"]]:
            sys.exit(f"{path}: run.{field} is {listed}")
    samples = tables["samples"]

    def names(word, name, values):
        if f"{name}_names" not in read[word]:
            return values
        listed = np.atleast_1d(read[word][f"{name}_names"])
        return [listed[int(place) - 1] for place in np.atleast_1d(values)]

    check_tables(path, tables, read, lambda word, name: read[word][name], names)
    for word in tables.keys() & read.keys():
        if set(read["units"][word]) != set(tables[word].columns):
            sys.exit(f"{path}: units of {word}")
    check_parameters(read["run"]["set_ups"], manifest, f"{path}: run.set_ups")
    raw = scipy.io.loadmat(path)["samples"]["t_s"][0, 0]
    if raw.shape != (len(samples), 1) or raw.dtype != np.float64:
        sys.exit(f"{path}: t_s is no column of doubles but {raw.dtype} {raw.shape}")
    for column, words in (("x_over_z", "X/Z (cycle maxima)"), ("x_over_z_lock_in", "X/Z (lock-in)")):
        if words not in read["descriptions"]["results"][column]:
            sys.exit(f"{path}: {column} does not say which ratio it is")
    for signal in manifest["signals"]:
        if read["units"]["samples"][signal["name"]] != signal["unit"]:
            sys.exit(f"{path}: unit of {signal['name']}")


def expected_histories(samples, manifest):
    every = round(manifest["device"]["tick_hz"] / manifest["telemetry_rate_hz"])
    keys = ["set_up", "experiment", "segment", "point_index"]
    new = (samples[keys].astype(str) != samples[keys].astype(str).shift()).any(axis=1)
    new |= samples["tick"].astype(np.int64).diff() != every
    for _, rows in samples.groupby(new.cumsum()):
        for signal in manifest["signals"]:
            yield rows, signal, every / manifest["device"]["tick_hz"]


def check_uff(path, samples, results, manifest):
    file = pyuff.UFF(str(path))
    kinds = list(file.get_set_types())
    if kinds[:2] != [151, 164] or set(kinds[2:]) != {58}:
        sys.exit(f"{path}: datasets {kinds}")
    units = file.read_sets(1)
    if (units["units_code"], units["length"], units["force"], units["temp"]) != (1, 1.0, 1.0, 1.0):
        sys.exit(f"{path}: units {units}")
    functions = [file.read_sets(i) for i in range(2, len(kinds))]
    responses = [f for f in functions if f["func_type"] == 4]
    histories = [f for f in functions if f["func_type"] == 1]
    pairs = list(results.groupby(["set_up", "experiment"], sort=False, observed=True))
    if len(responses) != len(pairs):
        sys.exit(f"{path}: {len(responses)} responses instead of {len(pairs)}")
    for response, ((set_up, experiment), rows) in zip(responses, pairs):
        what = f"{path}: x/z of {set_up}"
        # The format has ASCII alone.
        expected = "".join(c if c.isascii() else "?" for c in f"{set_up}, {experiment}")
        if response["id4"].strip() != expected:
            sys.exit(f"{what}: ID line 4 is {response['id4']!r}")
        if "X/Z (lock-in)" not in response["id5"]:
            sys.exit(f"{what}: ID line 5 does not say which ratio: {response['id5']!r}")
        expected = rows["x_over_z_lock_in"].to_numpy() * np.exp(1j * rows["phase_rad"].astype(np.float64).to_numpy())
        same_digits(response["x"], rows["frequency_hz"].to_numpy(), 6, what)
        # Sine and cosine of two libraries may differ in the last bit, so one digit less is compared.
        same_digits(response["data"].real, expected.real, 11, what)
        same_digits(response["data"].imag, expected.imag, 11, what)
        if (response["rsp_node"], response["ref_node"]) != (1, 2):
            sys.exit(f"{what}: nodes")
    expected = list(expected_histories(samples, manifest))
    if len(histories) != len(expected):
        sys.exit(f"{path}: {len(histories)} histories instead of {len(expected)}")
    for history, (rows, signal, step) in zip(histories, expected):
        first = rows.iloc[0]
        what = f"{path}: {signal['name']} of {first['set_up']} from {first['t_s']} s"
        if history["id1"].strip() != signal["name"] or history["ordinate_axis_units_lab"].strip() != signal["unit"]:
            sys.exit(f"{what}: labels {history['id1']!r}, {history['ordinate_axis_units_lab']!r}")
        if (history["num_pts"], history["abscissa_spacing"]) != (len(rows), 1):
            sys.exit(f"{what}: {history['num_pts']} points instead of {len(rows)}")
        same_digits(history["abscissa_min"], first["t_s"], 6, what)
        same_digits(history["abscissa_inc"], step, 6, what)
        same_digits(history["z_axis_value"], first["point_frequency_hz"], 6, what)
        same_digits(history["data"], rows[signal["name"]].astype(np.float64).to_numpy(), 12, what)
    return len(responses), len(histories)


def main():
    run, csv_samples, csv_results, csv_impacts, mat, h5, uff = map(pathlib.Path, sys.argv[1:])
    manifest = json.loads((run / "manifest.json").read_text())
    samples = pd.read_parquet(run / "samples.parquet")
    results = pd.read_parquet(run / "results.parquet")
    check_csv(csv_samples, samples)
    check_csv(csv_results, results)
    optional = {word: run / f"{word}.parquet" for word in ("transients", "impacts")}
    tables = {"samples": samples, "results": results}
    tables |= {word: pd.read_parquet(path) if path.exists() else None for word, path in optional.items()}
    if tables["impacts"] is not None:
        check_csv(csv_impacts, tables["impacts"])
    check_mat(mat, tables, manifest)
    check_h5(h5, tables, manifest)
    responses, histories = check_uff(uff, samples, results, manifest)
    impacts = 0 if tables["impacts"] is None else len(tables["impacts"])
    print(
        f"the same: {len(samples)} samples, {len(results)} points, {impacts} impacts, {responses} responses, "
        f"{histories} histories"
    )


main()
