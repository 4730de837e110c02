"""What a decision says: a table for the terminal, Markdown for a pull request, JSON, JUnit XML."""

import json
import math
from collections import Counter
from xml.etree import ElementTree

from .. import results
from .decision import FAIL, INCONCLUSIVE, PASS

FORMAT = 1  # of check.json
_WORST_FIRST = {FAIL: 0, INCONCLUSIVE: 1, PASS: 2}
_SHOWN = 20  # rows of a table


def percent(log_ratio):
    """A log-ratio as "+3.2 %"; nothing for what is infinite."""
    if log_ratio is None or not math.isfinite(log_ratio):
        return "-"
    return f"{100 * math.expm1(log_ratio):+.1f} %"


def time_rows(ratios, look, tolerances):
    """One dictionary a comparison, the worst first: those that fail, then the undecided, slower ones before faster
    ones. The slowdown is B's time over A's, minus 1."""
    rows = []
    for i, c in enumerate(ratios.comparisons):
        decided = look is not None
        rows.append({
            "name": c.name, "scene": c.scene, "structure": c.spec, "ray_set": c.ray_set, "order": c.order,
            "query": c.query, "threads": c.threads, "tolerance": float(tolerances[i]),
            "verdict": str(look.verdicts[i]) if decided else INCONCLUSIVE,
            "log_ratio": float(look.median[i]) if decided else None,
            "lo": float(look.lo[i]) if decided else None,
            "hi": float(look.hi[i]) if decided else None,
        })  # fmt: skip
    return sorted(rows, key=lambda row: (_WORST_FIRST[row["verdict"]], -(row["log_ratio"] or 0), row["name"]))


def _difference_row(d):
    change = d.change
    return [
        d.comparison.name, d.figure, "-" if d.old is None else str(d.old), "-" if d.new is None else str(d.new),
        "" if change is None else f"{100 * change:+.3g} %",
    ]  # fmt: skip


def _exact_rows(differences):
    """Figures that differ, the worst first; then cases that only one side has, a row for each structure of a scene."""
    both = [d for d in differences if d.figure != "case"]
    rows = [_difference_row(d) for d in sorted(both, key=lambda d: (d.change is not None, -abs(d.change or 0)))]
    one_side = Counter((d.comparison.scene, d.comparison.spec, d.old, d.new) for d in differences if d.figure == "case")
    for (scene, spec, old, new), cases in one_side.items():
        rows.append([f"{scene} / {spec}", "case" if cases == 1 else f"{cases} cases", old or "-", new or "-", ""])
    return rows


def _time_cells(rows):
    return [
        [r["verdict"], r["name"], percent(r["log_ratio"]), f"{percent(r['lo'])} to {percent(r['hi'])}",
         f"{100 * r['tolerance']:g} %"]
        for r in rows
    ]  # fmt: skip


_TIME_HEADER = ["verdict", "comparison", "slower by", "95 % interval", "allowed"]
_EXACT_HEADER = ["case", "figure", "was", "is", "change"]


def _grid(header, rows):
    table = [header, *rows]
    widths = [max(len(row[i]) for row in table) for i in range(len(header))]
    return ["  ".join(cell.ljust(width) for cell, width in zip(row, widths)).rstrip() for row in table]


def _markdown_table(header, rows):
    escaped = [[cell.replace("|", "\\|") for cell in row] for row in rows]
    return ["| " + " | ".join(row) + " |" for row in [header, ["---"] * len(header), *escaped]]


def _headline(check):
    parts = []
    exact, times = check["exact"], check["time"]
    if exact["differences"]:
        parts.append(f"{len(exact['differences'])} exact figures differ in {exact['cases']} cases")
    else:
        parts.append(f"exact figures of {exact['cases']} cases are the same")
    if times["comparisons"]:
        counts = {v: sum(r["verdict"] == v for r in times["comparisons"]) for v in (FAIL, INCONCLUSIVE, PASS)}
        parts.append(
            f"times of {times['pairs']} {times['unit']}: {counts[FAIL]} slower, {counts[INCONCLUSIVE]} undecided, "
            f"{counts[PASS]} within tolerance"
        )
    return f"{check['verdict']}: " + "; ".join(parts)


def _lines(check, differences, table, shown):
    lines = []
    worst = _exact_rows(differences)
    if worst:
        lines += [*table(_EXACT_HEADER, worst[:shown]), ""]
        if len(worst) > shown:
            lines += [f"and {len(worst) - shown} more: --out DIR writes all to check.json", ""]
    rows = check["time"]["comparisons"]
    if any(row["log_ratio"] is not None for row in rows):
        cells = _time_cells(rows)
        lines += [*table(_TIME_HEADER, cells[:shown]), ""]
        if len(cells) > shown:
            lines += [f"and {len(cells) - shown} more, none worse: --out DIR writes all to check.json", ""]
    return lines


def text(check, differences):
    """For the terminal."""
    lines = _lines(check, differences, _grid, _SHOWN)
    lines += [f"note: {note}" for note in check["notes"]]
    return "\n".join([*lines, _headline(check)]) + "\n"


def markdown(check, differences):
    """For a comment on a pull request."""
    lines = [f"### raybench check: {_headline(check)}", ""]
    lines += _lines(check, differences, _markdown_table, _SHOWN)
    lines += [f"- {note}" for note in check["notes"]]
    return "\n".join(lines).rstrip() + "\n"


def junit(check, differences):
    """One test case for the exact part and one for each comparison; an undecided one is skipped, with a message."""
    rows = check["time"]["comparisons"]
    failures = int(bool(differences)) + sum(r["verdict"] == FAIL for r in rows)
    skipped = sum(r["verdict"] == INCONCLUSIVE for r in rows)
    suites = ElementTree.Element("testsuites", name="raybench check")
    suite = ElementTree.SubElement(
        suites, "testsuite", name="raybench check", tests=str(1 + len(rows)), failures=str(failures),
        skipped=str(skipped), errors="0", time=f"{check['seconds']:.3f}",
    )  # fmt: skip
    exact = ElementTree.SubElement(suite, "testcase", classname="exact", name="figures")
    if differences:
        found = ElementTree.SubElement(exact, "failure", message=f"{len(differences)} figures differ", type="exact")
        found.text = "\n".join("  ".join(row) for row in _exact_rows(differences)[:100])
    for r in rows:
        case = ElementTree.SubElement(suite, "testcase", classname="time", name=r["name"])
        said = f"slower by {percent(r['log_ratio'])} ({percent(r['lo'])} to {percent(r['hi'])}), allowed {100 * r['tolerance']:g} %"
        if r["verdict"] == FAIL:
            ElementTree.SubElement(case, "failure", message=said, type="time")
        elif r["verdict"] == INCONCLUSIVE:
            ElementTree.SubElement(case, "skipped", message="undecided: " + said)
    ElementTree.indent(suites)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(suites, encoding="unicode") + "\n"


def write(folder, check, differences):
    """check.json, check.md and junit.xml, each through a temporary file."""
    folder.mkdir(parents=True, exist_ok=True)
    whole = {"format": FORMAT, **check}
    for name, content in (
        ("check.json", json.dumps(whole, indent=1, ensure_ascii=False) + "\n"),
        ("check.md", markdown(check, differences)),
        ("junit.xml", junit(check, differences)),
    ):
        results.write_atomically(folder / name, lambda temporary, c=content: temporary.write_text(c, encoding="utf-8"))
