"""Lines of cost: building, and then so much a ray. Pure functions."""

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Line:
    """What a structure costs on a scene."""

    spec: str
    build: float  # seconds
    ray: float  # nanoseconds
    bytes: int = 0

    def total(self, rays):
        return self.build + self.ray * 1e-9 * rays


def break_even(a, b):
    """From how many rays on `b` is cheaper than `a`: 0 if it always is, None if it never is. METHODOLOGY: the
    difference of the build times over that of the times a ray."""
    if b.build <= a.build and b.ray <= a.ray:
        return 0.0 if b.build < a.build or b.ray < a.ray else None
    if b.ray >= a.ray:
        return None
    return (b.build - a.build) / ((a.ray - b.ray) * 1e-9)


def cheapest_by_rays(lines):
    """[(from rays, line), ...]: which line is cheapest for how many rays, the lower envelope of all."""
    here = min(lines, key=lambda line: (line.build, line.ray))
    steps, rays = [(0.0, here)], 0.0
    while True:
        later = []
        for line in lines:
            start = break_even(here, line)
            if start is not None and line.ray < here.ray:
                later.append((max(start, rays), line.ray, line))
        if not later:
            return steps
        rays, _, here = min(later, key=lambda item: item[:2])
        if rays == steps[-1][0]:
            steps.pop()
        steps.append((rays, here))


def upper_bound(errors, rays, confidence=0.95):
    """Of a rate that gave `errors` in `rays` (Clopper, Pearson 1934): about 3/n without any."""
    from scipy.stats import beta

    return 1.0 if errors >= rays else float(beta.ppf(confidence, errors + 1, rays - errors))


def rays_for(rate):
    """So many rays without an error show that the rate is below `rate`."""
    return math.ceil(math.log(0.05) / math.log1p(-rate)) if rate < 1 else 1
