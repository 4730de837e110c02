"""The exact part of `raybench check`, tolerances, and what it prints and writes: on made-up result folders."""

import json
from xml.etree import ElementTree

import numpy as np
import pytest
from raybench_report import columns
from raybench_report.__main__ import main
from raybench_report.decide import decision, exact, output, samples, tolerance
from raybench_report.results import RunError

SETS = [("camera", "closest"), ("shadow.0", "any")]
SPECS = ["bvh_sah", "embree"]


def write_run(folder, change=None, sessions=1, slower=None, without_effect=(), seed=1):
    """A result folder with two structures; `change(row)` may alter rows, `slower` maps specs to factors."""
    folder.mkdir(parents=True)
    rng = np.random.default_rng(seed)
    names = [name for name, *_ in columns.columns_of("cases.csv")]
    rows, sample_rows = [], []
    for spec in SPECS:
        for ray_set, query in [("build", "build"), *SETS]:
            row = dict.fromkeys(names, "")
            row |= {
                "case_id": f"{len(rows):016x}", "scene": "soup", "scene_hash": "5c", "primitives": 500, "structure": spec,
                "spec": spec, "params": "leaf_size=4", "ray_set": ray_set, "query": query, "threads": 1, "seed": 1,
                "status": "timed", "claim": "watertight", "node_bytes": 4096, "tree_digest": "7ee" if spec != "embree" else "",
            }  # fmt: skip
            if query != "build":
                row |= {"order": "traced", "rays": 1024, "timed_rays": 1024, "hits": 700, "hits_digest": "d1" + ray_set,
                        "steps": 20.5, "exact": 1024, "leak": 0}  # fmt: skip
            if change:
                change(row)
            base = (100.0 if query != "build" else 1e6) * (slower or {}).get(spec, 1.0)
            row |= {"median_ns": base, "lo_ns": base * 0.99, "hi_ns": base * 1.01, "samples": 3, "rate": 1e9 / base}
            rows.append(row)
            for session in range(sessions):
                for sample in range(3):
                    ns = base * np.exp(rng.normal(0, 0.003)) * (1 if query == "build" else 1024)
                    sample_rows.append({
                        "case_id": row["case_id"], "scene": "soup", "structure": spec, "spec": spec, "ray_set": ray_set,
                        "query": query, "threads": 1, "sample": sample, "sequence": sample, "passes": 1,
                        "rays": row["timed_rays"], "seconds": ns * 1.1e-9, "cpu_seconds": ns * 1e-9, "process": 0, "session": session,
                    })  # fmt: skip
    for name, table in (("cases.csv", rows), ("samples.csv", sample_rows)):
        lines = [",".join(table[0])] + [",".join(str(value) for value in row.values()) for row in table]
        (folder / name).write_text("\n".join(lines) + "\n")
    info = {
        "format": columns.FORMAT, "started": f"2026-01-{seed:02d}T00:00:00Z", "build": {"commit": f"c{seed:03d}"},
        "machine": {"cpu": "a CPU", "logical_cpus": 2}, "without_effect": list(without_effect), "machine_state": [],
        "structures": [{"spec": "bvh_sah", "family": "BVH"}, {"spec": "embree(robust=true)", "family": "library"}],
    }  # fmt: skip
    (folder / "run.json").write_text(json.dumps(info))
    return folder


def check(*words):
    return main(["check", *map(str, words)])


def test_the_same_run_passes_by_its_exact_figures(tmp_path):
    a, b = write_run(tmp_path / "a"), write_run(tmp_path / "b", seed=2)
    assert check(a, b, "--exact-only") == 0


def test_times_of_separate_runs_decide_nothing(tmp_path, capsys):
    a, b = write_run(tmp_path / "a"), write_run(tmp_path / "b", slower={"bvh_sah": 3})
    assert check(a, b) == 3
    assert "--run" in capsys.readouterr().out


def test_the_first_folder_that_is_not_there_is_named(tmp_path, capsys):
    assert check(tmp_path / "nope", tmp_path / "nope2") == 2
    error = capsys.readouterr().err
    assert error.startswith("raybench: ") and f"{tmp_path}/nope/" in error and "nope2" not in error


def one_more_visit(row):
    """One node more for one ray in a thousand of one set."""
    if row["spec"] == "bvh_sah" and row["ray_set"] == "camera":
        row["steps"] += 0.001


def other_tree(row):
    if row["tree_digest"]:
        row["tree_digest"] = "7ef"


def one_leak(row):
    if row["query"] == "closest" and row["spec"] == "bvh_sah":
        row["leak"], row["exact"] = 1, 1023


def refused(row):
    if row["spec"] == "bvh_sah":
        row["status"] = "refused"


@pytest.mark.parametrize(
    "change, figures",
    [(one_more_visit, ["steps"]), (other_tree, ["tree_digest"]), (one_leak, ["leak", "exact"]), (refused, ["status"])],
)
def test_any_exact_difference_fails_and_is_named(tmp_path, capsys, change, figures):
    a, b = write_run(tmp_path / "a"), write_run(tmp_path / "b", change)
    assert check(a, b, "--exact-only") == 1
    out = capsys.readouterr().out
    for figure in figures:
        assert f"  {figure}  " in out
    assert "soup / bvh_sah" in out


def test_a_case_that_is_gone_or_new_is_a_difference():
    one, two = (
        samples.Comparison("s", "a", "camera", "traced", "closest", 1),
        samples.Comparison("s", "b", "", "", "", 1),
    )
    names = frozenset(["hits", "prims"])
    make = lambda cases: exact.Figures(cases, names)  # noqa: E731
    found = exact.differences(make({one: {"hits": 1}}), make({two: {"hits": 1}}))
    assert [(d.comparison, d.old, d.new) for d in found] == [(one, "there", None), (two, None, "there")]
    found = exact.differences(make({one: {"hits": 1}}), make({one: {"prims": 2.5}}))
    assert [(d.figure, d.old, d.new) for d in found] == [("hits", 1, None), ("prims", None, 2.5)]


def test_a_baseline_is_written_checked_and_accepted_anew_with_its_reason(tmp_path, capsys):
    run, base = write_run(tmp_path / "a"), tmp_path / "base.txt"
    assert check(run, "--baseline", base) == 2  # there is none
    assert check(run, "--baseline", base, "--accept", "first figures") == 0
    assert check(run, "--baseline", base) == 0
    text = base.read_text()
    assert "embree" not in text, "figures of libraries change with their versions"
    changed = write_run(tmp_path / "b", one_more_visit, seed=3)
    assert check(changed, "--baseline", base) == 1
    assert "--accept" in capsys.readouterr().out
    assert base.read_text() == text
    assert check(changed, "--baseline", base, "--accept", " ") == 2
    assert check(changed, "--baseline", base, "--accept", "visits the root twice") == 0
    figures, accepted = exact.read_baseline(base)
    assert accepted[-1]["accepted"] == "visits the root twice"
    assert accepted[-1]["old_and_new"] == [["soup / bvh_sah / camera", "steps", 20.5, 20.501]]
    assert accepted[-1]["author"] and accepted[-1]["commit"] == "c003" and accepted[-1]["date"].endswith("Z")
    assert len(figures.cases) == 3 and len(accepted) == 2
    assert check(changed, "--baseline", base) == 0


def test_a_figure_that_another_version_had_not_is_not_compared(tmp_path):
    a, b = write_run(tmp_path / "a"), write_run(tmp_path / "b", seed=2)
    text = (a / "cases.csv").read_text()
    (a / "cases.csv").write_text(text.replace("hits_digest", "hits_hash", 1))
    assert check(a, b, "--exact-only") == 0
    (a / "cases.csv").write_text(text.replace("status", "state", 1))
    assert check(a, b, "--exact-only") == 2


def digest(text):
    def change(row):
        if row["spec"] == "bvh_sah" and row["ray_set"] == "camera":
            row["hits_digest"] = text

    return change


def test_digests_that_read_as_equal_numbers_differ(tmp_path):
    a, b = write_run(tmp_path / "a", digest("10000000000000e1")), write_run(tmp_path / "b", digest("1000000000000e02"))
    assert check(a, b, "--exact-only") == 1


@pytest.mark.parametrize("text", ["", "{}\n", '{"raybench_baseline": 9}\n', '{"raybench_baseline": 1}\nno\n'])
def test_a_broken_baseline_is_told_in_one_line(tmp_path, capsys, text):
    (tmp_path / "base.txt").write_text(text)
    assert check(write_run(tmp_path / "a"), "--baseline", tmp_path / "base.txt") == 2
    error = capsys.readouterr().err
    assert "base.txt" in error and error.count("\n") == 1


def test_ratios_to_an_anchor_are_compared_by_processes(tmp_path):
    """The second machine is three times as slow; that is no regression."""
    a = write_run(tmp_path / "a", sessions=12)
    same = write_run(tmp_path / "b", sessions=12, slower={"bvh_sah": 3, "embree": 3}, seed=2)
    slow = write_run(tmp_path / "c", sessions=12, slower={"bvh_sah": 3.3, "embree": 3}, seed=3)
    one = write_run(tmp_path / "d", slower={"bvh_sah": 3.3, "embree": 3}, seed=4)
    assert check(a, same, "--anchor", "embree") == 0
    assert check(a, slow, "--anchor", "embree") == 1
    assert check(a, one, "--anchor", "embree") == 3
    assert check(a, slow, "--anchor", "nothing") == 2


def test_parameters_without_effect_are_told(tmp_path, capsys):
    twin = {"scene": "soup", "a": "x", "b": "x(y=1)", "parameters": ["y"]}
    a, b = write_run(tmp_path / "a"), write_run(tmp_path / "b", without_effect=[twin])
    assert check(a, b, "--exact-only") == 0
    assert "parameter without effect? (y)" in capsys.readouterr().out


@pytest.mark.parametrize(
    "words", [[], ["a"], ["--run", "x", "y", "folder"], ["--run", "x"], ["--accept", "why", "a", "b"], ["--nothing"]]
)
def test_wrong_use_is_exit_code_2(tmp_path, words):
    assert check(*words) == 2


# ---- tolerances ----


def write_toml(tmp_path, text):
    path = tmp_path / "tolerance.toml"
    path.write_text(text)
    return path


def test_the_last_rule_that_fits_counts(tmp_path):
    rules = tolerance.read(write_toml(tmp_path, """
        default = 0.03
        [[rule]]
        query = "build"
        tolerance = 0.1
        [[rule]]
        structure = "kd*"
        threads = 2
        tolerance = 0.5
        """))  # fmt: skip
    at = samples.Comparison
    assert rules.of(at("s", "bvh", "camera", "", "closest", 1)) == 0.03
    assert rules.of(at("s", "bvh", "build", "", "build", 1)) == 0.1
    assert rules.of(at("s", "kdtree_sah", "build", "", "build", 2)) == 0.5


@pytest.mark.parametrize(
    "text, says",
    [
        ("defualt = 0.1", "unknown key 'defualt'"),
        ("default = 2000", "default: must be a share"),
        ("default = true", "default: must be a share"),
        ("[[rule]]\nquery = 'build'", "rule 1: lacks tolerance"),
        ("[[rule]]\nquerry = 'build'\ntolerance = 0.1", "rule 1: unknown key 'querry'"),
        ("[[rule]]\nthreads = 'two'\ntolerance = 0.1", "threads must be a number"),
        ("default =", "not TOML"),
    ],
)
def test_a_wrong_tolerance_file_is_told_with_its_key(tmp_path, text, says):
    with pytest.raises(RunError, match="tolerance.toml") as error:
        tolerance.read(write_toml(tmp_path, text))
    assert says in str(error.value)


# ---- output ----


def a_check(tmp_path):
    """A decision over three structures, one 10 % slower, one noisy."""
    rng = np.random.default_rng(1)
    ratios = rng.normal(0, 0.01, (3, 45))
    ratios[1] += np.log(1.1)
    ratios[2] *= 30
    comparisons = [samples.Comparison("soup|er", spec, "camera", "traced", "closest", 1) for spec in ("a", "b", "c")]
    look = decision.look_at(ratios, np.full(3, np.log1p(0.02)), 1)
    rows = output.time_rows(samples.Ratios(comparisons, ratios, {}), look, [0.02] * 3)
    differences = [exact.Difference(comparisons[0], "steps", 10, 11), exact.Difference(comparisons[0], "leak", 0, 5)]
    return {
        "verdict": look.verdict, "seconds": 1.5, "notes": ["a note"],
        "exact": {"cases": 3, "differences": [{"figure": d.figure} for d in differences]},
        "time": {"pairs": 45, "unit": "pairs", "comparisons": rows},
    }, differences  # fmt: skip


def test_the_worst_comes_first_in_every_output(tmp_path):
    check, differences = a_check(tmp_path)
    assert [row["verdict"] for row in check["time"]["comparisons"]] == ["fail", "inconclusive", "pass"]
    text = output.text(check, differences)
    assert text.index("soup|er / b") < text.index("soup|er / c") < text.rindex("soup|er / a")
    assert text.splitlines()[-1].startswith("fail: 2 exact figures differ in 3 cases; times of 45 pairs: 1 slower")
    output.write(tmp_path / "out", check, differences)
    markdown = (tmp_path / "out" / "check.md").read_text()
    assert markdown.startswith("### raybench check: fail") and "soup\\|er / b" in markdown
    read = json.loads((tmp_path / "out" / "check.json").read_text())
    assert read["time"]["comparisons"][0]["structure"] == "b"
    suite = ElementTree.parse(tmp_path / "out" / "junit.xml").getroot().find("testsuite")
    assert suite.get("tests") == "4" and suite.get("failures") == "2" and suite.get("skipped") == "1"
    assert len(suite.findall("testcase/failure")) == 2 and len(suite.findall("testcase/skipped")) == 1
