"""What `raybench advise` says. Pure functions of what was measured."""

import argparse
import math
from dataclasses import dataclass

from . import costs
from .files import table

ENOUGH_ULP = 16  # a size of so many spacings of float is far longer than the errors of float tests
COARSE_ULP = 2  # below, the vertices themselves are not where they should be
FAR = 4  # the farthest coordinate, in half extents of the scene, from which on moving the scene pays


@dataclass(frozen=True)
class Precision:
    """Which arithmetic the geometry requires: sizes in spacings of float (ulp) at the largest coordinate, 0 where there
    is nothing to measure."""

    small: float  # size of the triangle that is larger than 1 % of them: the root of twice its area
    shortest: float  # shortest edge or radius of all, perhaps of one sliver
    far: float  # largest coordinate over half of the scene's largest extent

    @classmethod
    def of(cls, scene):
        lo, hi = scene["bounds"]["lo"], scene["bounds"]["hi"]
        half = max((b - a for a, b in zip(lo, hi)), default=0) / 2
        largest = max(map(abs, [*lo, *hi]), default=0)
        shortest = scene["needs"]["smallest_feature_ulp"]
        area = (scene.get("triangle_area") or {}).get("percent_1")
        small = math.sqrt(2 * area) / (math.ulp(largest) * 2**29) if area and largest > 0 else shortest
        return cls(small, shortest, largest / half if half > 0 else 1.0)

    @property
    def numerics(self):
        """What our own structures shall compute with; None: the default, watertight in float. Where the vertices are
        too coarse, more digits in the tests are of no use."""
        return "double" if COARSE_ULP <= self.small < ENOUGH_ULP else None

    def sentences(self):
        if not self.small:
            return ["There is no edge or radius to measure."]
        size = f"99 % of the triangles are larger than {_short(self.small)} spacings of float at the largest coordinate"
        if self.small >= ENOUGH_ULP:
            rows = [f"Float is enough: {size}."]
            if self.shortest < ENOUGH_ULP:
                rows.append(
                    f"But the shortest edge of all is {_short(self.shortest)} spacings: that one may be missed."
                )
        elif self.small >= COARSE_ULP:
            rows = [f"Float is not enough for hits on the smallest features, so tests are made in double: {size}."]
        else:
            rows = [f"No arithmetic can save the smallest features, which the stored vertices do not resolve: {size}."]
        if self.far > FAR:
            rows.append(
                f"The scene lies {_short(self.far)} times its half size from the origin: moved there, its coordinates "
                f"would be about {_short(self.far)} times as fine."
            )
        return rows


@dataclass
class Advice:
    arguments: argparse.Namespace
    facts: dict  # of the trials
    scene: dict  # `raybench list scene NAME --json`
    precision: Precision
    rays: int  # that one build serves
    ranked: list  # contestants, the advised one first
    all: list
    judged: dict
    admission: object
    over: bool  # the time for measuring was spent
    tempting: dict  # costs of what may answer wrong, in units of the advice's
    offset: str | None

    @property
    def best(self):
        return self.ranked[0]

    def lines(self):
        """Of all that were measured and may be advised, those given up early with rougher figures."""
        unfit = ("takes ", "claims ", "broke ")
        return [c.line() for c in self.all if c.measured and not c.out.startswith(unfit)]

    def as_json(self):
        best = self.best.line()
        return {
            "format": 1,
            "scene": self.facts,
            "rays": self.rays,
            "advice": {**_as_json(best, self.rays), "why": self.best.candidate.why},
            "runners_up": [_as_json(c.line(), self.rays) for c in self.ranked[1:]],
            "cheapest_by_rays": [
                {"from_rays": int(rays), "structure": line.spec} for rays, line in costs.cheapest_by_rays(self.lines())
            ],
            "candidates": [
                {
                    "structure": c.spec,
                    "why": c.candidate.why,
                    "given_up": c.out or None,
                    "build_seconds": min(c.builds, default=None),
                    "ns_per_ray": c.ray if c.measured else None,
                    "bytes": c.bytes or None,
                    "error_bound": self.admission.bounds.get(c.spec),
                }
                for c in self.all
            ],
            "judged": self.judged,
            "cost_of_inexact": self.tempting,
            "max_error": self.arguments.max_error,
            "precision": {
                "small_triangle_ulp": self.precision.small,
                "shortest_edge_ulp": self.precision.shortest,
                "numerics": self.precision.numerics,
            },
            "offset": self.offset,
            "needs": self.scene["needs"],
            "time_was_spent": self.over,
        }


def _as_json(line, rays):
    return {
        "structure": line.spec,
        "build_seconds": line.build,
        "ns_per_ray": line.ray,
        "total_seconds": line.total(rays),
        "bytes": line.bytes,
    }


def text(a):
    """The whole advice."""
    parts = [
        [f"Take {a.best.spec}"],
        _indented(_situation(a)),
        ["Why", *_bullets(_reasons(a))],
        ["Runners-up", *_indented(_runners_up(a))],
        ["Which is cheapest for how many rays a build", *_indented(_by_rays(a))],
        ["What the scene requires", *_bullets(_required(a))],
        ["What it does not", *_bullets(_not_required(a))],
    ]
    return "\n".join(line for part in parts for line in part)


def _situation(a):
    sets = ", ".join(f"{s['set']} {100 * s['share']:.0f} %" for s in a.facts["sets"])
    serves = f"one build serves {_count(a.rays)} rays"
    if a.arguments.rebuild_every > 1:
        serves += f" ({a.arguments.rebuild_every} frames of {_count(a.arguments.rays)})"
    return [f"{a.facts['scene']}, {a.facts['primitives']:,} primitives; {serves}: {sets}"]


def _reasons(a):
    best, rays = a.best.line(), a.rays
    share = best.build / best.total(rays)
    rows = [
        f"It builds in {_time(best.build)} and takes {best.ray:.3g} ns a ray on one thread: {_time(best.total(rays))} "
        f"in all, of which building is {100 * share:.0f} %."
    ]
    lines = [line for line in a.lines() if line.spec != best.spec]
    if lines:
        fastest_build = min(lines, key=lambda line: line.build)
        if fastest_build.build < best.build:
            rows.append(
                f"{fastest_build.spec} builds in {_time(fastest_build.build)}, "
                f"but takes {_times(fastest_build.ray / best.ray)} a ray."
            )
        fastest_trace = min(lines, key=lambda line: line.ray)
        if fastest_trace.ray < best.ray:
            rows.append(
                f"{fastest_trace.spec} would save {100 * (1 - fastest_trace.ray / best.ray):.0f} % a ray, "
                f"but builds in {_time(fastest_trace.build)}."
            )
    rows.append(f"It was listed because: {a.best.candidate.why}.")
    tried = [c for c in a.all if not c.out.startswith("not tried")]
    spent = ", until the time was spent" if a.over else ""
    rows.append(f"{len(tried)} of {len(a.all)} candidates were tried{spent}.")
    return rows


def _runners_up(a):
    best = a.best.line().total(a.rays)
    others = sorted(
        (c for c in a.all if c.measured and c is not a.best), key=lambda c: (bool(c.out), c.line().total(a.rays))
    )
    rows = [["(~: measured roughly)", "build ms", "ns a ray", "cost", "MB", "cheaper than the advice"]]
    for c in [a.best, *others[:6]]:
        line, rough = c.line(), "~" if c.out else ""
        rows.append(
            [line.spec, f"{1e3 * line.build:.1f}", f"{rough}{line.ray:.3g}", f"{rough}{line.total(a.rays) / best:.2f}"]
            + [f"{line.bytes / 1e6:.1f}", "-" if c is a.best else _when(a.best.line(), line)]
        )
    return table(rows)


def _when(best, line):
    """For how many rays `line` is cheaper."""
    start, end = costs.break_even(best, line), costs.break_even(line, best)
    if start == 0:
        return "always"
    if start is not None:
        return f"from {_count(start)} rays"
    return f"below {_count(end)} rays" if end else "never"


def _by_rays(a):
    steps = costs.cheapest_by_rays(a.lines())
    rows = []
    for i, (start, line) in enumerate(steps):
        until = f"to {_count(steps[i + 1][0])}" if i + 1 < len(steps) else "on"
        rows.append(f"from {_count(start)} {until}: {line.spec}")
    return rows


def _required(a):
    rows = []
    aimed, mix = a.judged["aimed"], a.judged["mix"]
    claims = a.best.claims
    errors = f"{mix['errors']} of {mix['rays']:,} rays of the mix"
    if aimed["rays"]:
        errors += f" and {aimed['errors']} of {aimed['rays']:,} aimed at edges and vertices"
    if a.arguments.max_error == 0:
        rows.append(f"No wrong answers: the advice claims to be {claims}; against exact truth {errors} were wrong.")
        if a.tempting:
            others = ", ".join(f"{spec} {ratio:.2f}" for spec, ratio in a.tempting.items())
            rows.append(f"What that costs: those that leak at edges would take, in its units, {others} (--max-error).")
    else:
        rows.append(
            f"At most {a.arguments.max_error:g} of the answers wrong: the advice claims to be {claims}; {errors} were."
        )
        if not a.admission.can_be_shown:
            few = f"{a.admission.rays:,} rays"
            rows.append(f"So low a rate cannot be shown by {few}; only what claims to be watertight was tried.")
    rows += a.precision.sentences()
    rows.append(f"Its t was off by at most {mix['t_error_max']:.2g} ulp on rays of the mix.")
    if a.offset:
        rows.append(f"Rays that leave surfaces: {a.offset}")
    if a.arguments.memory:
        rows.append(f"At most {a.arguments.memory / 1e6:.1f} MB: the advice takes {a.best.bytes / 1e6:.1f} MB.")
    needs = [name for name, need in _needs(a) if need["needed"]]
    rows.append(f"The picture needs {_list(needs)}.")
    return rows


def _not_required(a):
    rows = [f"{name.replace('_', ' ')}: {need['why']}" for name, need in _needs(a) if not need["needed"]]
    if a.precision.small >= ENOUGH_ULP:
        rows.append("double or exact arithmetic in the ray tests: triangles are far larger than float's errors")
    return rows or ["there is nothing that it does not need"]


def _needs(a):
    return [(name, need) for name, need in a.scene["needs"].items() if isinstance(need, dict)]


def _indented(rows):
    return ["  " + row for row in rows]


def _bullets(rows):
    return ["  - " + row for row in rows]


def _list(words):
    words = [w.replace("_", " ") for w in words]
    return ", ".join(words) or "nothing but the nearest hit"


def _short(x):
    return f"{x:,.0f}" if x >= 100 else f"{x:.3g}"


def _count(x):
    """Rays, two or three digits of them."""
    for size, name in ((1e12, " trillion"), (1e9, " billion"), (1e6, " million")):
        if x >= size:
            return f"{x / size:.3g}{name}"
    return f"{float(f'{x:.3g}'):,.0f}"


def _time(seconds):
    return f"{seconds:.3g} s" if seconds >= 1 else f"{1e3 * seconds:.3g} ms"


def _times(ratio):
    return f"{ratio:.2f} times as long" if ratio < 10 else f"{ratio:.0f} times as long"
