"""What pairs say about a slowdown. Pure functions of arrays; an array of log-ratios has a row for each comparison and a
column for each pair."""

import functools

import numpy as np
from scipy import stats


def bootstrap_interval(log_ratios, confidence=0.95):
    """(lo, hi) of the median of each row: the percentile bootstrap over pairs, without drawing.

    The distribution of a resample's median is known (Efron 1979; Maritz and Jarrett 1978): it is at most the k-th
    smallest value exactly if at least half of n draws are among the k smallest, a binomial probability. So there is no
    seed and no noise. With an even number of pairs each end takes the outer one of the two middle values. An end where
    the confidence cannot be had from so few pairs is infinite.
    """
    ordered = np.sort(np.atleast_2d(log_ratios), axis=1)
    n = ordered.shape[1]
    lower_middle = (n + 1) // 2  # as many draws must lie at or below x
    at_most = stats.binom.sf(lower_middle - 1, n, np.arange(1, n + 1) / n)  # P(median* <= x_k), k = 1..n
    k = int(np.searchsorted(at_most, (1 - confidence) / 2, side="right"))  # values outside: of rank 1..k
    lo = ordered[:, k] if n >= 6 else np.full(len(ordered), -np.inf)
    hi = ordered[:, n - 1 - k] if n >= 6 else np.full(len(ordered), np.inf)
    return lo, hi


def slower_p(log_ratios, bound):
    """Of each row: the chance of such pairs if B were at most exp(bound) times as slow as A.

    Signed ranks of log(B/A) - bound. Which of the two runs first is a fair coin, thrown for each pair; so if B takes
    exp(bound) times as long as A whatever the machine does, then every difference has either sign with probability 1/2,
    independently, *given* all absolute values. The test is exact under any noise, drift or load.
    """
    return _signed_ranks(np.atleast_2d(log_ratios) - np.reshape(bound, (-1, 1)))


def faster_p(log_ratios, bound):
    """The same if B were at least exp(bound) times as slow."""
    return _signed_ranks(np.reshape(bound, (-1, 1)) - np.atleast_2d(log_ratios))


def _signed_ranks(differences):
    """P(sum of scores of positive differences as large as this or larger), for each row. The score of a difference is
    the rank of its absolute value, but no more than a third of the highest: a process that was disturbed is far out, and
    with Wilcoxon's own scores one such pair outweighs many (general scores: Hettmansperger, McKean 2011, ch. 1). A
    difference of zero counts as negative, so that it is evidence for nothing; equal ones are ranked in their order."""
    pairs = differences.shape[1]
    scores = np.minimum(stats.rankdata(np.abs(differences), axis=1, method="ordinal"), highest_score(pairs))
    return _at_least(pairs)[(scores * (differences > 0)).sum(axis=1).astype(int)]


def highest_score(pairs):
    return max(1, pairs // 3)


@functools.lru_cache
def _at_least(n):
    """P(W >= w) for w = 0, 1, ...: each of the n scores belongs to a positive difference with probability 1/2."""
    probabilities = np.ones(1)
    for rank in range(1, n + 1):
        score = min(rank, highest_score(n))
        longer = np.zeros(len(probabilities) + score)
        longer[: len(probabilities)] += probabilities / 2
        longer[score:] += probabilities / 2
        probabilities = longer
    return np.cumsum(probabilities[::-1])[::-1]


def benjamini_hochberg(p, rate):
    """Which hypotheses are rejected when at most `rate` of the rejected ones shall be true ones, on average."""
    p = np.asarray(p)
    if p.size == 0:
        return np.zeros(0, dtype=bool)
    order = np.argsort(p)
    below = np.nonzero(p[order] <= rate * np.arange(1, p.size + 1) / p.size)[0]
    rejected = np.zeros(p.size, dtype=bool)
    if below.size:
        rejected[order[: below[-1] + 1]] = True
    return rejected


def spent(rate, look):
    """The part of an error rate that the look-th look (from 1) may use: rate / (look (look + 1)), which sums up to
    `rate` over any number of looks, so that nobody needs to know the last one beforehand."""
    return rate / (look * (look + 1))


def look_sizes(first=20, growth=1.5):
    """Numbers of pairs after which a decision looks: 20, 30, 45, 68, 102, ... without end."""
    pairs = float(first)
    while True:
        yield int(np.ceil(pairs))
        pairs *= growth


def order_effect(log_ratios, a_first):
    """(median log-ratio of second over first run, two-sided p) over all comparisons: what warms up or drifts within a
    pair. The random order cancels it; it is told all the same. None for fewer than 6 pairs."""
    second_over_first = np.where(np.asarray(a_first), 1.0, -1.0) * np.median(np.atleast_2d(log_ratios), axis=0)
    if second_over_first.size < 6 or not second_over_first.any():
        return None
    return float(np.median(second_over_first)), float(stats.wilcoxon(second_over_first).pvalue)
