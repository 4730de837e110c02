"""The plots of `raybench extremes` on a synthetic result: zeros, refused and broken points, unfit input."""

import csv
import json
import re

import pytest
from raybench_report import columns, extremes, results, style
from raybench_report.__main__ import main

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


@pytest.fixture(scope="module", autouse=True)
def quick_pngs():
    """Fewer dots per inch than a paper wants: most of the time goes into them."""
    style.plt.rcParams["savefig.dpi"] = 72


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
    (directory / "extremes.json").write_text(json.dumps({"format": columns.FORMAT, "suites": suites, "machine": {"processor": "<Test & Co>"}}))
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


def svg_text(path):
    """All text of an SVG in one line."""
    return " ".join(re.findall(r"<text[^>]*>([^<]*)</text>", path.read_text(encoding="utf-8")))


@pytest.fixture(scope="module")
def drawn(tmp_path_factory):
    """A result with its report; not to be changed."""
    folder = write(tmp_path_factory.mktemp("extremes") / "run", all_rows())
    assert main(["extremes", str(folder)]) == 0
    return folder


def test_every_suite_has_its_figure_and_the_page_shows_it(drawn):
    assert {p.name for p in (drawn / "plots").iterdir()} == {f"{n}.{s}" for n in SUITES for s in ("png", "svg")}
    html = (drawn / "extremes.html").read_text(encoding="utf-8")
    for name in SUITES:
        assert (drawn / "plots" / f"{name}.png").read_bytes().startswith(b"\x89PNG")
        shown = svg_text(drawn / "plots" / f"{name}.svg")
        assert name in shown and f"{name}, in units" in shown and "0 of n" in shown and "ns per ray" in shown
        for word in ["watertight", "fast", "embree, robust=false", "brute", "bvh_sah", "embree", "mine"]:
            assert word in shown
        assert f"plots/{name}.svg" in html
    assert "None inside of the suites" in html
    assert html.count("vertex 0 is (inf, 0, 0) &lt;too large&gt;") == 2  # once a variant, not once a structure
    assert "&lt;Test &amp; Co&gt;" in html


def test_what_a_suite_has_decides_its_panels(drawn):
    assert "slips through" in svg_text(drawn / "plots" / "far.svg")
    scale = svg_text(drawn / "plots" / "scale.svg")
    assert "slips through" not in scale and "unit" in scale and "scaled" in scale and "refuses the input" in scale
    copies = svg_text(drawn / "plots" / "coincident.svg")
    assert "depth of the tree" in copies and "time to build" in copies
    assert "depth of the tree" not in scale
    found = extremes.read(drawn)
    panels = {suite["name"]: len(extremes.draw(found, suite).axes) for suite in found.suites}
    assert panels == {"far": 4, "scale": 2 * 3, "coincident": 6}


def figure_of(folder, name):
    """Failure panel of a suite and the lines of each structure in it."""
    found = extremes.read(folder)
    suite = next(s for s in found.suites if s["name"] == name)
    figure = extremes.draw(found, suite)
    colours = found.looks
    axis = figure.axes[0]
    lines = {spec: line for spec in SPECS for line in axis.lines
             if line.get_color() == colours[spec][0] and line.get_marker() == colours[spec][1] and len(line.get_xdata())}  # fmt: skip
    return axis, lines


def test_zeros_lie_in_lanes_below_every_share_and_bound(drawn):
    axis, lines = figure_of(drawn, "far")
    lanes = {spec: set(lines[spec].get_ydata()) for spec in ("brute", "bvh_sah", "mine")}
    assert all(len(lane) == 1 for lane in lanes.values())
    assert lanes["brute"] == lanes["bvh_sah"] != lanes["mine"]
    for lane in lanes.values():
        assert axis.get_ylim()[0] < min(lane) < 0.003 / 2
    assert set(lines["embree"].get_ydata()) == {0.05}
    bounds = [y for line in axis.lines if line.get_marker() == "_" for y in line.get_ydata()]
    assert bounds and set(bounds) == {0.003}


def test_magnitude_zero_stands_left_of_the_smallest(drawn):
    axis, lines = figure_of(drawn, "far")
    x = lines["embree"].get_xdata()
    assert len(x) == 5 and x[0] < x[1] and sorted(x) == list(x)
    assert axis.get_xticklabels()[0].get_text() == "0"


def test_broken_claims_are_ringed_and_listed(tmp_path):
    rows = all_rows()
    note = {"status": "broken", "note": "claims watertight; ray 7: org (0x1p+0)", "failures": 1, "failure_rate": 1e-3}
    rows = [r | note if (r["suite"], r["magnitude"], r["spec"]) == ("far", 10, "bvh_sah") else r for r in rows]
    folder = write(tmp_path / "run", rows)
    assert main([str(folder)]) == 0  # told from a run by its files
    assert "far at 10, bvh_sah: claims watertight; ray 7" in (folder / "extremes.html").read_text(encoding="utf-8")
    axis, _ = figure_of(folder, "far")
    assert sum(len(line.get_xdata()) for line in axis.lines if line.get_color() == extremes.BROKEN) == 1


def test_unfit_input_is_told_in_one_line(tmp_path, capsys):
    rows = all_rows()
    for name, change, says in [
        ("empty", lambda folder: write(folder, []), "no rows"),
        (
            "strange",
            lambda folder: write(folder, [*rows, rows[0] | {"suite": "new"}]),
            "says nothing of the suites new",
        ),
        ("text", lambda folder: write(folder, [rows[0] | {"rays": "many"}]), "column rays: 'many' is not a number"),
        ("none", lambda folder: folder.mkdir(), "missing"),
    ]:
        change(tmp_path / name)
        assert main(["extremes", str(tmp_path / name)]) == 2
        err = capsys.readouterr().err
        assert says in err and err.count("\n") == 1
