"""Folders of `raybench check`."""

import math
from dataclasses import dataclass
from pathlib import Path

from ..charts import checks
from ..results import RunError, read_json
from . import BAD, GOOD, NEUTRAL, Kind, Section, Table

FORMAT = 1  # of check.json, as decide/output.py writes it
COLOURS = {"pass": GOOD, "fail": BAD, "inconclusive": NEUTRAL}


@dataclass
class Check:
    """What `raybench check --out DIR` wrote. `info`: check.json, with the machine and build of the first side's last run
    where that is there."""

    directory: Path
    info: dict
    shown: str = ""


def read(directory):
    """Reads DIR/check.json. Throws RunError."""
    path = directory / "check.json"
    info = read_json(path)
    if info.get("format") != FORMAT:
        raise RunError(f"{path}: format {info.get('format', 'unknown')}; this raybench reads {FORMAT}")
    try:
        info["exact"]["differences"], info["time"]["comparisons"], info["exact"]["cases"], info["time"]["pairs"]
        if info["verdict"] not in COLOURS:
            raise KeyError(info["verdict"])
    except (KeyError, TypeError) as error:
        raise RunError(f"{path}: not what `raybench check` wrote: {error}") from None
    side = directory / "A" / "run.json"
    if side.is_file():
        run = read_json(side)  # its command line is one pair's, with a temporary folder
        info |= {name: run[name] for name in ("machine", "build", "libraries") if name in run}
    return Check(directory, info)


def sections(report, folders):
    """A section for each folder: the verdict, the worst comparisons, what differs."""
    return [_section(folder, at, len(folders) > 1) for at, folder in enumerate(folders)]


def _section(folder, at, several):
    info, tables, charts = folder.info, [], []
    # the largest changes first, cases that only one side has last
    if differences := sorted(
        info["exact"]["differences"], key=lambda d: (d["figure"] == "case", -abs(d["change"] or 1e9))
    ):
        heads = ["case", "figure", "was", "is", "change"]
        rows = [[d["case"], d["figure"], d["old"], d["new"], _change(d["change"])] for d in differences]
        tables.append(Table(f"check_exact_{at}", "Exact figures that differ", heads, rows))
    if info["time"]["comparisons"]:
        found = checks.table(info["time"]["comparisons"])
        charts = checks.charts(found, at)
        heads = ["verdict", "scene", "structure", "rays", "threads", "slower by, %", "from", "to", "allowed, %"]
        rows = [
            [r.verdict.upper() if r.verdict == "fail" else r.verdict, r.label, r.spec, r.rays_label, r.threads,
             *(_rounded(v) for v in (r.slower, r.lo, r.hi, r.allowed))]
            for r in found.itertuples()
        ]  # fmt: skip
        tables.insert(0, Table(f"check_times_{at}", "Times, the worst first", heads, rows))
    says = [f"{side}: `{command}`" for side, command in zip("AB", info.get("commands", []))]
    says += [str(note) for note in info.get("notes") or []]
    title = f"Check: slower, or different? ({folder.shown})" if several else "Check: slower, or different?"
    name = f"check_{at}" if at else "check"
    return Section(name, title, "Check", says, charts, tables, answer=(COLOURS[info["verdict"]], _answer(info)))


def _answer(info):
    """The verdict and what it rests on."""
    exact, times = info["exact"], info["time"]
    differ = len(exact["differences"])
    said = f"{info['verdict']}. "
    said += (
        f"{differ:,} exact figures differ in"
        if differ > 1
        else "One exact figure differs in"
        if differ
        else "All exact figures are the same in"
    )
    said += f" {exact['cases']:,} cases"
    if not times["comparisons"]:
        return f"{said}; no times were compared."
    count = {v: sum(row["verdict"] == v for row in times["comparisons"]) for v in COLOURS}
    said += f"; of {len(times['comparisons']):,} times, over {times['pairs']:,} {times.get('unit', 'pairs')}, "
    said += (
        f"{count['fail']:,} are slower than allowed, {count['pass']:,} are not, {count['inconclusive']:,} are undecided"
    )
    worst = times["comparisons"][0]
    if worst["log_ratio"] is None:
        return said + "."
    value, lo, hi = (_percent(worst[name]) for name in ("log_ratio", "lo", "hi"))
    return f"{said}. The worst: `{worst['name']}`, {value} [{lo}, {hi}]."


def _percent(log_ratio):
    return "–" if log_ratio is None or not math.isfinite(log_ratio) else f"{100 * math.expm1(log_ratio):+.2f} %"


def _change(change):
    return "" if change is None else f"{100 * change:+.3g} %"


def _rounded(value):
    """To a hundredth of a percent; None where nothing is known."""
    return round(value, 2) if math.isfinite(value) else None


KIND = Kind("check", "check.json", "raybench check", read, sections)
