"""Each case of a history over time, with its change points."""

import numpy as np
import ruptures

FEWEST = 6  # runs before a change can be told
_SHORTEST = 3  # runs of a segment


def series_of(entries):
    """{case: (indices of entries, rows of (ns, lo, hi, anchor_ns))}; NaN where there is none."""
    found = {}
    for index, entry in enumerate(entries):
        for row in entry["cases"]:
            indices, rows = found.setdefault(tuple(row["case"]), ([], []))
            indices.append(index)
            rows.append([row.get(name) or np.nan for name in ("ns", "lo", "hi", "anchor_ns")])
    return {case: (np.array(indices), np.array(rows, dtype=float)) for case, (indices, rows) in found.items()}


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


def cases(entries):
    """Of each case: `indices` of its entries, `values`, `lo` and `hi` (NaN where unknown), as ratios to the anchor where
    each has one (`is_ratio`), else ns; `changes`, places of `indices` where its level changes, and the `levels` between;
    `jump`, the largest change as |log|. Those that changed most first."""
    return sorted(_cases(entries), key=lambda row: -row["jump"])


def _cases(entries):
    for case, (indices, rows) in series_of(entries).items():
        ns, anchor = rows[:, 0], rows[:, 3]
        is_ratio = bool(np.isfinite(anchor).all()) and not (ns == anchor).all()
        values, lo, hi = (rows[:, :3] / anchor[:, None] if is_ratio else rows[:, :3]).T
        changes = change_points(values)
        of_segments = levels(values, changes)
        jumps = [abs(np.log(b / a)) for a, b in zip(of_segments, of_segments[1:])]
        yield {"case": case, "indices": indices, "values": values, "lo": lo, "hi": hi, "is_ratio": is_ratio, "changes": changes,
               "levels": of_segments, "jump": max(jumps, default=0.0)}  # fmt: skip
