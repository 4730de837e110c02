"""The statistics of `raybench check`: against scipy, against brute force, and their error rates under a noise as bad as
that of a shared machine. RAYBENCH_TEST_DECISIONS=1000 simulates that many decisions of each kind instead of 300."""

import itertools
import os

import numpy as np
import pytest
from raybench_report.decide import decision, statistics
from scipy import stats

DECISIONS = int(os.environ.get("RAYBENCH_TEST_DECISIONS", "300"))
TOLERANCE = np.log1p(0.02)


@pytest.mark.parametrize("n", [6, 9, 12])
def test_signed_ranks_are_those_of_all_signs(n):
    """p by throwing all 2^n coins; scores by hand."""
    data = np.random.default_rng(n).standard_t(3, size=(8, n)) + 0.4
    signs = np.array(list(itertools.product([0, 1], repeat=n)))
    for bound, p, sign in ((0.1, statistics.slower_p, 1), (0.7, statistics.faster_p, -1)):
        for row, found in zip(data - bound, p(data, bound)):
            scores = np.minimum(np.argsort(np.argsort(np.abs(row))) + 1, n // 3)
            seen = scores[sign * row > 0].sum()
            assert found == pytest.approx(np.mean(signs @ scores >= seen), rel=1e-9)


@pytest.mark.parametrize("n", [6, 20, 45])
def test_with_all_ranks_as_scores_they_are_those_of_scipy(n, monkeypatch):
    monkeypatch.setattr(statistics, "highest_score", lambda pairs: pairs)
    monkeypatch.setattr(statistics, "_at_least", statistics._at_least.__wrapped__)
    data = np.random.default_rng(n).standard_t(3, size=(8, n)) + 0.4
    theirs = stats.wilcoxon(data - 0.1, axis=1, alternative="greater", method="exact").pvalue
    assert statistics.slower_p(data, 0.1) == pytest.approx(theirs, rel=1e-9)


def test_one_disturbed_pair_does_not_outweigh_the_others():
    ratios = np.append(np.full(19, 0.05), -0.4)
    assert statistics.slower_p(ratios, 0.02)[0] < 1e-4


def test_differences_of_zero_are_evidence_for_nothing():
    assert statistics.slower_p(np.zeros((1, 20)), 0.0)[0] == 1
    assert statistics.faster_p(np.zeros((1, 20)), 0.0)[0] == 1


@pytest.mark.parametrize("n", [6, 7])
def test_the_interval_is_that_of_all_resamples(n):
    """All n ** n of them; with an even number the outer one of both middle values counts."""
    data = np.array([0.3, -1.0, 2.0, 0.7, 5.0, 1.1, -0.2])[:n]
    draws = np.sort(data[np.indices((n,) * n).reshape(n, -1)], axis=0)
    lower_middle, upper_middle = draws[(n - 1) // 2], draws[n // 2]
    lo, hi = statistics.bootstrap_interval(data, 0.9)
    assert (lower_middle < lo[0]).mean() <= 0.05 < (lower_middle <= lo[0]).mean()
    assert (upper_middle > hi[0]).mean() <= 0.05 < (upper_middle >= hi[0]).mean()


def test_the_interval_covers_the_median_of_a_heavy_tail():
    data = np.random.default_rng(4).standard_t(1.5, size=(4000, 30))
    lo, hi = statistics.bootstrap_interval(data, 0.95)
    covered = ((lo <= 0) & (hi >= 0)).mean()
    assert 0.93 < covered < 0.98


def test_few_pairs_have_no_interval():
    lo, hi = statistics.bootstrap_interval(np.zeros((1, 5)))
    assert np.isinf(lo[0]) and np.isinf(hi[0])


def test_benjamini_hochberg_is_that_of_scipy():
    p = np.random.default_rng(5).random(200) ** 3
    assert (statistics.benjamini_hochberg(p, 0.1) == (stats.false_discovery_control(p) <= 0.1)).all()
    assert statistics.benjamini_hochberg([], 0.1).size == 0


def test_all_looks_together_spend_no_more_than_the_rate():
    assert sum(statistics.spent(0.01, look) for look in range(1, 100000)) <= 0.01
    sizes = list(itertools.islice(statistics.look_sizes(), 5))
    assert sizes == [20, 30, 45, 68, 102]


def test_an_order_effect_is_seen_and_cancelled():
    rng = np.random.default_rng(6)
    a_first = rng.random(60) < 0.5
    second_is_slower = np.where(a_first, 0.05, -0.05) + rng.normal(0, 0.01, (3, 60))
    effect, p = statistics.order_effect(second_is_slower, a_first)
    assert effect == pytest.approx(0.05, abs=0.005) and p < 1e-6
    look = decision.decide(second_is_slower, np.full(3, TOLERANCE))
    assert look.verdict != decision.FAIL


# ---- error rates ----


def shared_machine(rng, comparisons, pairs, spread=0.02):
    """log(B/A) of a program with itself. Runs follow one another; what the machine does drifts with heavy-tailed steps
    (so pairs resemble their neighbours), bursts slow whole runs, a process has a good or a bad memory layout for each
    comparison, and each time has heavy-tailed noise of its own. Which side runs first is a coin."""
    runs = 2 * pairs
    drift = np.zeros(runs)
    for i, step in enumerate(rng.standard_t(2, size=runs) * spread):
        drift[i] = 0.95 * drift[i - 1] + step
    bursts = (rng.random(runs) < 0.1) * rng.exponential(0.3, size=runs)
    layout = rng.choice([0, 0.06], p=[0.7, 0.3], size=(comparisons, runs))
    own = rng.standard_t(3, size=(comparisons, runs)) * spread
    times = (drift + bursts + layout + own).reshape(comparisons, pairs, 2)
    return np.where(rng.random(pairs) < 0.5, 1, -1) * (times[:, :, 1] - times[:, :, 0])


def quiet_machine(rng, comparisons, pairs):
    return rng.normal(0, 0.01, (comparisons, pairs)) + 0.002 * rng.standard_t(2, (comparisons, pairs))


def verdicts(noise, slowdown, decisions=DECISIONS, comparisons=30, slow=10, pairs=68):
    """How often each verdict came, of decisions over 30 comparisons of three structures, one of which is slower; as
    check has it, each structure has a row for all its ray sets too."""
    rng = np.random.default_rng(int(1000 * slowdown) + 1)
    count = {decision.PASS: 0, decision.FAIL: 0, decision.INCONCLUSIVE: 0}
    wrong = 0
    for _ in range(decisions):
        ratios = noise(rng, comparisons, pairs)
        ratios[:slow] += np.log1p(slowdown)
        of_all_sets = np.median(ratios.reshape(comparisons // slow, slow, pairs), axis=1)
        ratios = np.vstack([ratios, of_all_sets])
        look = decision.decide(ratios, np.full(len(ratios), TOLERANCE))
        count[look.verdict] += 1
        failed = np.nonzero(look.verdicts == decision.FAIL)[0]
        wrong += any(i >= slow and i != comparisons for i in failed)
    return count, wrong


@pytest.mark.parametrize("noise", [shared_machine, quiet_machine])
def test_a_program_is_not_slower_than_itself(noise):
    count, _ = verdicts(noise, 0.0)
    assert count[decision.FAIL] <= DECISIONS * 0.002, count
    if noise is quiet_machine:
        assert count[decision.PASS] >= 0.95 * DECISIONS, count


def test_at_the_tolerance_itself_false_alarms_stay_below_their_rate():
    """The hardest case that the guarantee covers: all are slower by exactly what is allowed."""
    rng, alarms = np.random.default_rng(9), 0
    for _ in range(DECISIONS):
        ratios = shared_machine(rng, 30, 45) + TOLERANCE
        alarms += decision.decide(ratios, np.full(30, TOLERANCE)).verdict == decision.FAIL
    assert alarms <= stats.binom.ppf(0.999, DECISIONS, decision.FALSE_FAIL_RATE)


@pytest.mark.parametrize("noise", [shared_machine, quiet_machine])
def test_slowdowns_are_found_and_never_pass(noise):
    least = {0.10: 0.95, 0.05: 0.60} if noise is quiet_machine else {0.10: 0.80, 0.05: 0.15}
    for slowdown, share in least.items():
        count, wrong = verdicts(noise, slowdown)
        assert count[decision.PASS] == 0, (slowdown, count)
        assert count[decision.FAIL] >= share * DECISIONS, (slowdown, count)
        assert wrong <= 0.02 * DECISIONS, "structures that are not slower are said to be"


def test_what_is_slower_than_allowed_passes_no_more_often_than_said():
    rng, passes = np.random.default_rng(10), 0
    for _ in range(2 * DECISIONS):
        ratios = quiet_machine(rng, 1, 68) + np.log1p(0.0201)
        passes += decision.decide(ratios, [TOLERANCE]).verdict == decision.PASS
    assert passes <= stats.binom.ppf(0.999, 2 * DECISIONS, decision.FALSE_PASS_RATE)


def test_interval_and_ranks_must_agree():
    """88 of 200 pairs lie a little on one side of the tolerance, 112 far on the other: the ranks are certain, the median is
    not."""
    ratios = np.concatenate([np.linspace(-2e-3, -1e-3, 88), np.linspace(0.9, 1.1, 112)]).reshape(1, -1)
    assert statistics.slower_p(ratios, 0)[0] < 1e-4
    assert decision.look_at(ratios + TOLERANCE, [TOLERANCE], 1).verdict == decision.INCONCLUSIVE
    assert decision.look_at(-ratios + TOLERANCE, [TOLERANCE], 1).verdict == decision.INCONCLUSIVE


def test_too_few_pairs_decide_nothing():
    assert decision.decide(np.full((2, 19), 1.0), np.full(2, TOLERANCE)) is None


def test_one_failing_comparison_ends_it_unless_all_are_wanted():
    rng = np.random.default_rng(11)
    ratios = quiet_machine(rng, 3, 102)
    ratios[0] += 0.5
    ratios[1] += rng.normal(0, 0.5, 102)
    tolerances = np.full(3, TOLERANCE)
    assert decision.decide(ratios, tolerances).pairs == 20
    assert decision.decide(ratios, tolerances, until_all=True).pairs > 20
