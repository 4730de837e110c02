"""History, its change points, and exports: each against the documented format of the tool that reads it."""

import json
import os
import subprocess
import sys
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from raybench_report.__main__ import main
from raybench_report.decide import history, trend
from test_decide_exact import write_run

# https://bencher.dev/docs/reference/bencher-metric-format: names, then measures, then value and bounds
BENCHER = {
    "type": "object",
    "minProperties": 1,
    "additionalProperties": {
        "type": "object",
        "additionalProperties": {
            "type": "object",
            "required": ["value"],
            "properties": {name: {"type": "number"} for name in ("value", "lower_value", "upper_value")},
            "additionalProperties": False,
        },
    },
}
# README of benchmark-action/github-action-benchmark, "customSmallerIsBetter"
GITHUB_ACTION = {
    "type": "array",
    "minItems": 1,
    "items": {
        "type": "object",
        "required": ["name", "unit", "value"],
        "properties": {
            "name": {"type": "string"}, "unit": {"type": "string"}, "value": {"type": "number"},
            "range": {"type": "string"}, "extra": {"type": "string"},
        },
        "additionalProperties": False,
    },
}  # fmt: skip
# docs/user_guide.md of google/benchmark, and what tools/gbench reads
GOOGLE = {
    "type": "object",
    "required": ["context", "benchmarks"],
    "properties": {
        "context": {"type": "object", "required": ["date", "num_cpus", "library_build_type"]},
        "benchmarks": {
            "type": "array",
            "minItems": 1,
            "items": {
                "type": "object",
                "required": ["name", "run_name", "run_type", "repetitions", "threads", "iterations", "real_time",
                             "cpu_time", "time_unit", "family_index", "per_family_instance_index"],
                "properties": {"run_type": {"enum": ["iteration", "aggregate"]}, "time_unit": {"enum": ["ns"]},
                               "iterations": {"type": "integer"}, "real_time": {"type": "number"}},
            },
        },
    },
}  # fmt: skip


def export(folder, form, capsys):
    assert main(["history", "export", str(folder), f"--format={form}"]) == 0
    return json.loads(capsys.readouterr().out)


@pytest.mark.parametrize(
    "form, schema", [("bencher", BENCHER), ("github-action-benchmark", GITHUB_ACTION), ("google-benchmark", GOOGLE)]
)
def test_exports_are_as_documented(tmp_path, capsys, form, schema):
    exported = export(write_run(tmp_path / "a"), form, capsys)
    jsonschema.validate(exported, schema)
    names = [b["run_name"] for b in exported["benchmarks"]] if form == "google-benchmark" else (
        list(exported) if form == "bencher" else [entry["name"] for entry in exported])  # fmt: skip
    assert len(set(names)) == 6 and "soup/bvh_sah/camera/traced/closest/threads:1" in names


def test_bounds_are_the_interval(tmp_path, capsys):
    exported = export(write_run(tmp_path / "a"), "bencher", capsys)
    measure = exported["soup/bvh_sah/camera/traced/closest/threads:1"]["latency"]
    assert measure == {"value": 100.0, "lower_value": 99.0, "upper_value": 101.0}


def test_samples_are_in_ns_a_ray(tmp_path, capsys):
    exported = export(write_run(tmp_path / "a"), "google-benchmark", capsys)["benchmarks"]
    of_case = [b for b in exported if b["run_name"].startswith("soup/bvh_sah/camera")]
    assert [b["run_type"] for b in of_case] == ["iteration"] * 3 + ["aggregate"] * 3
    assert of_case[0]["cpu_time"] == pytest.approx(100, rel=0.05)
    assert of_case[0]["real_time"] == pytest.approx(110, rel=0.05)


def test_compare_py_reads_the_export(tmp_path, capsys):
    tools = os.environ.get("RAYBENCH_GOOGLE_BENCHMARK_TOOLS")
    if not tools:
        pytest.skip("RAYBENCH_GOOGLE_BENCHMARK_TOOLS names no folder with Google Benchmark's compare.py")
    for name, slower in (("a", None), ("b", {"bvh_sah": 1.5})):
        folder = write_run(tmp_path / name, sessions=4, slower=slower)
        assert (
            main(["history", "export", str(folder), "--format=google-benchmark", f"--out={tmp_path / name}.json"]) == 0
        )
    done = subprocess.run(
        [sys.executable, str(Path(tools) / "compare.py"), "--no-color", "benchmarks", f"{tmp_path}/a.json", f"{tmp_path}/b.json"],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    line = next(
        line for line in done.stdout.splitlines() if line.startswith("soup/bvh_sah/camera") and "median" in line
    )
    assert "+0.5" in line or "+0.49" in line
    assert "pvalue" in done.stdout


# ---- history ----


def test_a_history_keeps_machines_apart_and_its_page_names_the_commit_of_a_change(tmp_path, capsys):
    store = tmp_path / "history"
    for day in range(1, 13):
        run = write_run(tmp_path / f"r{day}", slower={"bvh_sah": 1.2 if day >= 8 else 1.0}, seed=day)
        assert main(["history", "add", str(run), f"--store={store}"]) == 0
        assert main(["history", "add", str(run), f"--store={store}"]) == 0  # again: it replaces itself
    other = write_run(tmp_path / "other", seed=20)
    info = json.loads((other / "run.json").read_text())
    info["machine"]["cpu"] = "another <CPU>"
    (other / "run.json").write_text(json.dumps(info))
    assert main(["history", "add", str(other), f"--store={store}"]) == 0
    found = history.read(store)
    assert sorted(len(entries) for entries in found.values()) == [1, 12]
    assert main(["history", "trend", f"--store={store}"]) == 0
    page = (store / "trend.html").read_text()
    assert "most by +20.0 % at <code>c008</code>" in page and "another &lt;CPU&gt;" in page
    assert page.count("<td>+20.0 %</td>") == 3 and "fewer than 6" in page


def test_no_history_is_told_in_one_line(tmp_path, capsys):
    assert main(["history", "trend", f"--store={tmp_path}"]) == 2
    assert "history add" in capsys.readouterr().err


def test_noise_alone_has_no_change_points_and_a_step_has_one():
    rng = np.random.default_rng(1)
    false = sum(bool(trend.change_points(np.exp(rng.normal(0, 0.02, 40)))) for _ in range(40))
    assert false <= 2
    for _ in range(10):
        values = np.exp(rng.normal(0, 0.02, 40))
        values[25:] *= 1.15
        values[10] *= 2  # an outlier is none
        assert trend.change_points(values) == pytest.approx([25], abs=1)
    assert trend.change_points(np.ones(20)) == []
    assert trend.change_points([1.0] * 10 + [1.1] * 10) == [10]
