"""Folders of `raybench fuzz` and `raybench check-plugin`."""

from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

from ..results import RunError, read_json
from . import BAD, GOOD, Kind, Section, Table


@dataclass
class Findings:
    """What `raybench fuzz --out DIR` or `check-plugin --out DIR` wrote. `promises`: (structure, promise, outcome) of a
    check-plugin."""

    directory: Path
    info: dict
    promises: list
    shown: str = ""


def read(directory):
    """Reads DIR/fuzz.json and, where it is there, junit.xml. Throws RunError."""
    path, junit, promises = directory / "fuzz.json", directory / "junit.xml", []
    info = read_json(path)
    for key in ("structures", "findings"):
        if not isinstance(info.get(key), list):
            raise RunError(f"{path}: no list '{key}'")
    if junit.is_file():
        try:
            cases = ElementTree.parse(junit).getroot().iter("testcase")
        except ElementTree.ParseError as error:
            raise RunError(f"{junit}: not XML: {error}") from None
        for case in cases:
            outcome = (
                "BROKEN"
                if case.find("failure") is not None
                else "not asked"
                if case.find("skipped") is not None
                else "held"
            )
            promises.append((case.get("classname"), case.get("name"), outcome))
    return Findings(directory, info, promises)


def sections(report, folders):
    """A section for each folder: broken promises first."""
    found = []
    for at, folder in enumerate(folders):
        info, broken = folder.info, folder.info["findings"]
        cases = sum(s.get("cases", 0) for s in info["structures"])
        kind = "Contract of a plugin" if folder.promises else "Fuzzing"
        lost = f"{len(broken)} promises were broken." if broken else "no promise was broken."
        answer = (
            BAD if broken else GOOD,
            f"{cases:,} random cases with seed {info.get('seed')} in {info.get('seconds', 0):.3g} s over {len(info['structures'])} structures: {lost}",
        )
        tables = []
        if broken:
            rows = [
                [f.get("structure"), f.get("check"), f.get("what"), f.get("primitives"), f.get("rays"), f.get("file")]
                for f in broken
            ]
            tables.append(
                Table(
                    f"findings_{at}",
                    "Broken promises",
                    ["structure", "promise", "what", "primitives", "rays", "case file"],
                    rows,
                )
            )
        if folder.promises:
            tables.append(
                Table(
                    f"promises_{at}",
                    "Every promise",
                    ["structure", "promise", "outcome"],
                    [list(p) for p in folder.promises],
                )
            )
        rows = [[s.get("structure"), s.get("cases"), s.get("rays"), s.get("left_out")] for s in info["structures"]]
        tables.append(Table(f"fuzzed_{at}", "Structures", ["structure", "cases", "rays", "left out"], rows))
        name, title = f"fuzz_{at}" if at else "fuzz", f"{kind}: {folder.shown}"
        found.append(Section(name, title, kind.split()[0], [], [], tables, answer=answer))
    return found


KIND = Kind("fuzz", "fuzz.json", "raybench fuzz or check-plugin", read, sections)
