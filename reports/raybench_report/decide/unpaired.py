"""Ratios to an anchor, compared between two runs that were not taken together."""

import numpy as np
from scipy import stats

from .. import results
from . import decision, samples, statistics

FEWEST = 8  # processes on each side


def compare(base, head, anchor, tolerance_of):
    """(Ratios, Look or None, processes of the side with fewer). Each process gives one value, the log-ratio of a
    structure's time to the anchor's beside it: what the machine does to both cancels. Sides are compared by
    Mann-Whitney's test of the shift, once, with the same correction for the number of comparisons as pairs have; the
    interval is the percentile bootstrap of the difference of the medians. None with fewer processes than FEWEST."""
    sides = []
    for folder in (base, head):
        relative = [times.relative_to(anchor) for times in samples.times_of(folder)]
        if not relative[0].ns:
            raise results.RunError(f"{folder}: --anchor {anchor}: no case has a time of it beside the others")
        sides.append(relative)
    fewest = min(len(side) for side in sides)
    common = [c for c in sides[0][0].ns if all(c in times.ns for side in sides for times in side)]
    values = [np.array([[np.log(times.ns[c]) for times in side] for c in common]) for side in sides]
    old = samples.with_summaries(samples.Ratios(common, values[0], {}))
    new = samples.with_summaries(samples.Ratios(common, values[1], {}))
    left_out = {c: "has no ratio in some process" for c in sides[1][0].ns if c not in common}
    shift = np.median(new.log_ratios, axis=1) - np.median(old.log_ratios, axis=1)
    ratios = samples.Ratios(old.comparisons, shift.reshape(-1, 1), left_out)
    if fewest < FEWEST:
        return ratios, None, fewest
    tolerances = np.log1p([tolerance_of(c) for c in ratios.comparisons])
    lo, hi = np.array([_interval(a, b) for a, b in zip(old.log_ratios, new.log_ratios)]).T
    shifted = new.log_ratios - tolerances[:, None]
    slower = stats.mannwhitneyu(shifted, old.log_ratios, axis=1, alternative="greater").pvalue
    faster = stats.mannwhitneyu(shifted, old.log_ratios, axis=1, alternative="less").pvalue
    fails = statistics.benjamini_hochberg(np.where(lo > tolerances, slower, 1), decision.FALSE_FAIL_RATE)
    passes = (hi < tolerances) & (faster <= decision.FALSE_PASS_RATE) & ~fails
    verdicts = np.where(fails, decision.FAIL, np.where(passes, decision.PASS, decision.INCONCLUSIVE))
    return ratios, decision.Look(fewest, shift, lo, hi, verdicts), fewest


def _interval(old, new):
    found = stats.bootstrap(
        (new, old),
        lambda a, b, axis: np.median(a, axis=axis) - np.median(b, axis=axis),
        confidence_level=decision.CONFIDENCE,
        n_resamples=2000,
        method="percentile",
        rng=1,
        vectorized=True,
    ).confidence_interval
    return found.low, found.high
