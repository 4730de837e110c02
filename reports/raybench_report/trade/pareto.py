"""Which points are worth taking: Pareto fronts of measured values with intervals."""

from dataclasses import dataclass

import numpy as np
from scipy import stats

FRONT, UNDECIDED, DOMINATED = "front", "undecided", "dominated"


@dataclass
class Axis:
    """Values of all points with their intervals.

    lo, hi  the value itself where it has no error; infinite where too little was measured for an interval
    better  "low" or "high"
    """

    value: np.ndarray
    lo: np.ndarray
    hi: np.ndarray
    better: str = "low"

    @staticmethod
    def of(value, lo=None, hi=None, better="low"):
        """Without `lo` and `hi` values have no error; NaN among these: not known."""
        value = np.asarray(value, dtype=float)
        ends = [
            value if end is None else np.where(np.isnan(e := np.asarray(end, dtype=float)), unknown, e)
            for end, unknown in ((lo, -np.inf), (hi, np.inf))
        ]
        return Axis(value, *ends, better)

    def _signed(self):
        return (self.value, self.lo, self.hi) if self.better == "low" else (-self.value, -self.hi, -self.lo)

    def no_worse(self):
        """[i, j]: the value of i is as good as that of j."""
        value, _, _ = self._signed()
        return value[:, None] <= value[None, :]

    def surely_better(self):
        """[i, j]: i is better, and the intervals are apart."""
        _, lo, hi = self._signed()
        return hi[:, None] < lo[None, :]


def places(x, y):
    """([place], [index of the point that dominates it, or -1]) of each point.

    i dominates j where it is as good on both axes by its values, and better on one; surely, where on each axis the values
    are equal or the intervals apart. What is dominated, but not surely, is undecided. Of those that dominate, the best one
    on y is named.
    """
    equal_x, equal_y = (axis.value[:, None] == axis.value[None, :] for axis in (x, y))
    dominates = x.no_worse() & y.no_worse() & ~(equal_x & equal_y)
    surely = (x.surely_better() | equal_x) & (y.surely_better() | equal_y) & ~(equal_x & equal_y)
    order = np.argsort(y.value if y.better == "low" else -y.value, kind="stable")
    found, by = [], []
    for j in range(len(x.value)):
        for place, matrix in ((DOMINATED, surely), (UNDECIDED, dominates)):
            if matrix[:, j].any():
                found.append(place)
                by.append(int(next(i for i in order if matrix[i, j])))
                break
        else:
            found.append(FRONT)
            by.append(-1)
    return found, by


def rate_interval(count, n, level=0.95):
    """Clopper and Pearson's (1934) interval of a share, one-sided where nothing or all was counted."""
    if not n:
        return np.nan, np.nan
    tail = 1 - level if count in (0, n) else (1 - level) / 2
    lo = stats.beta.ppf(tail, count, n - count + 1) if count else 0.0
    hi = stats.beta.ppf(1 - tail, count + 1, n - count) if count < n else 1.0
    return float(lo), float(hi)


def median_interval(values, level=0.95):
    """(median, lo, hi): the distribution-free interval between two order statistics, of at least `level`; NaN where there
    are too few values for one (below six)."""
    values = np.sort(np.asarray(values, dtype=float))
    n = len(values)
    if not n:
        return np.nan, np.nan, np.nan
    k = int(
        stats.binom.ppf((1 - level) / 2, n, 0.5)
    )  # P(fewer than k values below the median) is at most half the rest
    if stats.binom.cdf(k - 1, n, 0.5) > (1 - level) / 2:
        k -= 1
    median = float(np.median(values))
    return (median, float(values[k - 1]), float(values[n - k])) if k >= 1 else (median, np.nan, np.nan)
