"""A page that draws each case of a history over time, with its change points."""

import base64
import html
import io

import numpy as np
import ruptures

from .. import results

FEWEST = 6  # runs before a change can be told
_SHORTEST = 3  # runs of a segment
_SHOWN = 60  # figures on the page: those that changed most


def series_of(entries):
    """{case: (indices of entries, ns, ratios to the anchor)}; ratios are NaN where there is no anchor."""
    found = {}
    for index, entry in enumerate(entries):
        for row in entry["cases"]:
            ratio = row["ns"] / row["anchor_ns"] if row.get("anchor_ns") else float("nan")
            indices, ns, ratios = found.setdefault(tuple(row["case"]), ([], [], []))
            indices.append(index)
            ns.append(row["ns"])
            ratios.append(ratio)
    return {case: (np.array(i), np.array(ns), np.array(r)) for case, (i, ns, r) in found.items()}


def change_points(values):
    """Indices at which the level of log(values) changes, ascending.

    PELT (Killick, Fearnhead, Eckley 2012) with the cost of absolute deviations, which single outliers do not move; the
    penalty is that of BIC, 2 log n for the level and the place of a change, in units of the deviation from one run to
    the next, so that a trend with noise alone has no change points.
    """
    logs = np.log(np.asarray(values, dtype=float))
    n = len(logs)
    if n < FEWEST:
        return []
    step = np.median(np.abs(np.diff(logs))) / np.sqrt(2)  # mean absolute deviation, nearly, whatever the levels
    if step == 0:
        step = max(float(np.mean(np.abs(np.diff(logs)))) / n, 1e-12)
    found = ruptures.Pelt(model="l1", min_size=_SHORTEST, jump=1).fit(logs / step).predict(pen=3 * np.log(n))
    return found[:-1]


def levels(values, changes):
    """The median of each segment."""
    ends = [0, *changes, len(values)]
    return [float(np.median(values[a:b])) for a, b in zip(ends, ends[1:])]


def write(history, path):
    """Writes the page and returns its path. Machines are kept apart."""
    parts = ["<!doctype html><html lang='en'><meta charset='utf-8'><title>raybench trend</title>", _STYLE,
             "<h1>Trend</h1>"]  # fmt: skip
    for fingerprint, entries in history.items():
        cpu = html.escape(str(entries[-1].get("cpu")))
        parts.append(f"<h2>{cpu} ({fingerprint}): {len(entries)} runs</h2>")
        found = sorted(_rows(entries), key=lambda row: -row["jump"])
        changed = [row for row in found if row["changes"]]
        parts.append(f"<p>{len(found)} cases, {len(changed)} with a change of level. Ratios to the anchor where there "
                     "is one, else ns.</p>")  # fmt: skip
        for row in found[:_SHOWN]:
            parts.append(_figure(entries, row))
    text = "\n".join(parts) + "</html>\n"
    results.write_atomically(path, lambda temporary: temporary.write_text(text, encoding="utf-8"))
    return path


_STYLE = "<style>body{font:15px sans-serif;max-width:60em;margin:2em auto;padding:0 1em}img{max-width:100%}</style>"


def _rows(entries):
    for case, (indices, ns, ratios) in series_of(entries).items():
        is_ratio = bool(np.isfinite(ratios).all()) and not (ratios == 1).all()
        values = ratios if is_ratio else ns
        changes = change_points(values)
        of_segments = levels(values, changes)
        jumps = [abs(np.log(b / a)) for a, b in zip(of_segments, of_segments[1:])]
        yield {"case": case, "indices": indices, "values": values, "is_ratio": is_ratio, "changes": changes,
               "levels": of_segments, "jump": max(jumps, default=0.0)}  # fmt: skip


def _figure(entries, row):
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(figsize=(7, 1.8), layout="constrained")
    axes.plot(row["indices"], row["values"], "o", markersize=3)
    ends = [0, *row["changes"], len(row["values"])]
    for level, a, b in zip(row["levels"], ends, ends[1:]):
        axes.plot([row["indices"][a], row["indices"][b - 1]], [level, level], color="black")
    axes.set_ylabel("anchor ratio" if row["is_ratio"] else "ns")
    axes.set_ylim(bottom=0)
    buffer = io.BytesIO()
    figure.savefig(buffer, format="svg")
    pyplot.close(figure)
    said = []
    for at, a, b in zip(row["changes"], row["levels"], row["levels"][1:]):
        entry = entries[row["indices"][at]]
        said.append(f"{100 * (b / a - 1):+.1f} % at {entry['commit'][:12]} ({entry['started']})")
    name = html.escape(" / ".join(str(part) for part in row["case"] if part))
    image = base64.b64encode(buffer.getvalue()).decode()
    changes = html.escape("; ".join(said) or "no change of level")
    return f"<h3>{name}</h3><p>{changes}</p><img alt='{name} over time' src='data:image/svg+xml;base64,{image}'>"
