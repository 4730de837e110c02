"""The measuring of `raybench advise`: candidates are built and traced beside each other, and given up as soon as they
cannot win (successive halving: Karnin, Koren, Somekh 2013; Jamieson, Talwalkar 2016)."""

import math
import sys
import time
from dataclasses import dataclass, field

import numpy as np

from .costs import Line

ANCHOR = "bvh_wide"  # beside each candidate when it is looked at first
FIRST_RAYS = 2048  # by which a candidate is looked at first
NEAR = 1.1  # so many times the best cost so far, where another candidate is tried only after this one
MAY_WIN = 1.5  # so many times the best cost after the first look, which is rough
BUILD_MATTERS = 0.05  # share of the cost from which on a build is measured again
ROUNDS, FINAL_ROUNDS = 5, 25
FINALISTS = 4


@dataclass
class Contestant:
    candidate: object
    builds: list = field(default_factory=list)  # seconds, of each time that it was built
    ray: float = math.nan  # nanoseconds; the latest figure
    tree: int | None = None
    bytes: int = 0
    claims: str = ""
    out: str = ""  # why it is given up; empty: it is not
    beside: tuple = ()  # given up: (another contestant, `ray` in units of that one's at the time)

    @property
    def spec(self):
        return self.candidate.spec

    @property
    def measured(self):
        return bool(self.builds) and math.isfinite(self.ray)

    def line(self):
        return Line(self.spec, min(self.builds), self.ray, self.bytes)


class Search:
    """`rays`: that one build must serve. `seconds`: of wall time that measuring may take."""

    def __init__(self, trials, candidates, rays, seconds, memory=0, admits=lambda built: True):
        self._trials, self._rays, self._memory, self._admits = trials, rays, memory, admits
        self._end = time.monotonic() + seconds
        self.all = [Contestant(c) for c in candidates]
        self._most = trials.training_rays

    def run(self):
        """Measures. Then those that are left, the cheapest first; all that were looked at stay in `all`."""
        self._look_at_all()
        self._halve()
        for c in self.all:
            _settle(c)
        return self._ranked()

    def beside_best(self, specs):
        """Cost of other structures in units of the best one's, admitted or not: {spec: ratio}."""
        best = self._ranked()[0]
        built = [b for b in map(self._trials.build, specs) if b.tree is not None]
        ns = self._trials.time([best.tree, *(b.tree for b in built)], self._most, ROUNDS + 1)[:, 1:]
        self._trials.drop(*(b.tree for b in built))
        ratios = {}
        for b, row in zip(built, ns[1:]):
            line = Line(b.spec, b.seconds, best.ray * float(np.median(row / ns[0])))
            ratios[b.spec] = line.total(self._rays) / self._cost(best)
        return ratios

    def over(self):
        return time.monotonic() > self._end

    def _cost(self, c):
        return c.line().total(self._rays)

    def _ranked(self):
        return sorted((c for c in self.all if c.measured and not c.out), key=self._cost)

    def _best(self):
        return min((self._cost(c) for c in self._ranked()), default=math.inf)

    # ---- the first look ----

    def _look_at_all(self):
        anchor = self._trials.build(ANCHOR).tree
        self._anchor_ns = None
        for i, c in enumerate(self.all):
            self._say(f"{i + 1} of {len(self.all)}: {c.spec}")
            if self.over() and self._ranked():
                c.out = "not tried: the time for measuring was over"
                continue
            if not self._is_near(c.candidate.after):
                c.out = f"not tried: {c.candidate.after} was not near the best"
                continue
            self._build(c, MAY_WIN * self._best())
            if not c.out:
                self._look_at(c, anchor)
                self._make_room()
        self._say("")
        self._trials.drop(anchor)
        ranked = self._ranked()
        for c in self.all:
            if c.measured and ranked and (c.out or self._cost(c) > MAY_WIN * self._cost(ranked[0])):
                self._give_up(c, c.out or "cost more at the first look", ranked[0])

    def _is_near(self, spec):
        """Whether that candidate did so well that those of its kind are worth their time. Nothing: yes."""
        of = [c for c in self.all if c.spec == spec]
        return not of or (of[0].measured and not of[0].out and self._cost(of[0]) <= NEAR * self._best())

    def _build(self, c, limit):
        built = self._trials.build(c.spec, limit)
        if built.tree is None:
            c.out = "building alone takes longer than all of the best" if built.seconds >= limit else built.stopped
            return
        c.tree, c.bytes, c.claims = built.tree, built.bytes, built.claims
        c.builds.append(built.seconds)
        if self._memory and built.bytes > self._memory:
            self._give_up(c, f"takes {built.bytes / 1e6:.1f} MB")
        elif not self._admits(built):
            self._give_up(c, f"claims to be {built.claims}")

    def _look_at(self, c, anchor):
        """A few rays, and more only where they do not settle it."""
        for rays in (FIRST_RAYS // 16, FIRST_RAYS):
            ns = self._trials.time([anchor, c.tree], min(rays, self._most), 3, seconds=0.5)
            last = ns[:, 1:] if ns.shape[1] > 1 else ns  # the first round warms up
            if self._anchor_ns is None and rays == FIRST_RAYS:
                self._anchor_ns = float(np.median(last[0]))
            # In units of the anchor, so that a machine which slows down for a while harms no one.
            c.ray = float(np.median(last[1] / last[0])) * (self._anchor_ns or float(np.median(last[0])))
            if self._cost(c) > 3 * self._best() or ns.shape[1] < 3:
                break
        if self._cost(c) > MAY_WIN * self._best():
            self._give_up(c, "cost more at the first look")

    def _make_room(self):
        """The trees that are kept take at most half of what one may take: the next one needs room to be built."""
        left = self._ranked()
        while len(left) > 1 and sum(c.bytes for c in left) > self._trials.facts["memory_limit"] / 2:
            self._give_up(left.pop(), "cost more at the first look, and memory was short")

    def _give_up(self, c, why, beside=None):
        c.out = why
        if beside is not None:
            c.beside = (beside, c.ray / beside.ray)
        if c.tree is not None:
            self._trials.drop(c.tree)
            c.tree = None

    # ---- halving ----

    def _halve(self):
        rays = min(2 * FIRST_RAYS, self._most)
        while True:
            left = self._ranked()
            if len(left) < 2 or self.over():
                return
            final = len(left) <= FINALISTS
            rays = self._most if final else rays
            self._race(left, rays, FINAL_ROUNDS if final else ROUNDS)
            if final:
                return
            left = self._ranked()
            keep = max(FINALISTS, math.ceil(len(left) / 2))
            for c in left[keep:]:
                self._give_up(c, "cost more when measured longer", left[0])
            rays = min(2 * rays, self._most)

    def _race(self, left, rays, rounds):
        """Traces all by turns, and builds anew those whose build matters. The time of a ray is in units of the first
        one's, round by round, so that all share what the machine does."""
        ns = self._trials.time([c.tree for c in left], rays, rounds + 1, seconds=max(self._left() / 4, 0.05))
        ns = ns[:, 1:] if ns.shape[1] > 1 else ns
        scale = float(np.median(ns[0]))
        for c, row in zip(left, ns):
            c.ray = scale * float(np.median(row / ns[0]))
        for _ in range(3 if rounds == FINAL_ROUNDS else 1):
            for c in left:
                if min(c.builds) < BUILD_MATTERS * self._cost(c) or self.over():
                    continue
                again = self._trials.build(c.spec)
                c.builds.append(again.seconds)
                self._trials.drop(again.tree)

    def _say(self, what):
        """A line on a terminal while candidates are tried; nothing: takes it away."""
        if sys.stderr.isatty():
            left = f", at most {self._left():.0f} s left" if what else ""
            print(f"\r\033[K{what}{left}", end="", file=sys.stderr, flush=True)

    def _left(self):
        return max(self._end - time.monotonic(), 0.0)


def _settle(c):
    """The time a ray of what was given up, in units of what went on: the machine has changed since."""
    if c.beside:
        other, ratio = c.beside
        c.beside = ()
        _settle(other)
        c.ray = ratio * other.ray
