"""The crates that are in a package: what `cargo metadata` resolves for its target, without development dependencies."""

import json
import subprocess
import tomllib
from pathlib import Path

PROJECT = Path(__file__).resolve().parents[2]

# Manifest and target of what is shipped, and the crates of the project in it.
COMMAND = ("Cargo.toml", "x86_64-unknown-linux-gnu", ("damprig", "damprig-python"), ())
FIRMWARE = ("firmware/Cargo.toml", "thumbv7em-none-eabihf", ("damprig-firmware",), ("board-nucleo-g474re",))


def linked(shipped, with_build=False):
    """Crates of `shipped` (COMMAND, FIRMWARE) by their identifier; with `with_build` also those that only the build runs.

    Gives the packages of `cargo metadata` and, for each, the identifiers of its dependencies.
    """
    manifest, target, roots, features = shipped
    command = ["cargo", "metadata", "--locked", "--format-version", "1", "--filter-platform", target]
    command += ["--manifest-path", str(PROJECT / manifest)]
    if features:
        command += ["--features", ",".join(features)]
    answer = json.loads(subprocess.run(command, check=True, capture_output=True).stdout)
    packages = {package["id"]: package for package in answer["packages"]}
    nodes = {node["id"]: node for node in answer["resolve"]["nodes"]}
    kinds = {None, "build"} if with_build else {None}

    def dependencies(of):
        found = []
        for dependency in nodes[of]["deps"]:
            is_kind = any(kind["kind"] in kinds for kind in dependency["dep_kinds"])
            is_macro = any("proc-macro" in target["kind"] for target in packages[dependency["pkg"]]["targets"])
            if is_kind and (with_build or not is_macro):
                found.append(dependency["pkg"])
        return found

    waiting = [identifier for identifier, package in packages.items() if package["name"] in roots]
    if len(waiting) != len(roots):
        raise SystemExit(f"{manifest}: it has not all of {', '.join(roots)}")
    graph = {}
    while waiting:
        identifier = waiting.pop()
        if identifier not in graph:
            graph[identifier] = dependencies(identifier)
            waiting += graph[identifier]
    return {identifier: packages[identifier] for identifier in graph}, graph


def locked(shipped):
    """SHA-256 of every crate from a registry in the lock file of `shipped`, by name and version."""
    lock = tomllib.loads((PROJECT / shipped[0]).with_name("Cargo.lock").read_text(encoding="utf-8"))
    return {(package["name"], package["version"]): package.get("checksum") for package in lock["package"]}
