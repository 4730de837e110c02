"""A run in the formats of other tools."""

import math

import numpy as np

from .. import results
from . import samples

_NAME_SEPARATOR = "/"


def name_of(comparison):
    """As run names its cases for --benchmark_filter: scene/structure/ray set/order/query/threads:N."""
    c = comparison
    return _NAME_SEPARATOR.join([c.scene, c.spec, c.ray_set, c.order, c.query, f"threads:{c.threads}"])


def _timed(folder):
    cases = results.timed(samples.read_cases(folder))
    if cases.empty:
        raise results.RunError(f"{folder}: no case has a time")
    return cases


def _or_none(value):
    return None if value != value else float(value)


def google_benchmark(folder):
    """JSON of Google Benchmark, which its tools/compare.py reads: one entry a sample, in ns a ray (of builds: ns), and
    the aggregates mean, median and stddev that it shows."""
    info = results.read_info(folder / "run.json")
    cases = _timed(folder).set_index("case_id")
    table = results.read_table(folder / "samples.csv")
    machine = info.get("machine") or {}
    benchmarks = []
    families = {case_id: index for index, case_id in enumerate(cases.index)}
    for case_id, of_case in table.groupby("case_id", sort=False):
        if case_id not in cases.index:
            continue
        row = cases.loc[case_id]
        c = samples.comparison_of(row)
        scale = 1e9 / (1 if c.query == "build" else row["timed_rays"])
        common = {
            "name": name_of(c), "family_index": families[case_id], "per_family_instance_index": 0,
            "run_name": name_of(c), "repetitions": len(of_case), "threads": c.threads,
        }  # fmt: skip
        real, cpu = of_case["seconds"].to_numpy() * scale, of_case["cpu_seconds"].to_numpy() * scale
        for index, (passes, real_ns, cpu_ns) in enumerate(zip(of_case["passes"], real, cpu)):
            benchmarks.append({**common, "run_type": "iteration", "repetition_index": index, "iterations": int(passes),
                               "real_time": float(real_ns), "cpu_time": float(cpu_ns), "time_unit": "ns"})  # fmt: skip
        for aggregate, function in (("mean", np.mean), ("median", np.median), ("stddev", _deviation)):
            benchmarks.append({**common, "name": f"{name_of(c)}_{aggregate}", "run_type": "aggregate",
                               "aggregate_name": aggregate, "aggregate_unit": "time", "iterations": len(of_case),
                               "real_time": float(function(real)), "cpu_time": float(function(cpu)),
                               "time_unit": "ns"})  # fmt: skip
    return {
        "context": {
            "date": info.get("started"), "host_name": "", "executable": "raybench",
            "num_cpus": machine.get("logical_cpus"), "mhz_per_cpu": 0, "cpu_scaling_enabled": False, "caches": [],
            "load_avg": [], "library_build_type": "release",
        },
        "benchmarks": benchmarks,
    }  # fmt: skip


def _deviation(values):
    return np.std(values, ddof=1) if len(values) > 1 else 0.0


def github_action_benchmark(folder):
    """The custom JSON of github-action-benchmark, "customSmallerIsBetter"."""
    entries = []
    for _, row in _timed(folder).iterrows():
        c = samples.comparison_of(row)
        lo, hi = _or_none(row["lo_ns"]), _or_none(row["hi_ns"])
        entry = {"name": name_of(c), "unit": "ns" if c.query == "build" else "ns/ray", "value": float(row["median_ns"])}
        if lo is not None and hi is not None:
            entry["range"] = f"{lo:.6g} to {hi:.6g}"
        entry["extra"] = f"{int(row['samples'])} samples, median with its 95 % interval"
        entries.append(entry)
    return entries


def bencher(folder):
    """Bencher Metric Format: latency in ns with our interval as bounds."""
    report = {}
    for _, row in _timed(folder).iterrows():
        measure = {"value": float(row["median_ns"])}
        lo, hi = _or_none(row["lo_ns"]), _or_none(row["hi_ns"])
        if lo is not None and hi is not None and math.isfinite(hi):
            measure |= {"lower_value": lo, "upper_value": hi}
        report[name_of(samples.comparison_of(row))] = {"latency": measure}
    return report


FORMATS = {
    "google-benchmark": google_benchmark,
    "github-action-benchmark": github_action_benchmark,
    "bencher": bencher,
}
