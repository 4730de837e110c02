"""Break-even, exponents, predictors and the split of a gap, on made-up runs whose answers are known."""

import random

import numpy as np
import pandas as pd
import pytest
from made_up import case, full_run, samples_of, write_run
from raybench_report import answer, explain, report, tables
from raybench_report.__main__ import main
from raybench_report.charts import overlap, pays, predictors, runs, scaling
from raybench_report.kinds import all_kinds
from raybench_report.results import RunError


def read(*folders):
    return report.read(folders, all_kinds())


def two(tmp_path, builds, rays, **changes):
    """grid and embree on scene s, camera rays: build times in ms, ns per ray."""
    noise, rows = random.Random(1), []
    for spec, build, ns in zip(("grid", "embree"), builds, rays, strict=True):
        rows.append(case(spec, "s", "build", "build", noise, median_ns=build * 1e6))
        rows.append(case(spec, "s", "camera", "closest", noise, **({"median_ns": ns} | changes.get(spec, {}))))
    return read(write_run(tmp_path / "run", rows))


def test_a_dearer_build_pays_from_the_ratio_of_the_differences(tmp_path):
    found = two(tmp_path, (1, 3), (300, 100)).crossings
    assert len(found) == 1
    row = found.iloc[0]
    assert (row["before"], row["after"]) == ("grid", "embree") and row["rays"] == pytest.approx(2e6 / 200)
    assert 0.8e4 < row["lo"] < 1e4 < row["hi"] < 1.25e4


def test_what_builds_faster_and_traces_faster_has_no_crossing(tmp_path):
    assert two(tmp_path, (3, 1), (300, 100)).crossings.empty


def test_where_the_gain_is_not_certain_the_interval_has_no_end(tmp_path):
    row = two(tmp_path, (1, 3), (101, 100)).crossings.iloc[0]
    assert row["rays"] == pytest.approx(2e6) and row["hi"] == np.inf


def test_times_on_parts_of_the_rays_are_scaled_by_the_anchor(tmp_path):
    part = {
        "grid": {"median_ns": 150, "timed_rays": 1 << 18, "anchor": "embree", "anchor_ns": 50},
        "embree": {"median_ns": 100, "anchor": "embree", "anchor_ns": 100},
    }
    known = pays.totals(two(tmp_path, (1, 3), (150, 100), **part)).set_index("spec")["ns"]
    assert known["grid"] == pytest.approx(300) and known["embree"] == pytest.approx(100)


def test_a_software_driver_is_not_shown_as_the_device_it_stands_for(tmp_path):
    noise, rows = random.Random(1), []
    for spec, device in (("embree", ""), ("vulkan_rt", "software: llvmpipe"), ("vulkan_rt(device=1)", "Some GPU")):
        for ray_set, query in (("build", "build"), ("camera", "closest")):
            rows.append(case("embree", "s", ray_set, query, noise) | {"spec": spec, "device": device})
    run = read(write_run(tmp_path / "run", rows, structures=[{"spec": "embree"}, {"spec": "vulkan_rt"}])).runs[0]
    shown = ["embree", "vulkan_rt [software]", "vulkan_rt(device=1)"]
    assert list(run.cases["spec"].unique()) == shown and set(run.samples["spec"]) == set(shown)
    assert [s["spec"] for s in run.info["structures"]] == shown[:2]


def test_exponents_of_power_laws_are_found(tmp_path):
    noise, rows = random.Random(1), []
    for size in (1000, 4000, 20_000, 100_000):
        scene, wobble = f"terrain(size={size})", noise.uniform(0.99, 1.01)
        rows.append(case("bvh_sah", scene, "build", "build", noise, primitives=size, median_ns=7 * size**1.2 * wobble))
        rows[-1] |= {"node_bytes": 5 * size, "prim_bytes": 3 * size, "build_peak_bytes": ""}  # no peak: no fit
        grows = {"median_ns": 50 * size**0.25, "steps": 3 * size**0.1, "bytes": 100}
        rows.append(case("bvh_sah", scene, "camera", "closest", noise, primitives=size, **grows))
    rows.append(case("bvh_sah", "soup(size=5)", "camera", "closest", noise, primitives=5))  # one size: no exponent
    fits = scaling.fits(read(write_run(tmp_path / "run", rows))).set_index("quantity")
    assert set(fits["family"]) == {"terrain"}
    assert fits.loc["build time, ms", "exponent"] == pytest.approx(1.2, abs=0.01)
    assert fits.loc["build time, ms", "lo"] < 1.2 < fits.loc["build time, ms", "hi"]
    exact = fits.loc["camera, ns per ray"]
    assert fits.loc["memory of the tree, MiB", "exponent"] == pytest.approx(1)
    assert fits.loc["camera, steps per ray", "exponent"] == pytest.approx(0.1)
    assert fits.loc["camera, bytes per ray", "exponent"] == pytest.approx(0, abs=1e-9)
    assert not fits.index.str.startswith("peak").any()
    assert exact["exponent"] == pytest.approx(0.25) and exact["hi"] - exact["lo"] < 1e-6


def builders(noise=0.0, wide=0.0):
    """Five builders on two scenes, whose times follow the SAH cost, but for noise, and have nothing to do with EPO."""
    random_source, rows = random.Random(3), []
    for scene, slowness in (("soup", 100), ("city", 900)):
        for i, spec in enumerate(["bvh_sah", "bvh_median", "bvh_ploc", "bvh_sweep(reinsertion=3)", "bvh_spatial"]):
            sah = 20 + 3 * i
            ns = slowness * sah * random_source.uniform(1 - noise, 1 + noise)
            changes = {
                "structure": spec.partition("(")[0], "spec": spec, "sah_cost": sah, "epo": [5, 1, 3, 2, 4][i],
                "lcv": 1 + i % 2, "median_ns": ns, "lo_ns": ns * (1 - wide), "hi_ns": ns * (1 + wide),
            }  # fmt: skip
            rows.append(case("bvh_sah", scene, "random", "closest", random.Random(i)) | changes)
            rows.append(case("bvh_sah", scene, "shadow.0", "any", random.Random(i)) | changes)
        another = {"structure": "bvh_wide", "spec": "bvh_wide", "sah_cost": 1, "epo": 1, "lcv": 1}  # no binary tree
        rows.append(case("bvh_sah", scene, "random", "closest", random.Random(9)) | another)
    return rows


def test_predictors_are_measured_within_scenes(tmp_path):
    table = predictors.table(read(write_run(tmp_path / "run", builders()))).set_index("predictor")
    assert set(table["rays"]) == {"random"} and set(table["trees"]) == {10}  # any-hit rays and few trees are left out
    assert table.loc["SAH cost", "r2"] == pytest.approx(1) and table.loc["SAH cost + EPO", "r2"] == pytest.approx(1)
    assert table.loc["EPO", "r2"] == pytest.approx(0.01, abs=1e-6)  # corr(20 + 3 i, [5, 1, 3, 2, 4]) = -0.1
    noisy = predictors.table(read(write_run(tmp_path / "noisy", builders(0.2))))
    assert 0.3 < noisy["r2"].iloc[0] < 0.99


def test_rank_correlation_and_wrong_signs(tmp_path):
    table = predictors.table(read(write_run(tmp_path / "run", builders(wide=0.01)))).set_index("predictor")
    assert table.loc["SAH cost", "rank"] == pytest.approx(1) and table.loc["EPO", "rank"] == pytest.approx(-0.1)
    assert (table.loc["SAH cost", "wrong"], table.loc["SAH cost", "pairs"]) == (0, 20)
    assert table.loc["EPO", "wrong"] == 2 * 5  # inversions of 5, 1, 3, 2, 4
    unsure = predictors.table(read(write_run(tmp_path / "unsure", builders(wide=0.5)))).set_index("predictor")
    assert unsure.loc["EPO", "pairs"] == 0  # intervals overlap: no pair is told apart


def priced(tmp_path, extra=0.0):
    """Times of 2 + 10 visits + 3 tests, counts at random; `extra` ns for the grid."""
    noise, rows = random.Random(5), [case("null", "s", "camera", "closest", random.Random(1), median_ns=2)]
    for spec in ("bvh_sah", "grid", "bvh_sah(numerics=fast)"):
        rows.append(case(spec, "s", "build", "build", noise))
        for rays in ("camera", "random", "diffuse", "aimed"):
            steps, prims = noise.uniform(5, 80), noise.uniform(2, 200)
            ns = 2 + 10 * steps + 3 * prims + (extra if spec == "grid" else 0)
            rows.append(
                case(
                    spec,
                    "s",
                    rays,
                    "closest",
                    noise,
                    steps=steps,
                    prims=prims,
                    bytes=32 * steps + 40 * prims,
                    median_ns=ns,
                )
            )
    return write_run(tmp_path / "run", rows)


def test_prices_that_made_the_times_are_found_and_split_the_gap(tmp_path):
    found = read(priced(tmp_path))
    price = explain.prices(found)["run", "s"]
    assert price.steps == pytest.approx(10) and price.prims == pytest.approx(3) and price.error < 1e-9
    assert price.bytes_per_step == pytest.approx(32) and price.bytes_per_prim == pytest.approx(40)
    (gap,) = explain.gaps(found, "grid", "bvh_sah", "run", rays="camera")
    (a, b), (c, d) = gap.counts["steps"], gap.counts["prims"]
    assert gap.parts["steps"] == pytest.approx(10 * (a - b)) and gap.parts["prims"] == pytest.approx(3 * (c - d))
    assert gap.parts["bytes"] == pytest.approx(0, abs=1e-6) and gap.parts["rest"] == pytest.approx(0, abs=1e-6)


def test_the_parts_add_up_to_the_gap_and_the_rest_is_what_each_costs_more(tmp_path):
    found = read(priced(tmp_path, extra=500))
    for gap in explain.gaps(found, "grid", "bvh_sah", "run"):
        assert sum(gap.parts.values()) == pytest.approx(gap.ns[0] - gap.ns[1])
    assert np.mean([gap.parts["rest"] for gap in explain.gaps(found, "grid", "bvh_sah", "run")]) > 100


def test_what_a_structure_and_its_rays_pay_beside_counts_is_found(tmp_path):
    """Times by the model: four structures, six ray sets; the grid pays 3 times as much as others, random rays twice."""
    noise, rows = random.Random(9), [case("null", "s", "camera", "closest", random.Random(1), median_ns=2)]
    for spec in ("bvh_sah", "grid", "bvh_sah(numerics=fast)", "brute"):
        rows.append(case(spec, "s", "build", "build", noise))
        for rays in ("camera", "random", "diffuse", "aimed", "reflection.1", "refraction.1"):
            steps, prims = noise.uniform(5, 80), noise.uniform(2, 200)
            ns = 2 + (3 if spec == "grid" else 1) * (2 if rays == "random" else 1) * (10 * steps + 3 * prims)
            counts = {"steps": steps, "prims": prims, "bytes": 32 * steps + 40 * prims}
            rows.append(case(spec, "s", rays, "closest", noise, median_ns=ns, **counts))
    found = read(write_run(tmp_path / "run", rows))
    price = explain.prices(found)["run", "s"]
    assert price.structures["grid"] / price.structures["bvh_sah"] == pytest.approx(3)
    assert price.rays["random"] / price.rays["camera"] == pytest.approx(2)
    assert price.steps / price.prims == pytest.approx(10 / 3) and price.error < 1e-6
    for gap in explain.gaps(found, "grid", "bvh_sah", "run"):
        assert sum(gap.parts.values()) == pytest.approx(gap.ns[0] - gap.ns[1])
        assert gap.parts["rest"] == pytest.approx(0, abs=1e-3)
        work = [(gap.ns[0] - 2) / 3, gap.ns[1] - 2]  # at the prices of the others
        assert gap.parts["each"] == pytest.approx(2 * sum(work) / 2, rel=1e-6)


def test_explain_prints_and_refuses(tmp_path, capsys):
    folder = str(priced(tmp_path))
    assert main(["explain", "grid", "bvh_sah", folder, "--rays", "camera"]) == 0
    out = capsys.readouterr().out
    assert "10 ns a visit and 3 ns a test" in out and "camera (prices times 1.00):" in out and "random" not in out
    for words, says in (
        (["grid", "mine"], "mine: not timed in this run; timed: "),
        (["grid", "bvh_sah", "--scene", "t"], "t: no such scene; there are: s"),
    ):
        assert main(["explain", *words[:2], folder, *words[2:]]) == 2
        err = capsys.readouterr().err
        assert says in err and err.count("\n") == 1


def test_what_cannot_count_is_not_split(tmp_path):
    folder = write_run(tmp_path / "run", full_run(scenes=("s",)))
    (gap, *_) = explain.gaps(read(folder), "embree", "bvh_sah", "run")
    assert gap.parts is None and np.isnan(gap.counts["steps"][0])
    with pytest.raises(RunError):
        explain.gaps(read(folder), "embree", "null", "run")


def test_kd_trees_are_set_against_binary_bvhs_and_their_overlap(tmp_path):
    noise, rows = random.Random(1), []
    for scene, epo, times in (("soup", 40, (400, 100)), ("city", 2, (100, 200))):
        for spec, ns, overlap_of in zip(("bvh_sah", "grid"), times, (epo, 0), strict=True):
            changes = {"structure": "kdtree_sah", "spec": "kdtree_sah"} if spec == "grid" else {}
            changes |= {"epo": overlap_of, "median_ns": ns, "lo_ns": 0.9 * ns, "hi_ns": 1.1 * ns}
            rows.append(case(spec, scene, "camera", "closest", noise) | changes)
        wide = {"structure": "bvh_wide", "spec": "bvh_wide", "epo": 1, "median_ns": 10}
        rows.append(case("bvh_sah", scene, "camera", "closest", noise) | wide)  # no binary tree
    found = read(write_run(tmp_path / "run", rows))
    pairs = overlap.rows(found).set_index("label")
    assert pairs.loc["soup", "ratio"] == pytest.approx(4) and pairs.loc["city", "ratio"] == pytest.approx(0.5)
    assert pairs.loc["soup", "lo"] == pytest.approx(4 * 0.9 / 1.1) and set(pairs["bvh"]) == {"bvh_sah"}
    assert (
        "faster than the fastest binary BVH in 1 of 2 pairs: at most 4 times as fast, `kdtree_sah` for camera rays on `soup` (where"
        in (" ".join(text for _, text in answer.sentences(found, answer.best(found))))
    )


def test_runs_are_compared_relative_to_their_anchors(tmp_path):
    def anchored(name, factor, slower):
        rows = []
        for spec, ns in (("embree", 100.0), ("bvh_sah", 200.0 * slower)):
            ns *= factor  # of the machine
            rows.append(
                case(
                    spec,
                    "s",
                    "camera",
                    "closest",
                    random.Random(1),
                    median_ns=ns,
                    lo_ns=0.99 * ns,
                    hi_ns=1.01 * ns,
                    anchor="embree",
                    anchor_ns=100 * factor,
                )
            )
        return write_run(tmp_path / name, rows)

    found = read(anchored("before", 1, 1), anchored("after", 1.7, 1.1))
    (text,) = [text for topic, text in answer.sentences(found, answer.best(found)) if "against" in text]
    assert (
        "`after` against `before`, relative to `embree`" in text
        and "slower `bvh_sah` (1.10 times the time); no others" in text
    )
    assert found.names == ["before", "after"]  # as given, not by alphabet
    assert list(tables.structures(found)["run"]) == ["before", "after"] * 2
    same = read(anchored("one", 1, 1), anchored("two", 1.7, 1.001))
    assert "no structure is faster or slower" in " ".join(text for _, text in answer.sentences(same, answer.best(same)))
    ratios = runs.ratios(found)
    assert list(ratios["spec"]) == ["bvh_sah"] and ratios["ratio"].iloc[0] == pytest.approx(1.1)
    assert ratios["lo"].iloc[0] == pytest.approx(1.1 * 0.99 / 1.01)


def test_samples_of_made_up_runs_have_their_median():
    row = case("bvh_sah", "s", "camera", "closest", random.Random(1), median_ns=100)
    assert pd.Series([s["seconds"] * 1e9 / s["rays"] for s in samples_of(row)]).median() == pytest.approx(100)
