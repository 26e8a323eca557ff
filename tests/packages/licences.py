"""Writes the licences of everything that the packages contain: one text file, each text once with the crates that it is for.

    licences.py FILE
"""

import sys
from collections import defaultdict
from pathlib import Path

from crates import COMMAND, FIRMWARE, PROJECT, linked

PREFIXES = ("licence", "license", "copying", "notice", "unlicense", "copyright")


def texts(package):
    """The licence texts in a crate's source."""
    folder = Path(package["manifest_path"]).parent
    found = [file for file in sorted(folder.iterdir()) if file.name.lower().startswith(PREFIXES) and file.is_file()]
    for sub in sorted(folder.iterdir()):
        if sub.is_dir() and sub.name.lower() in ("licenses", "licences", "license", "licence"):
            found += [file for file in sorted(sub.rglob("*")) if file.is_file()]
    return [file.read_text(encoding="utf-8", errors="replace").strip() for file in found]


def main(out):
    crates = {}
    for shipped in (COMMAND, FIRMWARE):
        for package in linked(shipped)[0].values():
            if package["source"] is not None:
                crates[(package["name"], package["version"])] = package
    unstated = [name for (name, _), package in crates.items() if not package["license"] and not package["license_file"]]
    if unstated:
        raise SystemExit(f"no licence is stated by: {', '.join(unstated)}")
    of_text, without = defaultdict(list), []
    for (name, version), package in sorted(crates.items()):
        found = texts(package)
        for text in found:
            of_text[text].append(f"{name} {version}")
        if not found:
            without.append(f"{name} {version}: {package['license']}; {package['repository'] or 'no repository stated'}")
    font = (PROJECT / "host/fonts/DejaVuSans-LICENSE.txt").read_text(encoding="utf-8").strip()
    of_text[font].append("the font DejaVu Sans, in figures")
    lines = ["Licences of the software in damprig: the command, the Python package and the firmware.", ""]
    for (name, version), package in sorted(crates.items()):
        lines.append(f"{name} {version}: {package['license'] or 'see its text'}   https://crates.io/crates/{name}/{version}")
    if without:
        lines += ["", "Crates whose source has no licence text of its own; the licence that they state:", *without]
    for text, names in of_text.items():
        lines += ["", "=" * 100, ", ".join(names), "-" * 100, text]
    Path(out).write_text("\n".join(lines) + "\n", encoding="utf-8")
    print(f"{len(crates)} crates, {len(of_text)} texts, {len(without)} crates without one")


if __name__ == "__main__":
    main(sys.argv[1])
