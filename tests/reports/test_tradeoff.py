"""raybench tradeoff: dominance, errors of pictures, knobs, what must be exact, the page, and the command itself."""

import csv
import json
import os
import signal
import subprocess
import sys
import time
import types
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from PIL import Image
from raybench_report import columns, results
from raybench_report.__main__ import main
from raybench_report.trade import fronts, images, knobs, renders, structures
from raybench_report.trade.pareto import DOMINATED, FRONT, UNDECIDED, Axis, median_interval, places, rate_interval

ROOT = Path(__file__).parents[2]
RAYBENCH = ROOT / "build" / "release" / "raybench"
NAMES = [name for name, *_ in columns.columns_of("tradeoff.csv")]


# ---- dominance ----


def placed(*points, better="high"):
    """points: (x, x_lo, x_hi, y, y_lo, y_hi)."""
    table = np.array(points, dtype=float).T
    return places(Axis.of(*table[:3]), Axis.of(*table[3:], better=better))


def test_what_is_better_on_both_axes_dominates_and_equal_points_do_not():
    found, by = placed(
        (0, 0, 0, 10, 10, 10), (0.1, 0.1, 0.1, 9, 9, 9), (0.1, 0.1, 0.1, 11, 11, 11), (0, 0, 0, 10, 10, 10)
    )
    assert found == [FRONT, DOMINATED, FRONT, FRONT] and by == [-1, 2, -1, -1]


def test_intervals_that_meet_decide_nothing():
    found, by = placed((0, 0, 0, 10, 9, 11), (0, 0, 0, 9.5, 8.5, 10.5), (0, 0, 0, 8, 7.5, 8.5))
    assert found == [FRONT, UNDECIDED, DOMINATED] and by == [-1, 0, 0]


def test_what_has_no_interval_is_undecided_and_a_little_worse_is_not_as_good():
    nan = float("nan")
    assert placed((0, 0, 0, 9, nan, nan), (0, 0, 0, 5, nan, nan))[0] == [FRONT, UNDECIDED]
    assert placed((0.039, 0.03, 0.05, 9, 8.9, 9.1), (0.04, 0.03, 0.05, 5, 4.9, 5.1))[0] == [FRONT, UNDECIDED]


def test_a_faster_point_with_one_more_error_does_not_dominate():
    none, one = rate_interval(0, 1000), rate_interval(1, 1000)
    found, _ = placed((0, *none, 5, 4.9, 5.1), (0.001, *one, 9, 8.9, 9.1))
    assert found == [FRONT, FRONT]


def test_lower_is_better_where_a_cost_is_the_axis():
    found, by = placed(
        (0.2, 0.2, 0.2, 1, 0.9, 1.1), (0.1, 0.1, 0.1, 2, 1.9, 2.1), (0.2, 0.2, 0.2, 3, 2.9, 3.1), better="low"
    )
    assert found == [FRONT, FRONT, DOMINATED] and by[2] == 0


def test_intervals_are_those_of_the_books():
    assert rate_interval(0, 1000) == (0, pytest.approx(1 - 0.05 ** (1 / 1000)))
    assert rate_interval(3, 1000) == pytest.approx((0.00061910, 0.0087420), rel=1e-4)  # Clopper, Pearson
    assert median_interval([5, 1, 3])[0] == 3 and np.isnan(median_interval([1, 2, 3, 4, 5])[1])
    assert median_interval(range(9)) == (4, 1, 7) and median_interval(range(6)) == (2.5, 0, 5)


# ---- pictures ----


def waves():
    y, x = np.mgrid[0:40, 0:50]
    a = 0.5 + 0.5 * np.sin(x / 5.0) * np.cos(y / 7.0)
    return a, np.clip(a + 0.1 * np.sin(x * 1.7 + y * 2.3), 0, 1)


def test_structural_similarity_is_that_of_scikit_image():
    a, b = waves()  # scikit-image 0.26: gaussian_weights, sigma 1.5, use_sample_covariance=False, data_range 1
    assert images.ssim(a, b) == pytest.approx(0.730155181218034, abs=1e-12)


def test_measures_of_a_picture():
    reference = np.full((16, 16, 3), 0.5, np.float32)
    picture = reference.copy()
    picture[3, 4] += np.float32(0.25)
    found = images.measures(picture, reference)
    assert (found["pixels"], found["differing"], found["visible"]) == (256, 1, 1 / 256)
    assert found["rmse"] == pytest.approx(0.25 / 16) and found["max_error"] == 0.25
    assert found["relmse"] == pytest.approx(0.0625 / 256 / 0.26)
    same = images.measures(reference, reference)
    assert same["rmse"] == same["differing"] == 0 and same["psnr"] is None and same["ssim"] == pytest.approx(1)
    if images.flip_evaluator:
        assert same["flip_mean"] == 0 and 0 < found["flip_mean"] < 0.1


def test_a_difference_is_black_where_there_is_none(tmp_path):
    reference = np.full((8, 8, 3), 0.5, np.float32)
    picture = reference.copy()
    picture[2, 5] = 1.0
    images.save_difference(picture, reference, tmp_path / "d.png")
    drawn = np.asarray(Image.open(tmp_path / "d.png"))
    assert drawn[2, 5].sum() > 400 and drawn.sum() == drawn[2, 5].sum()


# ---- knobs ----


def parameter(kind, default, approximate=False, **more):
    return {"type": kind, "default": default, "approximate": approximate} | more


KNOWN = {
    "bvh_sah": {
        "numerics": parameter("choice", "watertight", True, choices=["fast", "watertight"]),
        "leaf_size": parameter("integer", 16, lo=1, hi=16),
        "reinsertion": parameter("integer", 0, lo=0, hi=100),
    },
    "embree": {"robust": parameter("bool", False, True), "compact": parameter("bool", False)},
}
NEEDS = {
    "reflection_rays": {"needed": False, "why": "no material reflects"},
    "refraction_rays": {"needed": False, "why": ""},
    "shadow_rays": {"needed": True, "why": ""},
    "transmittance": {"needed": False, "why": ""},
}
FACTS = {"triangles": 100, "procedural": {}, "needs": NEEDS}


class Fake:
    """Stands for raybench."""

    def list(self, what, name=None):
        if what == "structures":
            return [{"name": name} for name in KNOWN]
        return {"parameters": [{"name": key} | p for key, p in KNOWN[name].items()]}


def chosen(text, quick=False, facts=FACTS):
    return knobs.choose(text, knobs.Structures(Fake()), facts, quick)


def test_a_structure_that_is_not_here_says_why():
    class Without(Fake):
        def list(self, what, name=None):
            absent = {"name": "vulkan_rt", "family": None, "unavailable": "this build is without it"}
            return super().list(what, name) + ([absent] if what == "structures" else [])

    structures = knobs.Structures(Without())
    assert structures.names == list(KNOWN)
    with pytest.raises(knobs.RunError, match="'vulkan_rt' is not here: this build is without it"):
        structures.parameters("vulkan_rt")


def test_knobs_become_points():
    specs = [p.spec for p in chosen("numerics").points]
    assert specs == ["bvh_sah(numerics=fast)", "bvh_sah(numerics=watertight)", *knobs.LIBRARY]
    assert [p.spec for p in chosen("bvh_sah.leaf_size=1|4").points] == ["bvh_sah(leaf_size=1)", "bvh_sah(leaf_size=4)"]
    assert [p.must_be_exact for p in chosen("bvh_sah.leaf_size=4,embree.robust").points] == [True, False, False]
    assert [p.label for p in chosen("samples=1|2").points] == [
        "1 center",
        "4 uniform",
        "4 jittered",
        "4 low-discrepancy",
    ]


def test_stored_precision_is_exact_but_for_quantised_vertices_which_are_of_triangles(monkeypatch):
    own = {
        "width": parameter("choice", "16", choices=["8", "16"]),
        "nodes": parameter("choice", "full", choices=["full", "quantized8"]),
        "leaves": parameter("choice", "copied", True, choices=["copied", "indexed", "quantized8"]),
    }
    monkeypatch.setitem(KNOWN, "bvh_wide", own)
    points = chosen("precision", quick=True).points
    assert [p.spec for p in points] == [
        "bvh_wide(width=16,nodes=full)", "bvh_wide(width=16,nodes=quantized8)",
        "bvh_wide(leaves=indexed,nodes=quantized8,width=16)", "bvh_wide(leaves=quantized8,nodes=quantized8,width=16)",
    ]  # fmt: skip
    assert [p.must_be_exact for p in points] == [True, True, True, False]
    mixed = chosen("precision", facts=FACTS | {"procedural": {"spheres": 3}})
    assert len(mixed.points) == 6 and "vertices" in mixed.left_out[0]


def test_levels_of_detail_for_all_rays_and_for_all_but_those_of_the_camera():
    found = chosen("lod=0.1,secondary_lod=0.1,shadows").points
    assert [(p.label, p.scene, p.secondary, p.moved, p.must_be_exact) for p in found] == [
        ("keep 0.1", "keep=0.1", None, False, False),
        ("secondary 0.1", None, "keep=0.1", False, False),
        ("secondary 0.1, moved", None, "keep=0.1", True, False),
        ("any hit", None, None, False, True),
        ("closest hit", None, None, False, True),
    ]
    glass = FACTS | {"needs": NEEDS | {"transmittance": {"needed": True, "why": "1 of 2 materials transmits"}}}
    assert "follow all that they pass" in chosen("shadows,samples=1", facts=glass).left_out[0]


def test_what_a_scene_does_not_need_is_left_out_aloud():
    found = chosen("depth,samples=2")
    assert not [p for p in found.points if p.knob == "depth"] and "no material reflects" in found.left_out[0]
    assert chosen("tests,numerics", facts=FACTS | {"triangles": 0}).left_out == [
        "tests: left out: the scene has no triangles"
    ]
    assert "triangle" in chosen("tests").left_out[0] and not chosen("tests,numerics,precision").left_out[1:]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("numeric", "did you mean 'numerics'"),
        ("bvh_sah.leafsize", "bvh_sah has no parameter 'leafsize' (did you mean 'leaf_size'?)"),
        ("bvh_sahh.leaf_size", "unknown structure 'bvh_sahh' (did you mean 'bvh_sah'?)"),
        ("bvh_sah.leaf_size=0", "a whole number from 1 to 16"),
        ("bvh_sah.numerics=quick", "allowed: fast, watertight"),
        ("bvh_sah.reinsertion", "say which values"),
        ("samples=0", "whole numbers from 1 to 64"),
        ("filter=sinc", "allowed: box"),
        ("shadows=none", "allowed: any, closest"),
        ("secondary_lod=2", "numbers from 0 to 1"),
        ("", "empty"),
    ],
)
def test_wrong_knobs_are_told_in_one_line(text, says):
    with pytest.raises(results.RunError) as error:
        chosen(text)
    assert says in str(error.value) and "\n" not in str(error.value)


def test_a_budget_that_cannot_do_is_refused():
    with pytest.raises(results.RunError, match="20 structures on 2 ray sets take at least 0.24 s"):
        structures.case_seconds(20, ["camera", "random"], 0.1)
    with pytest.raises(results.RunError, match="10 pictures, 6 times each"):
        renders.check_budget(10, 0.1)


class Darkroom:
    """Stands for a Studio: seconds of a picture by its name, no time at all for rendering it."""

    def __init__(self, seconds, samples, monkeypatch):
        self.seconds, self.clock, self.taken, self.notes = seconds, 0.0, [], []
        self.settings = types.SimpleNamespace(seed=1, samples=samples)
        self.say = lambda text: None
        monkeypatch.setattr(renders.time, "monotonic", lambda: self.clock)

    def render(self, words, name, threads):
        self.clock += 1
        self.taken.append(words)
        jitter = 0.01 * (len(self.taken) * 7 % 5)
        return {"cpu_seconds": self.seconds[words] + jitter}, types.SimpleNamespace(unlink=lambda: None)

    def jobs(self):
        errors = {"cheap": 0.2, "dear": 0.1, "bad": 0.3, "rival": 0.11}
        rows = {w: picture_row(w, errors[w], 0) | {"spec": "x", "memory_bytes": 1} for w in self.seconds}
        return [{"words": w, "row": row, "times": [self.seconds[w]]} for w, row in rows.items()]


def test_what_is_undecided_is_rendered_more_often(monkeypatch):
    room = Darkroom({"cheap": 1.0, "dear": 5.0, "bad": 9.0, "rival": 5.001}, 7, monkeypatch)
    jobs = room.jobs()
    renders._time(room, jobs, 60)
    times = {job["words"]: len(job["times"]) for job in jobs}
    assert times["cheap"] == times["bad"] == 7 and times["dear"] == times["rival"] > 7
    assert room.clock <= 60 and not room.notes


def test_every_picture_has_an_interval_however_short_the_time(monkeypatch):
    room = Darkroom({"cheap": 1.0, "dear": 5.0}, 7, monkeypatch)
    jobs = room.jobs()
    renders._time(room, jobs, 2)
    assert [len(job["times"]) for job in jobs] == [6, 6]
    assert "6 samples a picture, of 7 wanted, took 10 s, where --seconds left 2" in room.notes[0]
    room = Darkroom({"cheap": 1.0, "dear": 5.0}, 2, monkeypatch)
    renders._time(room, jobs := room.jobs(), 2)
    assert [len(job["times"]) for job in jobs] == [2, 2]  # as asked


# ---- what must be exact ----


def exact_row(spec, digest, params="numerics=watertight", claim="watertight", knob="precision"):
    return {
        "knob": knob, "ray_set": "random", "spec": spec, "params": params, "claim": claim, "must_be_exact": 1,
        "status": "measured", "note": "", "hits_digest": digest,
    }  # fmt: skip


def test_other_answers_where_they_must_be_the_same_are_no_point():
    rows = [exact_row("a", "1"), exact_row("b", "2"), exact_row("c", "1"), exact_row("d", "2", knob="another")]
    structures._compare(rows)
    assert [r["status"] for r in rows] == ["measured", "disagrees", "measured", "measured"]
    assert "other answers than a on the random rays" in rows[1]["note"]


def test_cut_primitives_may_have_other_bits_and_inexact_trees_have_promised_nothing():
    rows = [exact_row("a", "1"), exact_row("b", "2", "clip=true"), exact_row("c", "3", "numerics=fast", "inexact")]
    structures._compare(rows)
    assert [r["status"] for r in rows] == ["measured"] * 3 and rows[2]["must_be_exact"] == 0
    rows = [exact_row("a", "1", claim="exact"), exact_row("b", "2", "clip=true", "exact")]
    structures._compare(rows)
    assert rows[1]["status"] == "disagrees"


def test_a_claim_that_many_rays_break_costs_the_speed_that_few_gave():
    rows = [exact_row("liar", "1") | {"speed": 99.0}, exact_row("honest", "1") | {"speed": 1.0}]
    verdicts = pd.DataFrame(
        {"spec": ["liar", "liar", "honest"], "ray_set": ["random", "aimed_edge", "random"], "held": [1, 0, 1]}
    )
    structures._refuse(rows, verdicts)
    assert [r["status"] for r in rows] == ["refused", "measured"] and np.isnan(rows[0]["speed"])
    assert rows[0]["note"] == "claims watertight, broken on the rays aimed_edge"


# ---- the page ----


def ray_row(point, wrong, speed, **more):
    n = 10000
    lo, hi = rate_interval(wrong, n)
    return {
        "scene": "ball", "knob": "numerics", "point": point, "must_be_exact": 0, "status": "measured", "spec": point,
        "ray_set": "aimed", "query": "closest", "rays": n, "leak": wrong, "wrong": 0, "false_miss": 0, "false_hit": 0,
        "error_rate": wrong / n, "error_lo": lo, "error_hi": hi, "t_error_p99": 2.0, "speed": speed,
        "speed_lo": 0.97 * speed, "speed_hi": 1.03 * speed, "memory_bytes": 1000, "command": f"raybench run {point}",
    } | more  # fmt: skip


def picture_row(point, flip, seconds, **more):
    return {
        "scene": "ball", "knob": "samples", "point": point, "must_be_exact": 0, "status": "measured", "pixels": 64,
        "differing": 9, "rmse": flip, "flip_mean": flip, "seconds": seconds, "seconds_lo": 0.99 * seconds,
        "seconds_hi": 1.01 * seconds, "command": f"raybench render {point}", "picture": "pictures/a.png",
        "difference": "pictures/a.png",
    } | more  # fmt: skip


RAYS = [
    ray_row("embree", 900, 9.0), ray_row("bvh_wide(numerics=watertight)", 0, 8.0), ray_row("kdtree_sah", 0, 2.0),
    ray_row("liar", 5, 99.0, status="refused", note="claims watertight; ray 7", error_command="raybench verify liar"),
]  # fmt: skip


def folder_of(directory, rows):
    (directory / "pictures").mkdir(parents=True)
    Image.new("RGB", (8, 8), (9, 99, 9)).save(directory / "pictures/a.png")
    with open(directory / "tradeoff.csv", "w", newline="") as file:
        writer = csv.DictWriter(file, NAMES, restval="")
        writer.writeheader()
        writer.writerows(rows)
    facts = {
        "format": columns.FORMAT,
        "says": ["`embree` is fast."],
        "notes": ["depth: left out"],
        "command_line": ["raybench"],
    }
    (directory / "tradeoff.json").write_text(json.dumps(facts))
    return directory


def test_what_broke_its_claim_stands_on_no_front_however_fast(tmp_path):
    rows = results.read_table(folder_of(tmp_path / "t", RAYS) / "tradeoff.csv")
    front = next(f for f in fronts.fronts(rows) if f.name == "wrong")
    assert "liar" not in set(front.rows["point"])
    assert dict(zip(front.rows["point"], front.rows["place"])) == {
        "embree": FRONT, "bvh_wide(numerics=watertight)": FRONT, "kdtree_sah": DOMINATED,
    }  # fmt: skip
    (text,) = fronts.sentences([front])
    assert "`embree` is the fastest: 9 million rays/s, 9 % of the answers wrong" in text
    assert "Without a wrong answer among 10,000 the fastest is `bvh_wide(numerics=watertight)`, at 0.89" in text


def test_the_page_has_fronts_pictures_and_what_was_refused(tmp_path, capsys):
    pictures = [picture_row("1 center", 0.2, 1.0), picture_row("16 jittered", 0.0, 9.0), picture_row("4 bad", 0.3, 3.0)]
    folder = folder_of(tmp_path / "t", [*RAYS, *pictures])
    assert main([str(folder)]) == 0
    text = (folder / "report.html").read_text(encoding="utf-8")
    for part in (
        'id="front_0_wrong"',
        'id="front_0_samples"',
        "What accuracy costs",
        "claims watertight; ray 7",
        "depth: left out",
    ):
        assert part in text
    assert text.count("data:image/webp;base64") == 6 and "16 jittered: FLIP 0.000, 9 s" in text
    assert "1 broke a claim" in text
    capsys.readouterr()
    assert main([str(folder), "--figures", "-o", str(tmp_path / "figures")]) == 0
    assert (tmp_path / "figures/front_0_samples.pdf").is_file()


def test_a_folder_that_is_none_is_told_in_one_line(tmp_path, capsys):
    assert main([str(folder_of(tmp_path / "t", []))]) == 2
    assert "no rows" in capsys.readouterr().err


# ---- the command ----


def tradeoff(*words, **more):
    command = [sys.executable, "-m", "raybench_report", "tradeoff", f"--program={RAYBENCH}", *map(str, words)]
    environment = os.environ | {"PYTHONPATH": str(ROOT / "reports")}
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment, **more)


def done(*words):
    child = tradeoff(*words)
    out, err = child.communicate(timeout=240)
    return child.returncode, out, err


@pytest.fixture(scope="module")
def real(tmp_path_factory):
    """One tiny sweep of everything. Skipped without a built raybench."""
    if not RAYBENCH.exists():
        pytest.skip("build/release/raybench is not built")
    out = tmp_path_factory.mktemp("tradeoff") / "out"
    code, text, err = done(
        "--quick", "--knobs=bvh_sah.numerics=fast|watertight,precision,embree.robust,samples=1|2,depth=0|2", "--seconds=2",
        "--rays=512", "--verify-rays=512", "--size=24x24", "--reference-samples=4", "--samples=6", f"--out={out}", "--",
        "shells(size=600)",
    )  # fmt: skip
    assert code == 0, text + err
    return out, text


def test_a_real_sweep_measures_all_it_was_asked(real):
    out, text = real
    rows = results.read_table(out / "tradeoff.csv")
    assert set(rows["knob"]) == {"bvh_sah.numerics", "precision", "embree.robust", "samples", "depth"}
    assert (rows["status"] == "measured").all() and rows["command"].str.startswith("raybench ").all()
    rays, pictures = rows[rows["ray_set"] != ""], rows[rows["ray_set"] == ""]
    assert rays["speed"].gt(0).all() and (rays["speed_lo"] <= rays["speed"]).all()
    judged = rays[rays["ray_set"] == "aimed"]
    assert judged.loc[judged["must_be_exact"] == 0, "rays"].eq(1024).all()  # aimed_vertex and aimed_edge
    assert judged.loc[judged["spec"] == "bvh_sah", "leak"].eq(0).all()
    precision = rays[(rays["knob"] == "precision")]
    same, moved = precision[precision["must_be_exact"] == 1], precision[precision["must_be_exact"] == 0]
    assert same.groupby("ray_set")["hits_digest"].nunique().eq(1).all() and same["memory_bytes"].nunique() == 4
    assert moved["spec"].nunique() == 4 and (moved["claim"] == "inexact").all()
    fronts = results.read_table(out / "fronts.csv").groupby("front")["point"].unique()
    assert set(fronts["vertices"]) == set(fronts["vertices_leaks"]) == set(moved["point"])
    assert set(fronts["precision"]) == set(same["point"])
    assert moved.loc[moved["ray_set"] == "aimed", "t_error_p99"].gt(same["t_error_p99"].max()).all()
    assert pictures["samples"].ge(6).all() and pictures["seconds_lo"].notna().all()
    deepest = pictures[pictures["knob"] == "depth"].iloc[0]  # 64, or on a slow machine what it had time for
    assert (
        deepest["point"] in ("depth 8", "depth 16", "depth 32", "depth 64")
        and deepest["rmse"] == 0
        and pictures.loc[pictures["point"] == "depth 0", "rmse"].gt(0.01).all()
    )
    assert (out / deepest["picture"]).is_file() and (out / "report.html").stat().st_size > 1e5
    assert "Of samples" in text and "Of stored precision" in text
    assert not list(out.parent.glob(".out*"))


def test_levels_of_detail_of_secondary_rays_and_shadows_are_measured(tmp_path):
    if not RAYBENCH.exists():
        pytest.skip("build/release/raybench is not built")
    out = tmp_path / "out"
    code, text, err = done(
        "--quick", "--knobs=secondary_lod=0.2,shadows", "--seconds=1", "--size=32x32", f"--out={out}", "--no-report", "--",
        "terrain(size=2000)",
    )  # fmt: skip
    assert code == 0, text + err
    rows = results.read_table(out / "tradeoff.csv").set_index("point")
    assert list(rows.index) == ["any hit", "closest hit", "all triangles", "secondary 0.2", "secondary 0.2, moved"]
    assert rows.loc["closest hit", "differing"] == 0 and rows.loc["closest hit", "must_be_exact"] == 1
    coarse, moved = rows.loc["secondary 0.2"], rows.loc["secondary 0.2, moved"]
    assert coarse["memory_bytes"] == moved["memory_bytes"] > rows.loc["all triangles", "memory_bytes"]
    assert 0 < moved["rmse"] < coarse["rmse"]  # a surface in front shadows what the camera sees
    assert "--secondary-scene 'decimate(terrain(size=2000),keep=0.2)'" in moved["command"]
    assert "--self-intersection normal-offset --self-intersection-size 0." in moved["command"]
    assert "with the same picture to the bit" in text


def test_a_point_is_measured_again_by_its_command(real, tmp_path):
    rows = results.read_table(real[0] / "tradeoff.csv")
    command = rows.loc[rows["point"] == "depth 0", "command"].iloc[0].split(" ")
    assert command[0] == "raybench"
    words = [w.strip("'") for w in command[1:]]
    subprocess.run([RAYBENCH, *words], cwd=tmp_path, check=True, capture_output=True)
    facts = json.loads((tmp_path / "point.json").read_text())
    assert facts["cpu_seconds"] > 0 and facts["rays"]["reflection"] == 0 and facts["structure"] == "bvh_wide"


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--knobs=bvh_sah.nodes", "--", "icosphere(level=1)"], "bvh_sah has no parameter 'nodes'"),
        (["--knobs=numerics", "--seconds=0.01", "--", "icosphere(level=1)"], "--seconds: "),
        (["--knobs=numerics", "--", "icosphere(level=99)"], "level"),
        (["--size=10", "--", "bunny"], "--size 10"),
        (["--", ], "name a scene"),
    ],
)  # fmt: skip
def test_wrong_input_ends_with_2_and_one_line(words, says, tmp_path):
    if not RAYBENCH.exists():
        pytest.skip("build/release/raybench is not built")
    code, out, err = done(f"--out={tmp_path / 'out'}", *words)
    assert code == 2 and out == "" and says in err and err.count("\n") == 1, err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("scenes = [", "not TOML"),
        ('scenes = ["bunny"]\nray = 5', "ray: unknown key (did you mean 'rays'?)"),
        ("rays = 5", "rays: allowed: a whole number from 64"),
        ("size = [3, 4]", "size: allowed: [width, height]"),
    ],
)
def test_a_broken_suite_is_told_with_file_and_key(text, says, tmp_path, capsys):
    (tmp_path / "s.toml").write_text(text)
    assert main(["tradeoff", f"--suite={tmp_path / 's.toml'}", f"--out={tmp_path / 'out'}", "--", "bunny"]) == 2
    err = capsys.readouterr().err
    assert "s.toml" in err and says in err and err.count("\n") == 1


def test_an_interrupted_sweep_leaves_nothing(tmp_path):
    if not RAYBENCH.exists():
        pytest.skip("build/release/raybench is not built")
    child = tradeoff(
        "--quick", "--knobs=numerics", f"--out={tmp_path / 'out'}", "--", "icosphere(level=4)", start_new_session=True
    )
    until = time.monotonic() + 60
    while not list(tmp_path.glob(".out*/out/run")) and time.monotonic() < until:
        time.sleep(0.05)
    os.killpg(child.pid, signal.SIGINT)
    _, err = child.communicate(timeout=60)
    assert child.returncode == 130 and "nothing was written" in err
    assert not list(tmp_path.iterdir())


def test_counts_are_whole_numbers_in_the_file(real):
    with open(real[0] / "tradeoff.csv", newline="") as file:
        for row in csv.DictReader(file):
            for name, kind, *_ in columns.columns_of("tradeoff.csv"):
                if kind in ("count", "flag"):
                    assert row[name] == "" or row[name].isdigit(), (name, row[name])
    places = pd.read_csv(real[0] / "fronts.csv")
    assert set(places["place"]) <= {FRONT, UNDECIDED, DOMINATED} and list(places) == [
        name for name, *_ in columns.columns_of("fronts.csv")
    ]
