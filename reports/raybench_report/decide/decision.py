"""The rule that turns pairs into pass, fail or inconclusive."""

from dataclasses import dataclass

import numpy as np

from . import statistics

PASS, FAIL, INCONCLUSIVE = "pass", "fail", "inconclusive"
EXIT_CODE = {PASS: 0, FAIL: 1, INCONCLUSIVE: 3}

# At most so many of the comparisons called slower are not, on average; where none is slower at all, this is the chance
# that a decision ends in fail.
FALSE_FAIL_RATE = 0.002
# The chance that a comparison that is slower by more than its tolerance passes.
FALSE_PASS_RATE = 0.05
FEWEST_PAIRS = 20  # before the first look
CONFIDENCE = 0.95  # of the intervals shown


@dataclass(frozen=True)
class Look:
    """What is known after so many pairs; arrays have a value for each comparison."""

    pairs: int
    median: np.ndarray  # of log(B/A)
    lo: np.ndarray
    hi: np.ndarray
    verdicts: np.ndarray  # of PASS, FAIL, INCONCLUSIVE

    @property
    def verdict(self):
        """Of the whole: fail if any comparison fails, pass if all pass."""
        if (self.verdicts == FAIL).any():
            return FAIL
        return PASS if (self.verdicts == PASS).all() else INCONCLUSIVE


def look_at(log_ratios, tolerances, look):
    """The look-th look (from 1) at all pairs so far: rows of log(B/A), one a comparison, and log(1 + tolerance) of each.

    A comparison fails if its interval lies above the tolerance and so do the signed ranks, corrected for the number of
    comparisons (Benjamini, Hochberg 1995) and of looks; it passes if interval and ranks lie below. Passing needs no
    correction for the number of comparisons, since the whole passes only if each does (Berger 1982).
    """
    log_ratios, tolerances = np.atleast_2d(log_ratios), np.asarray(tolerances, dtype=float)
    lo, hi = statistics.bootstrap_interval(log_ratios, CONFIDENCE)
    slower = np.where(lo > tolerances, statistics.slower_p(log_ratios, tolerances), 1.0)
    fails = statistics.benjamini_hochberg(slower, statistics.spent(FALSE_FAIL_RATE, look))
    faster = statistics.faster_p(log_ratios, tolerances)
    passes = (hi < tolerances) & (faster <= statistics.spent(FALSE_PASS_RATE, look)) & ~fails
    verdicts = np.where(fails, FAIL, np.where(passes, PASS, INCONCLUSIVE))
    return Look(log_ratios.shape[1], np.median(log_ratios, axis=1), lo, hi, verdicts)


def decide(log_ratios, tolerances, sizes=None, until_all=False):
    """Looks after 20, 30, 45, ... of the recorded pairs and returns the Look that ends it: the first whose verdict is
    not inconclusive (with `until_all`, that leaves no comparison undecided), else the last one. Pairs beyond the last
    look are not used. None where there are too few for a look."""
    last = None
    for number, pairs in enumerate(sizes or statistics.look_sizes(FEWEST_PAIRS), start=1):
        if pairs > np.shape(log_ratios)[1]:
            return last
        last = look_at(np.asarray(log_ratios)[:, :pairs], tolerances, number)
        if is_over(last, until_all):
            return last
    return last


def is_over(look, until_all):
    """Whether more pairs are of no use."""
    if until_all:
        return not (look.verdicts == INCONCLUSIVE).any()
    return look.verdict != INCONCLUSIVE
