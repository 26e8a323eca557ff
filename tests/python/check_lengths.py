"""Reads exports of runs of many lengths and compares every value with the run's samples.

    check_lengths.py LIST

Each line of LIST: a run, its HDF5 export, its .mat export. The HDF5 files are read with h5py and with PyTables, whose HDF5 libraries
are of different versions. Exits with a message at the first difference.
"""

import pathlib
import sys

import h5py
import numpy as np
import pandas as pd
import scipy.io
import tables


def same(read, expected, what):
    read, expected = np.atleast_1d(read), np.asarray(expected)
    if read.shape != expected.shape:
        sys.exit(f"{what}: {read.shape} values instead of {expected.shape}")
    if not np.array_equal(read.astype(np.float64).view(np.uint64), expected.astype(np.float64).view(np.uint64)):
        sys.exit(f"{what} differs")


def names(places, listed, first):
    return [listed[int(place) - first] for place in np.atleast_1d(places)]


def main():
    if tables.hdf5_version == h5py.version.hdf5_version:
        sys.exit(f"both readers have HDF5 {tables.hdf5_version}: they count as one")
    lengths = []
    for line in pathlib.Path(sys.argv[1]).read_text().splitlines():
        run, h5, mat = line.split("\t")
        samples = pd.read_parquet(pathlib.Path(run) / "samples.parquet")
        lengths.append(len(samples))
        struct = scipy.io.loadmat(mat, simplify_cells=True)["samples"]
        with h5py.File(h5) as one, tables.open_file(h5) as other:
            for name in samples.columns:
                what, expected = f"{name} of {len(samples)} rows", samples[name]
                read = one["samples"][name][()]
                same(other.get_node(f"/samples/{name}").read(), read, f"PyTables and h5py: {what}")
                if name not in ("set_up", "experiment"):
                    same(read, expected, f"{h5}: {what}")
                    same(struct[name], expected, f"{mat}: {what}")
                    continue
                listed = one["samples"][f"{name}_names"].asstr()[()]
                if names(read, listed, 0) != list(expected):
                    sys.exit(f"{h5}: {what} differs")
                if names(struct[name], np.atleast_1d(struct[f"{name}_names"]), 1) != list(expected):
                    sys.exit(f"{mat}: {what} differs")
    print(f"every value of {lengths} rows is the same")


main()
