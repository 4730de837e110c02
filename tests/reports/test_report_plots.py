"""The report on synthetic runs: which files appear, that they are deterministic, and what unfit input is told."""

import csv
import json
import random
import re
from pathlib import Path

import pytest
from raybench_report import columns, plots, predictors, results, style
from raybench_report.__main__ import main

CASES, SAMPLES = ([name for name, *_ in columns.columns_of(table)] for table in ("cases.csv", "samples.csv"))
REPORTS_README = Path(__file__).parents[2] / "reports" / "README.md"
RAY_SETS = [("camera", "closest"), ("shadow.0", "any"), ("reflection.1", "closest"), ("random", "closest")]
SPECS = {
    # ns per ray and per primitive built, steps and primitive tests per ray, share of leaks
    "null": (1.5, 0.01, 0, 0, None),
    "brute": (4e5, 2, 1, 6e4, 0),
    "bvh_sah": (400, 90, 30, 5, 0),
    "bvh_sah(numerics=fast)": (370, 90, 30, 5, 0.0004),
    "embree": (150, 60, None, None, 0.0001),
    "embree(robust=true)": (165, 60, None, None, 0),
}


def case(spec, scene, ray_set, query, noise, threads=1, **changes):
    """One row of cases.csv, as a dictionary of texts."""
    ns, build_ns, steps, prims, leaks = SPECS[spec]
    primitives, rays = 66450, 1 << 20
    median = (build_ns * primitives / threads if query == "build" else ns) * noise.uniform(0.6, 1.6)
    row = dict.fromkeys(CASES, "")
    row |= {
        "case_id": f"{noise.getrandbits(64):016x}", "scene": scene, "scene_hash": "00ff", "primitives": primitives,
        "structure": spec.partition("(")[0], "spec": spec, "params": "", "ray_set": ray_set, "query": query,
        "threads": threads, "seed": 1, "status": "timed", "claim": "nothing" if spec == "null" else "watertight",
        "node_bytes": 0 if spec in ("null", "brute") else 32 * primitives,
        "prim_bytes": 48 * primitives if spec == "bvh_sah" else 0,
        "needs_geometry": 0 if spec in ("null", "bvh_sah") else 1, "build_peak_bytes": 90 * primitives,
        "samples": 9, "median_ns": median, "lo_ns": median * 0.97, "hi_ns": median * 1.04,
        "rate": 1e9 / median * (primitives if query == "build" else 1),
    }  # fmt: skip
    if query != "build":
        row |= {"ray_hash": "0abc", "order": "traced", "rays": rays, "timed_rays": rays, "oracle": "cgal", "hits": rays // 2}
        row |= dict.fromkeys(results.VERDICTS, 0)
        if leaks is None:
            row |= dict.fromkeys(results.VERDICTS, "")
        else:
            row |= {"verified": 100000, "leak": int(100000 * leaks * noise.uniform(0.5, 2))}
            row["exact"] = 100000 - row["leak"]
        if steps is not None:
            row |= {"steps": steps * noise.uniform(0.7, 1.3), "prims": prims * noise.uniform(0.7, 1.3)}
    return row | changes


def full_run(scenes=("/models/sponza.obj", "sphereflake(depth=5)"), specs=tuple(SPECS), ray_sets=tuple(RAY_SETS)):
    """Rows of a whole run: builds with one and eight threads, queries with one."""
    noise = random.Random(7)
    rows = []
    for scene in scenes:
        for spec in specs:
            rows += [case(spec, scene, "build", "build", noise, threads) for threads in (1, 8)]
            rows += [case(spec, scene, ray_set, query, noise) for ray_set, query in ray_sets]
    return rows


def write_run(directory, rows):
    """Writes cases.csv, samples.csv and run.json of these rows."""
    directory.mkdir(exist_ok=True)
    with open(directory / "cases.csv", "w", newline="") as file:
        writer = csv.DictWriter(file, CASES)
        writer.writeheader()
        writer.writerows(rows)
    with open(directory / "samples.csv", "w", newline="") as file:
        writer = csv.DictWriter(file, SAMPLES, extrasaction="ignore")
        writer.writeheader()
        writer.writerows(row | {"sample": 0, "sequence": 0, "passes": 1, "seconds": 0.1} for row in rows)
    (directory / "run.json").write_text(json.dumps({"format": columns.FORMAT, "machine": {"processor": "<Test & Co>"}, "seed": 1}))
    return directory


def without_time(row, status, note):
    """The row as a case that got no time."""
    return row | {"status": status, "note": note, "median_ns": "", "lo_ns": "", "hi_ns": "", "rate": "", "samples": ""}


def svg_text(path):
    """All text of an SVG in one line; newlines inside a label come as separate elements."""
    return " ".join(re.findall(r"<text[^>]*>([^<]*)</text>", path.read_text(encoding="utf-8")))


@pytest.fixture(scope="module", autouse=True)
def quick_pngs():
    """Fewer dots per inch than a paper wants: most of the time goes into them."""
    style.plt.rcParams["savefig.dpi"] = 72


@pytest.fixture(scope="module")
def drawn(tmp_path_factory):
    """A whole run with its report; not to be changed."""
    run = write_run(tmp_path_factory.mktemp("drawn") / "run", full_run())
    (run / "images").mkdir()
    (run / "images" / "sponza.png").write_bytes(b"")
    assert main([str(run)]) == 0
    return run


ALL_PLOTS = {"rays_per_second", "build_time", "node_visits", "primitive_tests", "memory", "error_and_speed"}


def test_every_plot_is_there_and_not_trivial(drawn):
    run = drawn
    assert {p.name for p in (run / "plots").iterdir()} == {f"{n}.{s}" for n in ALL_PLOTS for s in ("png", "svg")}
    for name in ALL_PLOTS:
        png = (run / "plots" / f"{name}.png").read_bytes()
        assert png.startswith(b"\x89PNG") and len(png) > 3_000
        shown = svg_text(run / "plots" / f"{name}.svg")
        assert "sponza.obj" in shown and "/models" not in shown
        assert "sphereflake(depth=5)" in shown


def test_structures_are_labelled_by_spec_and_null_is_only_a_note(drawn):
    rates = svg_text(drawn / "plots" / "rays_per_second.svg")
    for spec in SPECS:
        if spec != "null":
            assert spec in rates
    assert "harness's own" in rates.replace("&apos;", "'")
    for name in ALL_PLOTS - {"rays_per_second"}:
        assert "null" not in svg_text(drawn / "plots" / f"{name}.svg")


def test_missing_counters_are_said_and_not_drawn_as_zero(drawn, tmp_path):
    shown = svg_text(drawn / "plots" / "node_visits.svg")
    assert "embree: not counted" in shown and "bvh_sah: not counted" not in shown
    embree_only = write_run(tmp_path / "embree", full_run(specs=("null", "embree")))
    assert main([str(embree_only)]) == 0
    assert not (embree_only / "plots" / "node_visits.svg").exists()
    assert (embree_only / "plots" / "rays_per_second.svg").exists()


def test_memory_that_is_not_counted_is_said(tmp_path):
    rows = [r | ({"node_bytes": "", "prim_bytes": ""} if r["structure"] == "embree" else {}) for r in full_run()]
    run = write_run(tmp_path / "run", rows)
    assert main([str(run)]) == 0
    assert "not counted" in svg_text(run / "plots" / "memory.svg")


def test_refused_and_skipped_cases_are_named(tmp_path):
    rows = full_run()
    for i, row in enumerate(rows):
        if row["structure"] == "brute" and row["query"] != "build":
            rows[i] = without_time(row, "skipped", "too slow, <really>")
        if row["spec"] == "bvh_sah" and row["ray_set"] == "camera" and "(" in row["scene"]:
            rows[i] = without_time(row, "refused", "3 leaks")
    run = write_run(tmp_path / "run", rows)
    assert main([str(run)]) == 0
    shown = svg_text(run / "plots" / "rays_per_second.svg")
    assert "brute on sponza.obj (skipped)" in shown
    assert "bvh_sah on sphereflake(depth=5) (refused)" in shown
    page = (run / "report.html").read_text()
    assert "skipped: too slow, &lt;really&gt;" in page and "refused: 3 leaks" in page
    assert "&lt;Test &amp; Co&gt;" in page


def test_one_structure_and_one_procedural_scene(tmp_path):
    run = write_run(tmp_path / "run", full_run(scenes=("sphereflake(depth=5)",), specs=("bvh_sah",)))
    assert main([str(run)]) == 0
    assert {p.stem for p in (run / "plots").iterdir()} == ALL_PLOTS


def test_many_ray_sets_structures_and_scenes(tmp_path):
    sets = [("camera", "closest"), *((f"{kind}.{depth}", "any" if kind == "shadow" else "closest")
            for kind in ("shadow", "reflection", "refraction") for depth in range(4))]  # fmt: skip
    scenes = [f"scene{i}(path=/a/b,c=$1$)" for i in range(4)]
    run = write_run(tmp_path / "run", full_run(scenes, ray_sets=sets))
    assert main([str(run)]) == 0
    shown = svg_text(run / "plots" / "rays_per_second.svg")
    assert shown.index("camera") < shown.index("shadow.0") < shown.index("shadow.3") < shown.index("refraction.0")


def test_a_long_name_of_recorded_rays_leaves_room_for_the_plot(tmp_path):
    sets = [("camera", "closest"), ("rays_of_my_engine_in_the_hall_frame_17", "any")]
    run = write_run(tmp_path / "run", full_run(ray_sets=sets))
    assert main([str(run)]) == 0
    shown = svg_text(run / "plots" / "rays_per_second.svg")
    assert "rays_of_my_…me_17 (any hit)" in shown and "in_the_hall" not in shown


def test_each_further_thread_count_gets_a_plot_of_rates(tmp_path):
    noise = random.Random(1)
    rows = full_run() + [case("bvh_sah", "sphereflake(depth=5)", "camera", "closest", noise, threads=4)]
    run = write_run(tmp_path / "run", rows)
    assert main([str(run)]) == 0
    assert "1 thread" in svg_text(run / "plots" / "rays_per_second.svg")
    assert "4 threads" in svg_text(run / "plots" / "rays_per_second_threads4.svg")


def test_errors_are_the_plain_ones_over_the_verified_rays(tmp_path):
    noise = random.Random(1)
    row = case("bvh_sah", "s", "camera", "closest", noise)
    row |= {"verified": 1000, "leak": 1, "wrong": 2, "false_miss": 3, "false_hit": 4, "wrong_marginal": 500}
    unverified = case("bvh_sah", "s", "random", "closest", noise, verified=0)
    run = results.read(write_run(tmp_path / "run", [row, unverified]))
    assert run.cases["errors"].iloc[0] == pytest.approx(0.01)
    assert run.cases["errors"].isna().iloc[1]


def test_a_scene_without_errors_and_zero_counters_can_be_drawn(tmp_path):
    rows = [r | ({"leak": 0, "steps": 0, "prims": 0} if r["query"] != "build" else {}) for r in full_run()]
    run = write_run(tmp_path / "run", rows)
    assert main([str(run)]) == 0
    assert {p.stem for p in (run / "plots").iterdir()} == ALL_PLOTS


def test_the_same_run_gives_the_same_bytes_and_leaves_only_finished_files(drawn, tmp_path):
    again = write_run(tmp_path / "run", full_run())
    (again / "plots").mkdir()
    (again / "plots" / "memory.svg").write_text("an older one")
    main([str(again)])
    assert {p.name for p in (drawn / "plots").iterdir()} == {p.name for p in (again / "plots").iterdir()}
    for path in sorted((drawn / "plots").iterdir()):
        assert path.read_bytes() == (again / "plots" / path.name).read_bytes(), path.name


def test_pictures_and_plots_are_on_the_page(drawn):
    page = (drawn / "report.html").read_text()
    for source in re.findall(r'src="([^"]*)"', page):
        assert (drawn / source).is_file()
    assert 'src="images/sponza.png"' in page and page.count("<figure>") == 1 + len(ALL_PLOTS)


def test_rows_timed_on_a_part_of_the_rays_are_named(tmp_path):
    rows = full_run(scenes=("stadium",), specs=("bvh_sah", "brute"))
    for row in rows:
        if row["spec"] == "brute" and row["query"] != "build":
            row["timed_rays"] = row["rays"] // (64 if row["ray_set"] == "camera" else 4)
    run = results.read(write_run(tmp_path / "part", rows))
    note = plots._timed_parts(results.timed(run.queries))
    assert note.endswith("would take too long: brute (down to 1/64).")
    whole = results.read(write_run(tmp_path / "whole", full_run(scenes=("stadium",), specs=("bvh_sah", "brute"))))
    assert plots._timed_parts(results.timed(whole.queries)) == ""


def test_documentation_has_the_columns_as_they_are():
    text = REPORTS_README.read_text(encoding="utf-8")
    for table in ("cases.csv", "samples.csv", "verdicts.csv", "crossings.csv", "extremes.csv"):
        assert f"\n{columns.markdown(table)}\n" in text, f"{table}: python -m raybench_report.columns has the table"


def spoil_missing_directory(run):
    return run / "absent", "no such directory"


def spoil_missing_file(run):
    (run / "cases.csv").unlink()
    return run, r"cases\.csv: missing"


def spoil_older_format(run):
    (run / "run.json").write_text(json.dumps({"machine": {}, "seed": 1}))
    return run, rf"run\.json: result format unknown; this raybench reads {columns.FORMAT}: measure again"


def spoil_missing_samples(run):
    (run / "samples.csv").unlink()
    return run, r"samples\.csv: missing"


def spoil_missing_columns(run):
    text = (run / "cases.csv").read_text().replace("median_ns", "x").replace("lo_ns", "y")
    (run / "cases.csv").write_text(text)
    return run, r"cases\.csv: missing columns: median_ns, lo_ns$"


def spoil_bad_number(run):
    rows = full_run()
    rows[2] |= {"steps": "many"}
    write_run(run, rows)
    return run, r"cases\.csv: line 4, column steps: 'many' is not a number"


def spoil_ragged(run):
    with open(run / "cases.csv", "a") as file:
        file.write("," * 100 + "\n")
    return run, r"cases\.csv: not a CSV table"


def spoil_binary(run):
    (run / "cases.csv").write_bytes(b"\xff\xfe\x00\x01" * 100)
    return run, r"cases\.csv: "


def spoil_empty(run):
    (run / "cases.csv").write_text("")
    return run, r"cases\.csv: not a CSV table"


def spoil_json(run):
    (run / "run.json").write_text("{")
    return run, r"run\.json: not JSON"


def spoil_no_run_json(run):
    (run / "run.json").unlink()
    return run, r"run\.json: missing"


def spoil_nothing_timed(run):
    write_run(run, [without_time(row, "skipped", "why not") for row in full_run()])
    return run, r"cases\.csv: nothing timed"


def spoil_no_rows(run):
    write_run(run, [])
    return run, r"cases\.csv: nothing timed"


def spoil_only_null(run):
    write_run(run, full_run(specs=("null",)))
    return run, r"cases\.csv: nothing timed"


@pytest.mark.parametrize("spoil", [f for name, f in sorted(globals().items()) if name.startswith("spoil_")])
def test_unfit_input_gets_one_line_and_exit_code_2(tmp_path, capsys, spoil):
    run, message = spoil(write_run(tmp_path / "run", full_run()))
    assert main([str(run)]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and re.search(message, error.strip()), error
    assert not (run / "report.html").exists()


def test_wrong_arguments_get_exit_code_2(capsys):
    assert main([]) == 2
    assert main(["a", "--colour", "red"]) == 2
    assert main(["--help"]) == 0
    capsys.readouterr()


def builders_run(noise=0.0):
    """Five builders on two scenes, whose times follow the SAH cost, but for noise, and have nothing to do with EPO."""
    random_source = random.Random(3)
    rows = []
    for scene, slowness in (("soup", 100), ("city", 900)):
        for i, spec in enumerate(["bvh_sah", "bvh_median", "bvh_ploc", "bvh_sweep(reinsertion=3)", "bvh_spatial"]):
            sah = 20 + 3 * i
            changes = {
                "structure": spec.partition("(")[0], "spec": spec, "sah_cost": sah,
                "epo": [5, 1, 3, 2, 4][i], "lcv": 1 + i % 2,
                "median_ns": slowness * sah * random_source.uniform(1 - noise, 1 + noise),
            }  # fmt: skip
            rows.append(case("bvh_sah", scene, "random", "closest", random.Random(i)) | changes)
            rows.append(case("bvh_sah", scene, "shadow.0", "any", random.Random(i)) | changes)
    return rows


def test_predictors_are_measured_within_scenes(tmp_path):
    run = results.read(write_run(tmp_path / "run", builders_run()))
    ((label, trees, sah, epo, lcv, both, every),) = predictors.table(run)  # any-hit rays and few trees are left out
    assert (label, trees) == ("random", 10)
    assert sah == pytest.approx(1) and both == pytest.approx(1) and every == pytest.approx(1)
    assert epo == pytest.approx(0.01, abs=1e-6)  # corr(20 + 3 i, [5, 1, 3, 2, 4]) = -0.1
    assert 0 <= lcv < 0.2
    noisy = results.read(write_run(tmp_path / "noisy", builders_run(0.2)))
    assert 0.3 < predictors.table(noisy)[0][2] < 0.99


def test_predictors_have_a_plot_and_a_table_where_several_builders_ran(tmp_path, drawn):
    run = write_run(tmp_path / "run", builders_run())
    assert main([str(run)]) == 0
    shown = svg_text(run / "plots" / "predictors.svg")
    assert "SAH cost: R² random 1.00" in shown and "EPO: R² random 0.01" in shown
    assert "Predictors of time" in (run / "report.html").read_text()
    assert "Predictors of time" not in (drawn / "report.html").read_text()
