"""`raybench tune` and `raybench advise`: the rules on canned figures, and both by the real program on a tiny scene."""

import json
import os
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

from raybench_report.errors import RunError
from raybench_report.trade import advice, candidates, costs, space
from raybench_report.trade.candidates import Candidate
from raybench_report.trade.costs import Line
from raybench_report.trade.files import toml
from raybench_report.trade.search import Search
from raybench_report.trade.trials import Built, Trials, TrialsEnded

ROOT = Path(__file__).parents[2]
RAYBENCH = ROOT / "build" / "release" / "raybench"
needs_program = pytest.mark.skipif(not RAYBENCH.exists(), reason="build/release/raybench is not built")

QUICK, MIDDLE, SLOW = Line("quick", 0.01, 300), Line("middle", 0.03, 200), Line("slow", 0.5, 100)


# ---- lines of cost ----


def test_break_even():
    assert costs.break_even(QUICK, MIDDLE) == pytest.approx(0.02 / 100e-9)
    assert QUICK.total(2e5) == pytest.approx(MIDDLE.total(2e5))
    assert costs.break_even(MIDDLE, QUICK) is None  # it only ever gets worse
    assert costs.break_even(Line("a", 0.02, 300), QUICK) == 0
    assert costs.break_even(QUICK, QUICK) is None


def test_the_cheapest_by_rays_is_the_lower_envelope():
    never = Line("never", 0.4, 190)  # cheaper than middle from somewhere on, but slow is cheaper there
    steps = costs.cheapest_by_rays([SLOW, never, QUICK, MIDDLE, Line("worse", 0.6, 400)])
    assert [line.spec for _, line in steps] == ["quick", "middle", "slow"]
    assert [rays for rays, _ in steps] == pytest.approx([0, 2e5, 4.7e6])
    for rays in (1e3, 1e6, 1e8):
        expected = [line for start, line in steps if start <= rays][-1]
        assert expected.total(rays) == min(line.total(rays) for line in (QUICK, MIDDLE, SLOW, never))


def test_the_upper_bound_of_a_rate():
    assert costs.upper_bound(0, 3000) == pytest.approx(3 / 3000, rel=0.01)
    assert costs.upper_bound(5, 3000) > 10 / 3000
    assert costs.upper_bound(7, 7) == 1
    assert costs.upper_bound(0, costs.rays_for(1e-3)) <= 1e-3 < costs.upper_bound(0, costs.rays_for(1e-3) - 2)


# ---- which candidates ----

KNOWN = {c.spec.split("(")[0] for c in (*candidates.EXACT_ENOUGH, *candidates.SMALL, *candidates.INEXACT)}


def specs(primitives=1000, max_error=0.0, memory=0, numerics=None, known=KNOWN, also=()):
    return [c.spec for c in candidates.chosen(primitives, max_error, memory, numerics, known, also)]


def test_candidates_are_those_that_the_wishes_leave():
    assert not any("embree" in s or "fast" in s for s in specs())
    assert "embree" in specs(max_error=1e-3)
    assert "bvh_wide(nodes=quantized8)" in specs(memory=1000) and "bvh_wide(nodes=quantized8)" not in specs()
    assert "brute" in specs(primitives=20) and "brute" not in specs()
    assert "embree" not in specs(max_error=1e-3, known=KNOWN - {"embree"})
    assert specs(also=["grid(density=4)"])[-1] == "grid(density=4)"


def test_double_takes_the_place_of_float():
    of = specs(numerics="double", max_error=1e-3)
    assert all("numerics=double" in s for s in of)
    assert "bvh_wide(builder=sweep,numerics=double)" in of and "bvh_morton(numerics=double)" in of
    named = {c.spec for c in candidates.chosen(9, 0, 0, "double", KNOWN)}
    assert all(c.after in named for c in candidates.chosen(9, 0, 0, "double", KNOWN) if c.after)


# ---- the search ----


class FakeTrials:
    """Lines of cost with noise and a machine whose speed drifts."""

    training_rays = 16384
    facts = {"scene": "made up", "primitives": 1000, "memory_limit": 10**6, "sets": [{"set": "camera", "share": 1.0}]}

    def __init__(self, lines, claims=None, noise=0.02):
        self._lines, self._claims = {line.spec: line for line in lines}, claims or {}
        self._lines["bvh_wide"] = Line("bvh_wide", 0.03, 220)  # the anchor
        self._random, self._noise = np.random.default_rng(1), noise
        self.trees, self.traced, self.asked = {}, {}, 0

    def build(self, spec, seconds=1e9):
        line = self._lines[spec]
        if line.build > seconds:
            return Built(spec, seconds, stopped="takes too long to build")
        self.trees[len(self.trees) + 1] = spec
        return Built(spec, line.build, len(self.trees), line.bytes, self._claims.get(spec, "watertight"))

    def time(self, trees, rays, rounds=1, held_out=False, seconds=1e9):
        self.asked += 1
        drift = 1 + 0.5 * np.sin(self.asked)  # twice as slow at times
        for tree in trees:
            self.traced[self.trees[tree]] = self.traced.get(self.trees[tree], 0) + rays * rounds
        noise = np.exp(self._noise * self._random.standard_normal((len(trees), rounds)))
        return drift * noise * np.array([[self._lines[self.trees[t]].ray] for t in trees])

    def judge(self, tree, rays):
        return {"mix": {"rays": rays, "errors": 0}, "aimed": {"rays": rays, "errors": 0}, "broken": ""}

    def drop(self, *trees):
        pass


def search(lines, rays, trials=None, **more):
    rows = more.pop("rows", None) or [Candidate(line.spec, "a test") for line in lines]
    return Search(trials or FakeTrials(lines), rows, rays, more.pop("seconds", 60), **more)


MANY = [QUICK, MIDDLE, SLOW, *(Line(f"like_{i}", 0.03 + i / 1000, 210 + 20 * i) for i in range(8))]


@pytest.mark.parametrize(("rays", "expected"), [(1e4, "quick"), (1e6, "middle"), (1e8, "slow")])
def test_the_cheapest_wins_whatever_the_machine_does(rays, expected):
    found = search(MANY, rays)
    ranked = found.run()
    assert ranked[0].spec == expected
    lines = {c.spec: c.line() for c in found.all if c.measured}
    assert lines["quick"].ray / ranked[0].line().ray == pytest.approx(
        QUICK.ray / {"quick": 300, "middle": 200, "slow": 100}[expected], rel=0.1
    )


def test_what_cannot_win_costs_little():
    trials = FakeTrials([QUICK, SLOW, Line("bad", 0.01, 30000)])
    found = search([QUICK, SLOW, Line("bad", 0.01, 30000)], 1e5, trials)
    assert found.run()[0].spec == "quick"
    out = {c.spec: c.out for c in found.all}
    assert out["slow"] == "building alone takes longer than all of the best" and "slow" not in trials.traced
    assert trials.traced["bad"] < 1000 and "first look" in out["bad"]


def test_memory_admission_and_those_tried_only_after_others():
    lines = [Line("big", 0.01, 100, 9000), Line("leaky", 0.01, 100, 10), Line("fits", 0.02, 200, 500)]
    lines += [Line("after_fits", 0.02, 150, 500), Line("after_big", 0.02, 90, 500)]
    rows = [Candidate(line.spec, "a test", after=line.spec.partition("after_")[2]) for line in lines]
    trials = FakeTrials(lines, {"leaky": "inexact"})
    found = search(
        lines, 1e6, trials, rows=rows, memory=1000, admits=lambda built: built.claims == "watertight", seconds=60
    )
    assert [c.spec for c in found.run()] == ["after_fits", "fits"]
    out = {c.spec: c.out for c in found.all}
    assert "MB" in out["big"] and "inexact" in out["leaky"] and "not near" in out["after_big"]


def test_trees_that_are_kept_leave_room_for_the_next():
    lines = [Line(f"like_{i}", 0.03, 210 - 10 * i, 300_000) for i in range(5)]
    found = search(lines, 1e6)
    assert [c.spec for c in found.run()] == ["like_4"]
    assert [c.out != "" for c in found.all] == [True] * 4 + [False]


def test_a_spent_budget_leaves_the_first_and_says_so():
    found = search(MANY, 1e6, seconds=0)
    assert [c.spec for c in found.run()] == ["quick"] and found.over()
    assert all("time" in c.out for c in found.all[1:])


# ---- sentences ----

SCENE = {
    "primitives": 1000,
    "bounds": {"lo": [-1, -1, -1], "hi": [1, 1, 1]},
    "needs": {
        "shadow_rays": {"needed": True, "why": "there is a light"},
        "textures": {"needed": False, "why": "there are no texture coordinates"},
        "smallest_feature_ulp": 5000.0,
    },
}


def advised(**arguments):
    trials = FakeTrials(MANY)
    rays = arguments.pop("rays", 3 * 10**6)
    found = search(MANY, rays, trials)
    ranked = found.run()
    words = {"max_error": 0.0, "memory": 0, "rays": rays, "rebuild_every": 1, **arguments}
    judged = {"mix": {"rays": 4096, "errors": 0, "t_error_max": 1.7}, "aimed": {"rays": 4096, "errors": 3}}
    admission = type("Admission", (), {"bounds": {}, "can_be_shown": False, "rays": 1000})
    return advice.Advice(
        type("Arguments", (), words), trials.facts, SCENE, advice.Precision.of(SCENE), rays, ranked, found.all, judged,
        admission, False, {"embree": 0.8}, "Take error-bound.",
    )  # fmt: skip


def test_the_sentences_say_what_was_measured():
    text = advice.text(advised())
    assert text.startswith("Take middle\n")
    assert "quick builds in 10 ms, but takes 1.5" in text and "slow would save" in text
    assert "from 0 to " in text and "million on: slow" in text
    assert "textures: there are no texture coordinates" in text and "The picture needs shadow rays." in text
    assert "3 of 4,096 aimed at edges and vertices were wrong" in text and "embree 0.80" in text
    assert (
        "Float is enough: 99 % of the triangles are larger than 5,000 spacings" in text and "Take error-bound." in text
    )


def test_a_rate_that_cannot_be_shown_is_said_and_frames_are_multiplied():
    text = advice.text(advised(max_error=1e-7, rebuild_every=4, rays=10**6))
    assert "So low a rate cannot be shown by 1,000 rays" in text and "(4 frames of 1 million)" in text


def test_json_has_the_same_advice():
    of = advised().as_json()
    assert of["advice"]["structure"] == "middle" and [s["structure"] for s in of["cheapest_by_rays"]][0] == "quick"
    assert of["advice"]["total_seconds"] <= min(r["total_seconds"] for r in of["runners_up"])
    json.dumps(of, allow_nan=False)


@pytest.mark.parametrize(
    ("small", "numerics", "words"),
    [(5000, None, "Float is enough"), (5, "double", "made in double"), (1, None, "No arithmetic can save")],
)
def test_which_precision_a_scene_requires(small, numerics, words):
    precision = advice.Precision(small, small, 1.0)
    assert precision.numerics == numerics and words in precision.sentences()[0]


def test_sizes_are_in_spacings_of_float():
    far = {**SCENE, "bounds": {"lo": [1048576, 0, 0], "hi": [1048578, 1, 1]}, "triangle_area": {"percent_1": 0.5}}
    precision = advice.Precision.of(far)
    assert precision.small == float(1 / np.spacing(np.float32(1048578)))
    assert "1,048,578 times" in precision.sentences()[1]


def test_one_sliver_does_not_decide():
    precision = advice.Precision(5000, 1e-9, 1.0)
    assert precision.numerics is None and "shortest edge of all is 1e-09" in precision.sentences()[1]


# ---- what is tuned ----

PARAMETERS = [
    {"name": "numerics", "type": "choice", "choices": ["fast", "exact"], "default": "exact", "approximate": True},
    {"name": "rule", "type": "choice", "choices": ["a", "b"], "default": "b", "approximate": False},
    {"name": "mailbox", "type": "bool", "default": False, "approximate": False},
    {"name": "cells", "type": "integer", "default": 0, "lo": 0, "hi": 4096, "logarithmic": False, "approximate": False},
    {"name": "leaf", "type": "integer", "default": 8, "lo": 1, "hi": 4096, "logarithmic": False, "approximate": False},
    {"name": "cost", "type": "number", "default": 1.5, "lo": 0.0, "hi": 100.0, "logarithmic": False, "approximate": False},
    {"name": "bonus", "type": "number", "default": 0.1, "lo": 0.0, "hi": 1.0, "logarithmic": False, "approximate": False},
]  # fmt: skip


def test_what_changes_answers_or_was_given_is_not_tuned():
    names = [p["name"] for p in space.tunable(PARAMETERS, space.Spec.parse("x(rule=a, leaf=3)"))]
    assert names == ["mailbox", "cells", "cost", "bonus"]


def test_suggestions_stay_in_range_and_the_default_is_one():
    import optuna

    optuna.logging.set_verbosity(optuna.logging.ERROR)
    parameters = space.tunable(PARAMETERS, space.Spec.parse("x"))
    seen = []

    def objective(trial):
        seen.append({p["name"]: space.suggest(trial, p) for p in parameters})
        return 0.0

    study = optuna.create_study(sampler=optuna.samplers.TPESampler(seed=1))
    study.enqueue_trial(space.defaults(parameters))
    study.optimize(objective, n_trials=60)
    assert space.changed(parameters, seen[0]) == {}
    numbers = [p for p in parameters if "lo" in p]
    assert all(p["lo"] <= values[p["name"]] <= p["hi"] for p in numbers for values in seen)
    assert {values["cells"] == 0 for values in seen} == {True, False}  # "by the rule" is no small number
    assert sum(values["leaf"] < 64 for values in seen) > 15  # on a logarithmic scale


def test_specs_and_files():
    spec = space.Spec.parse(" grid( density = 4 ,rule=woo)")
    assert spec.with_values({"mailbox": True}) == "grid(density=4,rule=woo,mailbox=true)"
    assert space.Spec.parse("grid").with_values({}) == "grid"
    with pytest.raises(RunError):
        space.Spec.parse("grid(density=4")
    read = tomllib.loads(toml("grid(density=4.5,rule=woo,mailbox=true)", ["why"]))
    assert read == {"grid": {"density": 4.5, "rule": "woo", "mailbox": True}}


# ---- the real program ----


def call(*words, code=0):
    # The program's own Python may be another one than that of the tests.
    environment = {**os.environ, "RAYBENCH_PYTHON": sys.executable}
    done = subprocess.run([RAYBENCH, *map(str, words)], capture_output=True, text=True, env=environment)
    assert done.returncode == code, done.stdout + done.stderr
    return done


TINY = "icosphere(level=2)"


@needs_program
def test_trials_answer_line_by_line():
    with Trials(RAYBENCH, TINY, mix="camera=1,diffuse=3", rays=1024) as trials:
        assert [(s["set"], s["share"]) for s in trials.facts["sets"]] == [("camera", 0.25), ("diffuse", 0.75)]
        tree, other = trials.build("bvh_sah").tree, trials.build("brute").tree
        ns = trials.time([tree, other], 512, 3)
        assert ns.shape == (2, 3) and np.median(ns[1]) > np.median(ns[0]) > 0
        judged = trials.judge(tree, 256)
        assert judged["broken"] == "" and judged["mix"]["rays"] >= 256 and judged["mix"]["errors"] == 0
        trials.drop(tree)
        for request in ({"time": [tree], "rays": 64}, {"build": "nope"}, {"jugde": 1}):
            with pytest.raises(RunError):
                trials._ask(**request)
        assert "too long" in trials.build("kdtree_sah", 0).stopped or trials.build("kdtree_sah", 0).tree
    with pytest.raises(TrialsEnded):
        Trials(RAYBENCH, "no_such_scene")


@needs_program
def test_halves_of_the_rays_depend_on_the_seed_alone():
    def facts(seed):
        with Trials(RAYBENCH, TINY, rays=1024, seed=seed) as trials:
            judged = trials.judge(trials.build("bvh_sah(numerics=fast)").tree, 512)
            return trials.facts["sets"], judged

    assert facts(3) == facts(3)


@needs_program
def test_tune_writes_what_run_takes(tmp_path):
    words = ["tune", TINY, "--structure", "grid(rule=regular)", "--evaluations", 6, "--rays", "10M"]
    out = call(*words, "--out", tmp_path / "tuned").stdout
    tuned = json.loads((tmp_path / "tuned" / "tune.json").read_text())
    assert tuned["evaluations"] == 6 and tuned["tuned"].startswith("grid(rule=regular") and tuned["gain"] > 0
    assert "points" in out and (tmp_path / "tuned" / "trials.csv").read_text().count("\n") == 7
    file = tmp_path / "tuned" / "tuned.toml"
    quick = ["--quick", "--rays", "1K", "--threads", "1", "--budget", "0.001", "--repetitions", "1", "--sets", "camera"]
    call("run", TINY, "--structures", "grid", "--params", file, *quick, "--no-report", "--out", tmp_path / "run")
    run = json.loads((tmp_path / "run" / "run.json").read_text())
    assert "regular" in json.dumps(run["structures"])


@needs_program
def test_advise_says_what_to_take(tmp_path):
    out = call("advise", TINY, "--rays", "1M", "--seconds", 3, "--no-offset", "--out", tmp_path).stdout
    found = json.loads((tmp_path / "advice.json").read_text())
    assert out.startswith(f"Take {found['advice']['structure']}\n")
    assert found["judged"]["mix"]["errors"] == 0 and found["rays"] == 2**20
    assert tomllib.loads((tmp_path / "advised.toml").read_text())


@needs_program
@pytest.mark.parametrize(
    ("words", "line"),
    [
        (["tune", TINY, "--structure", "grid(depth=3)"], "has no parameter 'depth'"),
        (["tune", TINY, "--structure", "brute"], "no parameter to tune"),
        (["tune", TINY, "--structure", "grid", "--evaluations", "0"], "from 2 to"),
        (["tune", TINY, "--structure", "grid", "--mix", "camera=-1"], "weight"),
        (["advise", TINY, "--memory", "64", "--no-offset"], "no candidate fits into so few bytes"),
        (["advise", TINY, "--max-error", "2"], "from 0 to 1"),
        (["advise", TINY, "--seconds", "0"], "from 0.1"),
        (["advise", "no_such_scene"], "unknown scene"),
        (["advise", TINY, "--also", "grid(x=1)"], "has no parameter 'x'"),
        (["advise", TINY, "--out", "/dev/null/x"], "/dev/null is no folder that can be"),
        (["tune", TINY, "--structure", "grid", "--out", "/dev/null/x"], "/dev/null is no folder that can be"),
        (["tune", TINY, "--structure", "bvh_sah(numerics=exact,fma=true)"], "numerics=exact has no fused form"),
    ],
)
def test_wrong_input_is_one_line(words, line):
    done = call(*words, code=2)
    assert line in done.stderr and done.stderr.count("\n") == 1 and done.stdout == ""


@needs_program
def test_params_file_goes_behind_what_is_typed(tmp_path):
    file = tmp_path / "p.toml"
    for text, line in [
        ("[grid]\ndensity = 'x'\n", "density=x is not allowed"),
        ("[grid]\nnope = 1\n", "has no parameter 'nope'"),
        ("grid = 1\n", "must be a table"),
        ("[grid\n", "not TOML"),
        ("[octree]\ndepth = 3\n", "has none of the structures"),
    ]:
        file.write_text(text)
        done = call("run", TINY, "--structures", "grid", "--params", file, "--out", tmp_path / "run", code=2)
        assert line in done.stderr and done.stderr.count("\n") == 1
    file.write_text("[grid]\ndensity = 4.0\nmailbox = true\n")
    quick = ["--quick", "--rays", "1K", "--threads", "1", "--budget", "0.001", "--repetitions", "1", "--sets", "camera"]
    structures = "grid,grid(density=1),bvh_sah"
    call("run", TINY, "--structures", structures, "--params", file, *quick, "--no-report", "--out", tmp_path / "run")
    cases = (tmp_path / "run" / "cases.csv").read_text()
    assert "grid(density=4,mailbox=true)" in cases and "grid(mailbox=true)" in cases
