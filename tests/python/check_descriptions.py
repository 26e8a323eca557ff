"""Reads what the Parquet files and figures of a run folder say of themselves, without its manifest.

    check_descriptions.py RUN

Every Parquet file must state run, campaign, start, program, what a row is, and the parameters of the set-ups; every column its unit
and meaning. The start must be a time for `datetime` and pandas. Every figure must name the run and its start.
"""

import datetime
import json
import pathlib
import re
import sys
import zlib

import pandas as pd
import pyarrow.parquet as pq


def check_parquet(path, run, manifest):
    schema, plain = pq.read_schema(path), pq.read_metadata(path).metadata
    about = {key.decode(): text.decode() for key, text in schema.metadata.items()}
    for key, text in about.items():
        # A reader without Arrow has the metadata of the file alone.
        if plain.get(key.encode()) != text.encode():
            sys.exit(f"{path}: {key} is not in the metadata of the file")
    expected = {"damprig.run": run.name, "damprig.campaign": manifest["campaign"], "damprig.version": manifest["damprig"]}
    for key, text in expected.items():
        if about.get(key) != text:
            sys.exit(f"{path}: {key} is {about.get(key)!r} and not {text!r}")
    if not about.get("damprig.description", "").startswith("a row for each"):
        sys.exit(f"{path}: it does not say what a row is: {about.get('damprig.description')!r}")
    started = about["damprig.started"]
    if datetime.datetime.fromisoformat(started) != pd.Timestamp(started).to_pydatetime():
        sys.exit(f"{path}: started {started!r}")
    set_ups = json.loads(about["damprig.set_ups"])
    for found, record in zip(set_ups, manifest["set_ups"], strict=True):
        model = record["model"]
        structure, particle = model["structure"], model["particle"]
        parameters = {"name": record["name"], "label": record["label"], "base_amplitude_m": record["base_amplitude_m"]}
        parameters |= {"mass_kg": structure["mass_kg"], "stiffness_n_per_m": structure["stiffness_n_per_m"]}
        if particle:
            parameters |= {"clearance_m": particle["clearance_m"], "particle_mass_kg": particle["mass_kg"]}
            parameters |= {"mass_ratio": particle["mass_kg"] / structure["mass_kg"]}
            parameters |= {"restitution": particle["wall"]["Restitution"]["coefficient"]}
        for name, value in parameters.items():
            if found.get(name) != value:
                sys.exit(f"{path}: {name} of {record['name']} is {found.get(name)!r} and not {value!r}")
        natural = (structure["stiffness_n_per_m"] / structure["mass_kg"]) ** 0.5 / 6.283185307179586
        if abs(found["natural_frequency_hz"] / natural - 1) > 1e-12:
            sys.exit(f"{path}: natural_frequency_hz of {record['name']} is {found['natural_frequency_hz']}")
    for field in schema:
        said = field.metadata or {}
        if b"unit" not in said or not said.get(b"description"):
            sys.exit(f"{path}: column {field.name} has no unit or no description: {said}")


def chunks(png):
    at = 8
    while at < len(png):
        length, kind = int.from_bytes(png[at : at + 4]), png[at + 4 : at + 8]
        content = png[at + 8 : at + 8 + length]
        if int.from_bytes(png[at + 8 + length : at + 12 + length]) != zlib.crc32(kind + content):
            sys.exit(f"the chunk {kind} has a wrong sum")
        yield kind, content
        at += 12 + length


def check_figure(path, run, manifest):
    expected = f"{run.name} · {manifest['started'][:16].replace('T', ' ')} {manifest['started'][-6:]}"
    if path.suffix == ".png":
        said = [content.split(b"\0\0\0\0\0")[1].decode() for kind, content in chunks(path.read_bytes()) if kind == b"iTXt"]
    else:
        text = path.read_text()
        said = re.findall("<metadata>(.*?)</metadata>", text)
        if expected not in re.sub("<metadata>.*?</metadata>", "", text):
            sys.exit(f"{path}: {expected!r} is not shown in it")
    if said != [f"{expected} · {manifest['damprig']}"]:
        sys.exit(f"{path}: says {said}")


def main():
    run = pathlib.Path(sys.argv[1]).resolve()
    manifest = json.loads((run / "manifest.json").read_text())
    times = [manifest["started"], *(segment["started"] for segment in manifest["segments"])]
    entries = [json.loads(line) for line in (run / "journal.jsonl").read_text().splitlines()]
    times += [entry["at"] for entry in entries if "at" in entry]
    for time in times:
        if datetime.datetime.fromisoformat(time) != pd.Timestamp(time).to_pydatetime():
            sys.exit(f"the time {time!r}")
    tables = sorted(run.glob("**/*.parquet"))
    figures = sorted([*run.glob("*.svg"), *run.glob("*.png")])
    for path in tables:
        check_parquet(path, run, manifest)
    for path in figures:
        check_figure(path, run, manifest)
    print(f"{len(times)} times, {len(tables)} tables and {len(figures)} figures describe themselves")


main()
