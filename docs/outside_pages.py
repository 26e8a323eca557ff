#!/usr/bin/env python3
"""Preprocessor of mdBook: adds the project's pages that lie outside of docs, and the files that pages link to.

Links that leave docs would lead nowhere in an installed book. Pages (Markdown) and files (TOML, notebooks) that they lead to become
chapters at the end of the book, under project/; links between all of them are rewritten. Other links of the added chapters that leave
the book become plain text.
"""

import json
import posixpath
import re
import sys
from pathlib import Path

TOP = Path(__file__).resolve().parent.parent
PAGES = ["firmware/README.md", "CONTRIBUTING.md", "CHANGELOG.md"]
LINK = re.compile(r"(?<!!)\[([^\]]*)\]\(([^)\s]+)\)")


def chapter_path(file):
    """Path in the book of a file of the project (relative to its top)."""
    if file.startswith("docs/"):
        return file.removeprefix("docs/")
    name = file.removesuffix("/README.md").removesuffix(".md")
    return f"project/{name}.md"


def rewrite(text, file, wanted):
    """Text of a file with links into the book. Files outside of docs that it links to are added to `wanted`, if that is not None."""
    at = posixpath.dirname(chapter_path(file))

    def link(match):
        name, target = match.groups()
        target, _, anchor = target.partition("#")
        if not target or "://" in target:
            return match.group(0)
        target = posixpath.normpath(posixpath.join(posixpath.dirname(file), target))
        if not target.startswith("docs/") and target not in PAGES:
            if wanted is None or not (TOP / target).is_file():
                return name
            wanted[target] = None
        place = posixpath.relpath(chapter_path(target), at or ".")
        return f"[{name}]({place}{'#' + anchor if anchor else ''})"

    # Links in code are text.
    parts = re.split(r"(^```.*?^```|`[^`\n]*`)", text, flags=re.DOTALL | re.MULTILINE)
    return "".join(part if place % 2 else LINK.sub(link, part) for place, part in enumerate(parts))


def new_chapter(file, parents):
    """A chapter of a file outside of docs."""
    text = (TOP / file).read_text()
    if not file.endswith(".md"):
        text = f"# {file}\n```{Path(file).suffix[1:]}\n{text.rstrip()}\n```\n"
    title = next(line.removeprefix("# ") for line in text.splitlines() if line.startswith("# "))
    path = chapter_path(file)
    return {
        "name": title, "content": rewrite(text, file, None), "number": None, "sub_items": [],
        "path": path, "source_path": None, "parent_names": parents,
    }


def chapters(items):
    """All chapters below some items."""
    for item in items:
        if isinstance(item, dict) and "Chapter" in item:
            yield item["Chapter"]
            yield from chapters(item["Chapter"]["sub_items"])


def main():
    if len(sys.argv) > 1:  # supports RENDERER: all
        return
    _, book = json.load(sys.stdin)
    wanted = {}
    for chapter in chapters(book["items"]):
        if chapter.get("path"):
            # The start page is README.md; mdBook may have renamed it already.
            source = chapter.get("source_path") or chapter["path"]
            chapter["content"] = rewrite(chapter["content"], f"docs/{source}", wanted)
    book["items"] += [{"Chapter": new_chapter(file, [])} for file in PAGES]
    others = [{"Chapter": new_chapter(file, ["Files"])} for file in wanted]
    if others:
        files = {"name": "Files", "content": "# Files\nFiles of the project that this manual names.\n", "number": None,
                 "sub_items": others, "path": "project/files.md", "source_path": None, "parent_names": []}
        book["items"].append({"Chapter": files})
    json.dump(book, sys.stdout)


main()
