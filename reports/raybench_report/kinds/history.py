"""Stores of `raybench history add`."""

from dataclasses import dataclass
from pathlib import Path

from ..charts import trend as charts
from ..results import rays_label
from . import NEUTRAL, Kind, Section, Table


@dataclass
class History:
    """A store: {fingerprint of a machine: its entries, the oldest first}."""

    directory: Path
    machines: dict
    shown: str = ""


def read(directory):
    """Reads DIR/*/*.json. Throws RunError."""
    from ..decide import history

    return History(directory, history.read(directory))


def sections(report, folders):
    """A section for each machine of each store, for times of two machines have nothing in common."""
    from ..decide import trend  # takes a while to import

    found = []
    for folder in folders:
        for fingerprint, entries in folder.machines.items():
            cases = trend.cases(entries)
            found.append(_section(folder, fingerprint, entries, cases, trend.FEWEST, len(found)))
    return found


def _section(folder, fingerprint, entries, cases, fewest, at):
    rows, changed = charts.table(entries, cases), charts.changes(entries, cases)
    machine = f"{entries[-1].get('cpu') or 'unknown processor'} ({fingerprint})"
    heads = ["change", "structure", "scene", "rays", "threads", "at commit", "of"]
    listed = [
        [f"{100 * share:+.1f} %", spec, scene, rays_label(ray_set, order, query), threads, entry["commit"][:12], entry["started"]]
        for (scene, spec, ray_set, order, query, threads), share, entry in changed
    ]  # fmt: skip
    tables = [Table(f"changes_{at}", "Changes of level, the largest first", heads, listed)] if listed else []
    answer = f"{len(entries)} run{'s' if len(entries) > 1 else ''}, "
    if len(entries) < fewest:
        answer += f"fewer than {fewest}, so no change can be told from noise."
    elif not changed:
        answer += f"none of {len(cases)} cases changed its level."
    else:
        share, entry = changed[0][1:]
        count = len({change[0] for change in changed})
        answer += f"{count} of {len(cases)} cases changed level, most by {100 * share:+.1f} % at `{entry['commit'][:12]}` ({entry['started']})."
    name = f"history_{at}" if at else "history"
    title = f"History of {folder.shown} on {machine}"
    return Section(name, title, "History", [], charts.charts(rows, f"trend_{at}"), tables, answer=(NEUTRAL, answer))


KIND = Kind("history", "*/????-??-??T*.json", "raybench history add", read, sections)
