"""Writes the list of components (SBOM, CycloneDX 1.5 JSON) of the packages and checks it against the lock files.

    sbom.py VERSION FILE          writes
    sbom.py --check FILE          checks: each component is in a lock file with the same checksum, and none is missing
"""

import json
import sys
from pathlib import Path

from crates import COMMAND, FIRMWARE, linked, locked


def reference(package):
    return f"pkg:cargo/{package['name']}@{package['version']}"


def components():
    """All components by reference, with what each depends on."""
    found, needs = {}, {}
    for shipped in (COMMAND, FIRMWARE):
        checksums = locked(shipped)
        packages, graph = linked(shipped, with_build=True)
        for identifier, package in packages.items():
            one = {
                "type": "library",
                "bom-ref": reference(package),
                "name": package["name"],
                "version": package["version"],
                "purl": reference(package),
            }
            if package["license"]:
                one["licenses"] = [{"expression": package["license"].replace("/", " OR ")}]
            checksum = checksums[(package["name"], package["version"])]
            if checksum:
                one["hashes"] = [{"alg": "SHA-256", "content": checksum}]
            found[reference(package)] = one
            needs.setdefault(reference(package), set()).update(reference(packages[it]) for it in graph[identifier])
    return found, needs


def write(version, out):
    found, needs = components()
    bom = {
        "bomFormat": "CycloneDX",
        "specVersion": "1.5",
        "version": 1,
        "metadata": {"component": {"type": "application", "bom-ref": "damprig", "name": "damprig", "version": version}},
        "components": [found[name] for name in sorted(found)],
        "dependencies": [{"ref": name, "dependsOn": sorted(needs[name])} for name in sorted(needs)],
    }
    Path(out).write_text(json.dumps(bom, indent=1) + "\n", encoding="utf-8")
    print(f"{len(found)} components")


def check(file):
    bom = json.loads(Path(file).read_text(encoding="utf-8"))
    checksums = locked(COMMAND) | locked(FIRMWARE)
    wrong = []
    for one in bom["components"]:
        key = (one["name"], one["version"])
        stated = next((it["content"] for it in one.get("hashes", [])), None)
        if key not in checksums:
            wrong.append(f"{key} is in no lock file")
        elif checksums[key] != stated:
            wrong.append(f"{key}: checksum {stated}, in the lock file {checksums[key]}")
    listed = {one["bom-ref"] for one in bom["components"]}
    wrong += [f"{name} is missing" for name in components()[0] if name not in listed]
    wrong += [f"{need} is needed and not listed" for one in bom["dependencies"] for need in one["dependsOn"] if need not in listed]
    if wrong:
        raise SystemExit("\n".join(wrong))
    print(f"{len(listed)} components agree with the lock files")


if __name__ == "__main__":
    if sys.argv[1] == "--check":
        check(sys.argv[2])
    else:
        write(sys.argv[1], sys.argv[2])
