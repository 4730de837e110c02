"""Folders of extremes, verify, crossings, fuzz, check-plugin, check and history on the page."""

import csv
import json

import numpy as np
import pytest
from made_up import full_run, write_run
from raybench_report import columns, figures, report, results
from raybench_report.__main__ import main
from raybench_report.charts import extremes as charts
from raybench_report.kinds import all_kinds, check, extremes, history
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


def write_check(directory, verdict="fail", comparisons=40, differences=1, **changes):
    """A folder of check: as many comparisons, of which the first is slower than allowed where it fails."""
    directory.mkdir(parents=True, exist_ok=True)
    rows = [
        {"name": f"soup / s{i} / camera", "scene": "soup", "structure": f"s{i}", "ray_set": "camera", "order": "traced",
         "query": "closest", "threads": 1, "tolerance": 0.02, "verdict": verdict if i == 0 else "pass",
         "log_ratio": 0.05 if i == 0 else -0.001 * i, "lo": 0.04 if i == 0 else -0.05, "hi": 0.06 if i == 0 else 0.01}
        for i in range(comparisons)
    ]  # fmt: skip
    differ = [
        {"case": f"soup / s{i} / camera", "figure": "steps", "old": 10, "new": 11, "change": 0.1}
        for i in range(differences)
    ]
    info = {
        "format": 1, "verdict": verdict, "exact": {"cases": 7, "differences": differ}, "seconds": 3.0,
        "time": {"pairs": 45, "unit": "pairs", "comparisons": rows}, "notes": ["a <note>"], "commands": ["old run", "new run"],
    }  # fmt: skip
    (directory / "check.json").write_text(json.dumps(info | changes))
    return directory


def test_a_check_says_its_verdict_first_and_shows_the_worst(tmp_path):
    folder = write_check(tmp_path / "c")
    text = made(folder, out=tmp_path / "page.html")
    answer = text[text.index('<li class="refused">') : text.index("</li>")]
    assert (
        "fail. One exact figure differs in 7 cases; of 40 times, over 45 pairs, 1 are slower than allowed, 39 are not"
        in answer
    )
    assert "<code>soup / s0 / camera</code>, +5.13 % [+4.08 %, +6.18 %]" in answer
    assert (
        '<td class="bad">FAIL</td>' in text
        and "<td>+10 %</td>" in text
        and "a &lt;note&gt;" in text
        and "<code>new run</code>" in text
    )
    found = report.read([folder], all_kinds())
    worst, everything = check.sections(found, found.others)[0].charts
    assert len(worst.rows) == 30 < len(everything.rows) == 40
    row = worst.rows.iloc[0]
    assert row["spec"] == "s0" and row["slower"] == pytest.approx(5.127, abs=1e-3) and row["allowed"] == 2
    assert figures.drawn(everything, everything.rows).startswith("<svg")


def test_a_check_without_times_or_without_a_decision_says_so(tmp_path):
    text = made(write_check(tmp_path / "e", "pass", 0, 0), out=tmp_path / "e.html")
    assert (
        '<li class="correct">' in text and "All exact figures are the same in 7 cases; no times were compared" in text
    )
    folder = write_check(tmp_path / "u", "inconclusive", 2, 0)
    info = json.loads((folder / "check.json").read_text())
    for row in info["time"]["comparisons"]:
        row |= {"verdict": "inconclusive", "log_ratio": None, "lo": None, "hi": None}
    (folder / "check.json").write_text(json.dumps(info))
    text = made(folder, out=tmp_path / "u.html")
    assert '<li class="neutral">' in text and "2 are undecided" in text and "The worst" not in text
    for spoilt, says in (({"format": 9}, "format 9"), ({"verdict": "maybe"}, "maybe"), ({"time": None}, "not what")):
        assert main([str(write_check(tmp_path / "u", **spoilt))]) == 2, says


def write_history(store, days=24, slower=1.2):
    """A store of one machine: `own` becomes slower on the tenth day, `library` stays."""
    for day in range(days):
        own = 100 * (slower if day >= 9 else 1) * (1 + 0.002 * (day % 3))
        cases = [
            {
                "case": ["soup", spec, "camera", "traced", "closest", 1],
                "ns": ns,
                "lo": ns * 0.99,
                "hi": ns * 1.01,
                "anchor_ns": 50.0,
            }
            for spec, ns in (("own", own), ("library", 50.0))
        ]
        entry = {"format": 1, "started": f"2026-01-{day + 1:02}T00:00:00Z", "commit": f"c{day + 1:03}", "fingerprint": "ab" * 8,
                 "cpu": "a <CPU>", "cases": cases}  # fmt: skip
        path = store / entry["fingerprint"] / f"2026-01-{day + 1:02}T00-00-00Z-c{day + 1:03}.json"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(entry))
    return store


def test_a_history_names_the_commit_of_a_change_and_draws_levels(tmp_path):
    store = write_history(tmp_path / "store")
    text = made(store, out=tmp_path / "page.html")
    assert (
        "24 runs, 1 of 2 cases changed level, most by +20.0 % at <code>c010</code>" in text and "a &lt;CPU&gt;" in text
    )
    found = report.read([store], all_kinds())
    ((chart,),) = [section.charts for section in history.sections(found, found.others)]
    own = chart.rows[chart.rows["spec"] == "own"]
    assert own["case"].iloc[0] == chart.rows["case"].iloc[0] == "own · camera · soup"  # what changed comes first
    assert list(own["level"].round(2).unique()) == [2.0, 2.4] and own["lo"].iloc[0] == pytest.approx(1.98)
    assert set(chart.rows.loc[chart.rows["spec"] == "library", "value"]) == {50}  # the anchor itself: in ns
    short = made(write_history(tmp_path / "short", 3), out=tmp_path / "short.html")
    assert "3 runs, fewer than 6, so no change can be told from noise" in short


def write_offset(directory, safe=1):
    directory.mkdir()
    names = [name for name, *_ in columns.columns_of("offset.csv")]
    row = dict.fromkeys(names, "") | {
        "scene": "ball", "primitives": 20, "structure": "bvh_wide", "spec": "bvh_wide", "cure": "skip", "role": "named",
        "rays": 1000, "self_hits": 1 - safe, "lost": 0, "safe": safe, "ns_per_ray": 300,
    }  # fmt: skip
    with open(directory / "offset.csv", "w", newline="") as file:
        writer = csv.DictWriter(file, names)
        writer.writeheader()
        writer.writerow(row)
    facts = {"format": columns.FORMAT, "advice": "Take skip.", "command_line": ["raybench", "offset", "ball"]}
    facts |= {"machine": {"cpu": "Abacus 1"}, "rows": [row]}
    (directory / "offset.json").write_text(json.dumps(facts))
    return directory


@pytest.mark.parametrize(("safe", "says"), [(1, "Each scene has a cure"), (0, "No cure of self-intersection is safe")])
def test_safe_offsets_with_the_machine_that_the_menu_leads_to(tmp_path, safe, says):
    folder = write_offset(tmp_path / "offsets", safe)
    assert main([str(folder)]) == 0
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert says in page and "ball: Take skip." in page
    assert 'href="#machine">Machine</a>' in page and "Abacus 1" in page and "raybench offset ball" in page


def test_folders_of_every_kind_fit_on_one_page(folder, tmp_path):
    run = write_run(tmp_path / "run", full_run())
    others = [
        write_verify(tmp_path / "v"),
        write_fuzz(tmp_path / "f"),
        write_check(tmp_path / "c"),
        write_history(tmp_path / "h"),
    ]
    text = made(run, folder, *others, out=tmp_path / "page.html")
    places = [
        text.index(f'<section id="{name}"')
        for name in ("structures", "speed", "verify", "extremes", "fuzz", "check", "history", "rays", "machine")
    ]
    assert places == sorted(places)


def test_charts_of_extremes_can_be_drawn_for_paper(folder):
    for name in SUITES:
        chart, rows = chart_of(folder, name)
        spec = figures.specification(chart, rows)
        assert len(spec["data"]["values"]) == len(rows) and np.isfinite(rows["at"]).all()
