"""Why one structure is slower than another: the gap split into visits, tests and bytes, and time per each."""

from dataclasses import asdict, dataclass
from itertools import combinations

import numpy as np
import pandas as pd

from .results import NULL, RunError

WORK = {"steps": "visits", "prims": "primitive tests", "bytes": "bytes"}
PARTS = {
    "steps": "visits",
    "prims": "primitive tests",
    "bytes": "bytes beyond those of visits and tests",
    "each": "time per each visit, test and byte",
    "rest": "not explained by the model",
}
ROUNDS = 40  # of fitting prices and factors by turns; they stand still after ten or so


@dataclass
class Prices:
    """What a visit, a primitive test and a byte cost on one scene, ns:

        time ~ base + structure's factor x rays' factor x sum of price x count

    by least squares of relative errors over all structures that count and all ray sets, no price below zero. The factors,
    of geometric mean 1, say how much dearer than usual all that a structure does is (a slab of a k-DOP is dearer than a
    box), and all that is done for rays of a set (incoherent ones wait for memory). Most bytes come with visits and tests
    (`bytes_per_step`, `bytes_per_prim`, fitted likewise), and are part of their prices; the price of a byte is that of
    those beyond. `error`: the median relative error of time, enlarged by the share of cases that the unknowns use up."""

    base: float
    steps: float
    prims: float
    bytes: float
    bytes_per_step: float
    bytes_per_prim: float
    structures: dict
    rays: dict
    cases: int
    error: float

    def parts(self, row):
        """ns of visits, tests and bytes beyond for a row with counts, but for its structure's factor."""
        beyond = row["bytes"] - self.bytes_per_step * row["steps"] - self.bytes_per_prim * row["prims"]
        factor = self.rays[row["rays_label"]]
        return {
            "steps": factor * self.steps * row["steps"],
            "prims": factor * self.prims * row["prims"],
            "bytes": factor * self.bytes * beyond,
        }


def prices(report):
    """(run, scene) → Prices, where at least six cases count."""
    known = report.totals
    null = report.timed_queries
    null = null[null["structure"] == NULL]
    found = {}
    for (run, label), here in known.groupby(["run", "label"], sort=False):
        here = here[here[list(WORK)].notna().all(axis=1)]
        if len(here) < 6:
            continue
        base = null.loc[(null["run"] == run) & (null["label"] == label), "median_ns"].median()
        base = 0.0 if np.isnan(base) else float(base)
        found[run, label] = _fit(here, base)
    return found


def _fit(here, base):
    counts, time = here[list(WORK)].to_numpy(dtype=float), here["ns"].to_numpy(dtype=float)
    usual = _least_squares(counts[:, :2], counts[:, 2], np.maximum(counts[:, 2], 1))
    known = np.column_stack([counts[:, :2], counts[:, 2] - counts[:, :2] @ usual])
    above = np.maximum(time - base, 0.01 * time)
    (which, structures), (where, rays) = pd.factorize(here["spec"]), pd.factorize(here["rays_label"])
    structure, ray = np.ones(len(structures)), np.ones(len(rays))
    price = _least_squares(known, above, time)
    unknowns = known.shape[1]
    if len(here) >= 2 * (unknowns + len(structures) + len(rays) - 2):  # with fewer, factors would explain anything
        unknowns += len(structures) + len(rays) - 2
        for _ in range(ROUNDS):
            work = np.maximum(known @ price, 1e-3)
            structure = _factors(which, above / (ray[where] * work))
            ray = _factors(where, above / (structure[which] * work))
            price = _least_squares(known * (structure[which] * ray[where])[:, None], above, time)
    expected = base + structure[which] * ray[where] * (known @ price)
    error = np.median(np.abs(expected / time - 1)) * np.sqrt(len(here) / max(1, len(here) - unknowns))
    return Prices(
        base, *map(float, price), *map(float, usual), structures=dict(zip(structures, map(float, structure), strict=True)),
        rays=dict(zip(rays, map(float, ray), strict=True)), cases=len(here), error=float(error),
    )  # fmt: skip


def _factors(members, ratios):
    """The geometric mean of each member's ratios, relative to that of all members."""
    mean = np.bincount(members, np.log(ratios)) / np.bincount(members)
    return np.exp(mean - mean.mean())


def _least_squares(known, target, scale):
    """Coefficients >= 0 that minimise the sum of ((known @ x - target) / scale)^2: the best of all choices of columns
    whose plain solution has no negative one."""
    weighted, wanted, count = known / scale[:, None], target / scale, known.shape[1]
    best, error = np.zeros(count), (wanted**2).sum()
    for choice in (list(c) for n in range(1, count + 1) for c in combinations(range(count), n)):
        size = np.linalg.norm(weighted[:, choice], axis=0)
        if (size == 0).any():
            continue
        solution = np.linalg.lstsq(weighted[:, choice] / size, wanted, rcond=None)[0] / size
        rest = ((weighted[:, choice] @ solution - wanted) ** 2).sum()
        if (solution >= 0).all() and rest < error:
            best, error = np.zeros(count), rest
            best[choice] = solution
    return best


@dataclass
class Gap:
    """Time per ray of `one` minus that of `other` on one scene and ray set, ns, and its parts: visits, tests and bytes
    at the scene's prices for such rays and the mean of both structures' factors; `each`, by which one's factor is larger,
    at the mean of both structures' counts; `rest`, which the model leaves. Nothing where either cannot count."""

    scene: str
    rays: str
    ns: tuple
    counts: dict
    parts: dict | None


def gaps(report, one, other, run, scene=None, rays=None):
    """[Gap] for each scene and ray set that both were timed on. Throws RunError where there is none."""
    known = report.totals
    known = known[known["run"] == run]
    for spec in (one, other):
        if spec not in set(known["spec"]):
            raise RunError(
                f"{spec}: not timed in this run; timed: {', '.join(s for s in report.order if s in set(known['spec']))}"
            )
    for value, column, what in ((scene, "label", "scene"), (rays, "rays_label", "ray set")):
        if value is not None:
            names = list(known[column].unique())
            chosen = known[
                (known[column] == value) | (known["ray_set" if column == "rays_label" else "scene"] == value)
            ]
            if chosen.empty:
                raise RunError(f"{value}: no such {what}; there are: {', '.join(names)}")
            known = chosen
    price = prices(report)
    found = []
    for (label, rays_label), here in known.groupby(["label", "rays_label"], sort=False):
        pair = [here[here["spec"] == spec] for spec in (one, other)]
        if any(p.empty for p in pair):
            continue
        found.append(gap(pair[0].iloc[0], pair[1].iloc[0], price.get((run, label))))
    if not found:
        raise RunError(f"{one} and {other} were not timed on the same rays")
    return found


def gap(one, other, price):
    """The Gap of two rows of charts/pays.py's totals()."""
    counts = {name: (float(one[name]), float(other[name])) for name in WORK}
    parts = None
    if price and not any(np.isnan(v) for pair in counts.values() for v in pair):
        mine, others = price.parts(one), price.parts(other)
        a, b = price.structures[one["spec"]], price.structures[other["spec"]]
        parts = {name: float((a + b) / 2 * (mine[name] - others[name])) for name in WORK}
        parts["each"] = float((a - b) * (sum(mine.values()) + sum(others.values())) / 2)
        parts["rest"] = float(one["ns"] - other["ns"]) - sum(parts.values())
    return Gap(one["label"], one["rays_label"], (float(one["ns"]), float(other["ns"])), counts, parts)


def text(report, one, other, found, run):
    """The gaps as lines for a terminal."""
    price = prices(report)
    lines = [f"{one} against {other}, run {run}: time per ray, and what makes the difference"]
    scene = None
    for g in found:
        if g.scene != scene:
            scene = g.scene
            lines += ["", scene]
            if p := price.get((run, scene)):
                lines.append(
                    f"  prices here, fitted over {p.cases} cases (median error {100 * p.error:.0f} %): "
                    f"{p.steps:.3g} ns a visit and {p.prims:.3g} ns a test, with the bytes they usually touch; {p.bytes:.3g} ns a byte beyond; "
                    + ", ".join(f"{s} pays {p.structures[s]:.2f} times that" for s in (one, other) if s in p.structures)
                )
        a, b = g.ns
        word = f"{a / b:.3g} times as long" if a >= b else f"{b / a:.3g} times as fast"
        factor = f" (prices times {p.rays[g.rays]:.2f})" if (p := price.get((run, scene))) and g.rays in p.rays else ""
        lines.append(f"  {g.rays}{factor}: {a:,.4g} ns against {b:,.4g} ns: {word}")
        for name, title in WORK.items():
            x, y = g.counts[name]
            if np.isnan(x) or np.isnan(y):
                silent = " and ".join(s for s, v in ((one, x), (other, y)) if np.isnan(v))
                lines.append(f"    {title:<16} not counted by {silent}")
                continue
            each = f"{a / x:.3g} / {b / y:.3g} ns each" if x > 0 and y > 0 else ""
            share = f"{g.parts[name]:+,.4g} ns" if g.parts else ""
            lines.append(f"    {title:<16} {x:>12,.4g} against {y:<12,.4g} {share:>14}   {each}")
        if g.parts:
            for name, title in (("each", "time per each"), ("rest", "not explained")):
                lines.append(f"    {title:<16} {'':>12}         {'':<12} {f'{g.parts[name]:+,.4g} ns':>14}")
            largest = max(g.parts, key=lambda name: abs(g.parts[name]))
            if a != b and g.parts[largest] / (a - b) > 0:
                what = PARTS[largest]
                share = 100 * g.parts[largest] / (a - b)
                lines.append(
                    f"    {'more than all of it' if share > 100 else 'the largest part'}: {what}, {share:.0f} % of the gap"
                )
    return "\n".join(lines) + "\n"


def as_json(found):
    """For programs."""
    return [asdict(g) for g in found]
