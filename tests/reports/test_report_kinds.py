"""Folders of extremes, verify, crossings, fuzz and check-plugin on the page."""

import csv
import json

import numpy as np
import pytest
from made_up import full_run, write_run
from raybench_report import columns, figures, report, results
from raybench_report.__main__ import main
from raybench_report.charts import extremes as charts
from raybench_report.kinds import all_kinds, extremes
from test_report_page import made

PARAMS = {
    "brute": "brute(numerics=watertight)",
    "bvh_sah": "bvh_sah(numerics=watertight,bins=16)",
    "bvh_sah(numerics=fast)": "bvh_sah(numerics=fast,bins=16)",
    "embree": "embree(quality=medium,robust=false)",
    "mine": "mine(size=3)",
}
COLUMNS = [name for name, *_ in columns.columns_of("extremes.csv")]
SPECS = list(PARAMS)
SUITES = {
    "far": {"axis": "logarithmic", "magnitudes": [0, 1, 10, 100, 1000], "second": "slips through"},
    "scale": {"axis": "linear", "magnitudes": [-120, 0, 120, 128], "second": None},
    "coincident": {"axis": "logarithmic", "magnitudes": [1, 100, 10000], "second": None},
}


def row(suite, magnitude, spec, variant=""):
    """One row of extremes.csv, as a dictionary of texts."""
    n = 1000
    failures = 50 if "fast" in spec or spec == "embree" else 0
    result = dict.fromkeys(COLUMNS, "")
    result |= {
        "suite": suite, "variant": variant, "magnitude": magnitude, "in_range": int(magnitude != 1000),
        "structure": spec.partition("(")[0], "spec": spec, "params": PARAMS[spec], "triangles": 1280, "seed": 1,
    }  # fmt: skip
    if magnitude == 128:
        return result | {"status": "refused", "note": "vertex 0 is (inf, 0, 0) <too large>"}
    result |= {
        "status": "measured", "claim": "watertight", "oracle": "cgal", "rays": n, "failures": failures,
        "failure_rate": failures / n, "failure_bound": 0.065 if failures else 0.003, "t_error_p50": 0.3,
        "t_error_p99": 1.5, "t_error_max": 3, "other_primitive": failures, "depth": "" if spec == "embree" else 9,
        "node_bytes": 64000, "prim_bytes": 0, "build_ms": 1.25, "ns_per_ray": 250,
    }  # fmt: skip
    result |= dict.fromkeys(results.VERDICTS, 0) | {"exact": n - failures, "leak": failures}
    if SUITES[suite]["second"]:
        result |= {"second_rays": n, "second": 0, "second_rate": 0, "second_bound": 0.003}
    return result


def write(directory, rows):
    """Writes extremes.csv and extremes.json."""
    directory.mkdir(exist_ok=True)
    with open(directory / "extremes.csv", "w", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS)
        writer.writeheader()
        writer.writerows(rows)
    suites = [
        {"name": name, "doc": f"about {name}", "axis_title": f"{name}, in units", "axis": suite["axis"],
         "failure": "leak or plain error", "second": suite["second"], "range": "up to 100"}
        for name, suite in SUITES.items()
    ]  # fmt: skip
    (directory / "extremes.json").write_text(
        json.dumps(
            {"format": columns.FORMAT, "suites": suites, "timing": "rough", "machine": {"processor": "<Test & Co>"}}
        )
    )
    return directory


def all_rows():
    """Every suite, `scale` with two variants."""
    return [
        row(suite, magnitude, spec, variant)
        for suite, facts in SUITES.items()
        for variant in (["unit", "scaled"] if suite == "scale" else [""])
        for magnitude in facts["magnitudes"]
        for spec in SPECS
    ]


def chart_of(folder, name):
    """The chart of a suite and its rows."""
    found = extremes.read(folder)
    found.shown = "run"
    chart = next(c for c in charts.charts(found) if c.name == f"extremes_{name}")
    return chart, chart.rows


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A result of extremes; not to be changed."""
    return write(tmp_path_factory.mktemp("extremes") / "run", all_rows())


def test_every_suite_has_its_chart_and_what_is_refused_is_listed(folder, tmp_path):
    text = made(folder, out=tmp_path / "page.html")
    for name in SUITES:
        assert f'id="extremes_{name}"' in text and f"about {name}" in text
    assert "No claim was broken within the suites" in text
    assert text.count("<td>vertex 0 is (inf, 0, 0) &lt;too large&gt;") == 2  # once a variant, not once a structure
    assert "&lt;Test &amp; Co&gt;" in text


def test_what_a_suite_has_decides_its_panels(folder):
    panels = {name: set(chart_of(folder, name)[1]["panel"]) for name in SUITES}
    assert "slips through" in panels["far"] and len(panels["far"]) == 4
    assert len(panels["scale"]) == 2 * 3 and "unit: ns per ray (rough)" in panels["scale"]
    assert {"depth of the tree", "time to build, ms (rough)", "bytes per triangle"} < panels["coincident"]


def test_a_share_of_zero_stands_below_the_bound_that_was_shown(folder):
    _, rows = chart_of(folder, "far")
    rows = rows[rows["quantity"] == "share of answers that fail"]
    zero = rows[rows["value"] == 0]
    assert (zero["seen"] != "measured").all() and (zero["shown"] <= 0.003).all() and (zero["shown"] > 0.001).all()
    assert set(rows.loc[rows["value"] > 0, "shown"]) == {0.05}
    lanes = zero.groupby("arithmetic")["shown"].nunique()
    assert (lanes == 1).all() and zero["shown"].nunique() == len(lanes)


def test_magnitude_zero_stands_left_of_the_smallest(folder):
    chart, rows = chart_of(folder, "far")
    at = rows.groupby("magnitude")["at"].first()
    assert at[0] == pytest.approx(0.1) and at[1] == 1
    assert json.dumps(chart.panel).count("'0'") > 0


def test_broken_claims_are_ringed_and_listed(tmp_path):
    note = {"status": "broken", "note": "claims watertight; ray 7: org (0x1p+0)", "failures": 1, "failure_rate": 1e-3}
    rows = [r | note if (r["suite"], r["magnitude"], r["spec"]) == ("far", 10, "bvh_sah") else r for r in all_rows()]
    broken = write(tmp_path / "run", rows)
    text = made(broken, out=tmp_path / "page.html")
    assert "claims watertight; ray 7" in text and "1 claims were broken" in text
    _, rows = chart_of(broken, "far")
    assert ((rows["status"] == "broken") & rows["share"]).sum() == 2  # in both measures


def test_unfit_extremes_are_told_in_one_line(tmp_path, capsys):
    rows = all_rows()
    for name, bad, says in [
        ("empty", [], "no rows"),
        ("strange", [*rows, rows[0] | {"suite": "new"}], "says nothing of the suites new"),
        ("text", [rows[0] | {"rays": "many"}], "column rays: 'many' is not a number"),
    ]:
        assert main([str(write(tmp_path / name, bad))]) == 2
        err = capsys.readouterr().err
        assert says in err and err.count("\n") == 1


def write_verify(directory, held=1):
    """A folder of verify: two structures, two ray sets."""
    names = [name for name, *_ in columns.columns_of("verdicts.csv")]
    directory.mkdir(parents=True)
    with open(directory / "verdicts.csv", "w", newline="") as file:
        writer = csv.DictWriter(file, names)
        writer.writeheader()
        for spec in ("bvh_sah", "mine"):
            for rays in ("random", "aimed_edge"):
                row = dict.fromkeys(names, "") | dict.fromkeys(results.VERDICTS, 0) | {
                    "scene": "/a/b.obj", "structure": spec, "spec": spec, "claim": "watertight", "ray_set": rays,
                    "query": "closest", "rays": 10_000, "exact": 10_000, "held": 1, "leak_upper": 3e-4, "plain_upper": 3e-4,
                }  # fmt: skip
                if (spec, rays) == ("mine", "aimed_edge"):
                    row |= {"held": held, "leak": 0 if held else 7}
                writer.writerow(row)
    (directory / "verify.json").write_text(json.dumps({"format": columns.FORMAT}))
    return directory


def test_a_verification_lists_broken_trees_first(tmp_path):
    text = made(write_verify(tmp_path / "v", held=0), out=tmp_path / "page.html")
    assert "40,000 answers of 2 trees were judged, every one: 1 of 2 trees broke what they claim." in text
    rows = text[text.index('id="verify_rows"') :]
    assert rows.index("mine") < rows.index("bvh_sah") and '<td class="bad">NO' in rows
    fine = made(write_verify(tmp_path / "w"), out=tmp_path / "fine.html")
    assert "all trees kept what they claim" in fine and '<td class="bad">' not in fine


def test_no_wrong_answer_is_drawn_at_its_bound(tmp_path):
    found = report.read([write_verify(tmp_path / "v", held=0)], all_kinds())
    (section,) = [s for kind in all_kinds() if kind.name == "verify" for s in kind.sections(found, found.others)]
    rows = section.charts[0].rows.set_index(["spec", "ray_set"])
    assert rows.loc[("mine", "aimed_edge"), "shown"] == pytest.approx(7e-4)
    assert rows.loc[("bvh_sah", "random"), "shown"] == pytest.approx(1 - 0.05 ** (1 / 10_000))


def write_fuzz(directory, findings=(), promises=""):
    """A folder of fuzz, or with `promises` of check-plugin."""
    directory.mkdir(parents=True)
    structures = [{"structure": "mine", "cases": 12_000, "left_out": 1, "rays": 50_000}]
    info = {"seed": 3, "mode": "both", "seconds": 5.0, "structures": structures, "findings": list(findings)}
    (directory / "fuzz.json").write_text(json.dumps(info))
    if promises:
        (directory / "junit.xml").write_text(f"<testsuites><testsuite>{promises}</testsuite></testsuites>")
    return directory


def test_fuzzing_and_the_contract_of_a_plugin(tmp_path):
    finding = {
        "structure": "mine",
        "check": "closest",
        "what": "t is <wrong>",
        "file": "mine-closest.case",
        "primitives": 1,
        "rays": 1,
    }
    text = made(write_fuzz(tmp_path / "f", [finding]), out=tmp_path / "f.html")
    assert (
        "12,000 random cases with seed 3" in text and "1 promises were broken" in text and "t is &lt;wrong&gt;" in text
    )
    cases = (
        '<testcase classname="mine" name="closest"><failure message="m">x</failure></testcase>'
        '<testcase classname="mine" name="any"/><testcase classname="mine" name="ties"><skipped/></testcase>'
    )
    text = made(write_fuzz(tmp_path / "p", [finding], cases), out=tmp_path / "p.html")
    assert "Contract of a plugin: p" in text
    rows = text[text.index('id="promises_0"') :]
    assert rows.index("BROKEN") < rows.index("held") < rows.index("not asked")
    (tmp_path / "p" / "junit.xml").write_text("<")
    assert main([str(tmp_path / "p")]) == 2


def test_folders_of_every_kind_fit_on_one_page(folder, tmp_path):
    run = write_run(tmp_path / "run", full_run())
    text = made(run, folder, write_verify(tmp_path / "v"), write_fuzz(tmp_path / "f"), out=tmp_path / "page.html")
    places = [
        text.index(f'<section id="{name}"')
        for name in ("structures", "speed", "verify", "extremes", "fuzz", "rays", "machine")
    ]
    assert places == sorted(places)


def test_charts_of_extremes_can_be_drawn_for_paper(folder):
    for name in SUITES:
        chart, rows = chart_of(folder, name)
        spec = figures.specification(chart, rows)
        assert len(spec["data"]["values"]) == len(rows) and np.isfinite(rows["at"]).all()
