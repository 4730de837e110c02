"""The page without a browser: what it says, that it holds the numbers of the files, and what unfit input is told."""

import base64
import gzip
import io
import json
import random
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from made_up import case, full_run, without_time, write_run
from PIL import Image
from raybench_report import answer, columns, report, results
from raybench_report.__main__ import main
from raybench_report.kinds import all_kinds

ROOT = Path(__file__).parents[2]


def made(*folders, out):
    """The page of these folders."""
    assert main([*map(str, folders), "-o", str(out)]) == 0
    return out.read_text(encoding="utf-8")


def data_of(page):
    """What the page's scripts read."""
    packed = re.search(r'id="data">([^<]*)<', page)[1]
    return json.loads(gzip.decompress(base64.b64decode(packed)))


def column(packed, name):
    """A column as the page's data has it."""
    found = packed[name]
    return found["v"] if "v" in found else [found["d"][i] for i in found["i"]]


def read(*folders):
    return report.read(folders, all_kinds())


def said(found):
    """All sentences of the answer."""
    return answer.plain(" ".join(text for _, text in answer.sentences(found, answer.best(found))))


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """A whole run's page; not to be changed."""
    folder = write_run(tmp_path_factory.mktemp("page") / "run", full_run())
    return folder, made(folder, out=folder / "page.html")


def test_the_page_is_one_file_that_asks_for_nothing_else(page):
    folder, text = page
    without_data = re.sub(r'<script type="text/plain"[^>]*>[^<]*</script>', "", text)
    assert "default-src 'none'" in text
    for source in re.findall(r'\s(?:src|href)="([^"]*)"', without_data):
        assert source.startswith(("#", "data:")), source
    assert "@import" not in without_data and "url(" not in without_data
    names = re.findall(r'\sid="([^"]*)"', without_data)
    assert len(names) == len(set(names))
    assert {p.name for p in folder.iterdir()} == {"cases.csv", "samples.csv", "run.json", "page.html"}


def test_the_page_goes_to_the_first_folder_unless_told_otherwise(tmp_path, capsys):
    folder = write_run(tmp_path / "run", full_run())
    assert main([str(folder)]) == 0
    assert (folder / "report.html").is_file() and "report.html" in capsys.readouterr().out


def test_the_page_holds_the_numbers_of_the_csv_to_the_last_digit(page):
    folder, text = page
    table, packed = results.read_table(folder / "cases.csv"), data_of(text)["cases"]
    for name in ("median_ns", "lo_ns", "rate", "steps", "prims", "verified", "node_bytes"):
        shown = pd.Series(column(packed, name), dtype=float)
        assert shown.equals(table[name].astype(float)), name
    assert column(packed, "spec") == list(table["spec"])


def test_the_same_files_give_the_same_bytes(page, tmp_path):
    _, text = page
    assert made(write_run(tmp_path / "run", full_run()), out=tmp_path / "page.html") == text


def test_names_from_users_are_text_and_never_markup(tmp_path):
    rows = full_run(scenes=("<b>x</b>.obj",), specs=("bvh_sah", "grid"))
    text = made(write_run(tmp_path / "<i>run", rows), out=tmp_path / "page.html")
    assert "<b>x" not in text and "<i>run" not in text
    assert "&lt;Test &amp; Co&gt;" in text


def fixed(speeds, **changes):
    """One scene, camera rays, structure → ns per ray; intervals of 1 %."""
    noise, rows = random.Random(1), []
    for spec, ns in speeds.items():
        common = {"claim": "watertight", "anchor": next(iter(speeds))} | changes
        rows.append(case(spec, "s", "build", "build", noise, median_ns=1e6, lo_ns=0.99e6, hi_ns=1.01e6))
        times = {
            "median_ns": ns,
            "lo_ns": 0.99 * ns,
            "hi_ns": 1.01 * ns,
            "rate": 1e9 / ns,
            "anchor_ns": next(iter(speeds.values())),
        }
        rows.append(case(spec, "s", "camera", "closest", noise, **(times | common)))
    return rows


def test_the_answer_names_the_fastest_and_how_sure_it_is(tmp_path):
    found = read(write_run(tmp_path / "run", fixed({"embree": 100, "bvh_sah": 150, "grid": 300})))
    text = said(found)
    assert "embree is the fastest for every kind of ray on the scene: 10 million rays per second, 1.50 times" in text
    assert "the next, bvh_sah" in text and "intervals of the first two are apart" in text
    close = read(write_run(tmp_path / "close", fixed({"embree": 100, "bvh_sah": 101, "grid": 300})))
    assert "1 of 1 pairs the intervals of the first two overlap" in said(close)
    rows = [row | {"lo_ns": "", "hi_ns": ""} for row in fixed({"embree": 100, "bvh_sah": 150})]
    text = said(read(write_run(tmp_path / "few", rows)))
    assert "1 of 1 pairs there are too few samples" in text and "overlap" not in text


def test_where_parts_of_the_rays_were_timed_the_same_rays_are_compared(tmp_path):
    rows = fixed({"embree": 100, "bvh_sah": 150})
    # On its part of the rays bvh_sah took 90 ns and the anchor 60 ns: it is slower, though 90 < 100.
    rows[-1] |= {"median_ns": 90, "lo_ns": 89, "hi_ns": 91, "anchor_ns": 60, "rate": 1e9 / 90}
    best = answer.best(read(write_run(tmp_path / "run", rows)))
    assert best["first"].iloc[0] == "embree" and best["lead"].iloc[0] == pytest.approx(1.5)


def test_the_safest_is_the_fastest_that_claims_to_lose_no_ray(tmp_path):
    rows = fixed({"embree": 100, "bvh_sah": 150, "grid": 300})
    rows[1] |= {"claim": "inexact", "leak": 50, "exact": 99950, "verified": 100000}
    text = said(read(write_run(tmp_path / "run", rows)))
    assert "bvh_sah is the fastest: 0.67 of the fastest one's speed" in text
    assert "embree 0.05 % wrong" in text


def test_refused_skipped_and_interrupted_say_so_and_have_no_speed(tmp_path):
    rows = full_run(scenes=("s", "t"), specs=("embree", "bvh_sah", "grid", "brute"))
    for i, row in enumerate(rows):
        if row["spec"] == "grid" and row["scene"] == "t":
            rows[i] = without_time(row, "refused", "shadow.0: 3 leaks, <really>; ray 7: org (0x1p+0)") | {"leak": 3}
        if row["spec"] == "brute" and row["query"] != "build":
            rows[i] = without_time(row, "skipped", "too slow")
    rows = [row for row in rows if (row["spec"], row["scene"]) != ("bvh_sah", "t")]
    planned = [{"spec": spec} for spec in ("embree", "bvh_sah", "grid", "brute")]
    folder = write_run(
        tmp_path / "run", rows, interrupted=True, structures=planned, scenes=[{"scene": "s"}, {"scene": "t"}]
    )
    found = read(folder)
    assert (
        "Refused, so without any time, because an answer broke what the structure claims: grid on t: shadow.0: 3 leaks"
        in said(found)
    )
    doubts = answer.plain(" ".join(answer.doubts(found)))
    assert "interrupted" in doubts and "never measured: bvh_sah on t" in doubts
    assert "Skipped, so without a time: brute on both scenes (too slow)" in doubts
    text = made(folder, out=tmp_path / "page.html")
    assert "3 leaks, &lt;really&gt;" in text and "<really>" not in text
    packed = data_of(text)
    for label, spec, median in zip(*(column(packed["cases"], n) for n in ("label", "spec", "median_ns")), strict=True):
        assert (label, spec) != ("t", "grid") or median is None
    structures = packed["structures"]
    for label, spec, verdict, closest in zip(
        *(column(structures, n) for n in ("label", "spec", "verdict", "closest")), strict=True
    ):
        if (label, spec) == ("t", "grid"):
            assert verdict == "REFUSED: shadow.0: 3 leaks, <really>" and closest is None


def test_a_run_where_nothing_was_timed_says_so(tmp_path):
    folder = write_run(tmp_path / "run", [without_time(row, "refused", "3 leaks") for row in full_run()])
    text = made(folder, out=tmp_path / "page.html")
    assert "Nothing has a time" in text and "refused" in text


def test_several_runs_stand_side_by_side_under_names_of_their_own(tmp_path):
    first, second = write_run(tmp_path / "a" / "run", full_run()), write_run(tmp_path / "b" / "run", full_run())
    data = data_of(made(first, second, out=tmp_path / "page.html"))
    assert data["runs"] == ["run", "run (2)"]
    assert set(column(data["cases"], "run")) == {"run", "run (2)"}
    assert "runs" in {chart["name"] for chart in data["charts"]}


def test_doubts_are_those_of_the_machine(tmp_path):
    rows = fixed({"embree": 100, "bvh_sah": 150})
    rows[1] |= {"lo_ns": 80, "hi_ns": 130}
    info = {"machine": {"cpu_flags": "sse hypervisor avx", "os": "Debian GNU/Linux 12"}, "quick": True, "rays_per_set": 8192,
            "libraries": {"embree": {"version": "3.13.5"}}}  # fmt: skip
    doubts = " ".join(answer.doubts(read(write_run(tmp_path / "run", rows, **info))))
    for words in ("virtual machine", "wider than 10 %", "A quick run: 8,192 rays", "3.13.5 is Debian's package"):
        assert words in doubts
    quiet = answer.doubts(read(write_run(tmp_path / "quiet", fixed({"embree": 100, "bvh_sah": 150}))))
    assert quiet == []


def test_heat_maps_and_pictures_are_inside(tmp_path):
    from test_report_heat import make_folder

    folder = write_run(
        tmp_path / "run", full_run(), scenes=[{"scene": "/models/sponza.obj", "image": "images/sponza.png"}]
    )
    (folder / "images").mkdir()
    Image.new("RGB", (64, 48), "navy").save(folder / "images" / "sponza.png")
    make_folder(folder / "heat" / "sponza")
    (folder / "boxes").mkdir()
    box = [0, 0, 0, 1, 1, 1, 0]
    (folder / "boxes" / "sponza.json").write_text(
        json.dumps({"trees": [{"spec": "bvh_sah", "depth": 3, "levels": [[box]]}]})
    )
    (scene,) = data_of(made(folder, out=tmp_path / "page.html"))["panels"]["pictures"]["scenes"]
    assert scene["label"] == "sponza.obj" and scene["picture"]["src"].startswith("data:image/png")
    assert [m["spec"] for m in scene["heat"]["kinds"]["steps"]["maps"]] == ["bvh_sah", "bvh_sah(numerics=fast)"]
    kind = scene["heat"]["kinds"]["steps"]
    for i, shown in enumerate(kind["maps"]):
        grey = np.asarray(Image.open(io.BytesIO(base64.b64decode(shown["src"].partition(",")[2]))))[..., 0]
        counts = np.minimum(np.load(folder / "heat" / "sponza" / f"{i}_steps.npy"), kind["top"])
        assert np.abs(grey / 255 * kind["top"] - counts).max() <= kind["top"] * (0.5 / 63 + 0.51 / 255)
    assert scene["heat"]["silent"] == {"embree": "cannot count"} and scene["trees"][0]["levels"] == [[box]]
    (folder / "boxes" / "sponza.json").write_text("{")
    assert main([str(folder)]) == 2


def test_documentation_has_the_columns_as_they_are():
    text = (ROOT / "reports" / "README.md").read_text(encoding="utf-8")
    for table in ("cases.csv", "samples.csv", "verdicts.csv", "crossings.csv", "offset.csv", "extremes.csv"):
        assert f"\n{columns.markdown(table)}\n" in text, f"{table}: python -m raybench_report.columns has the table"


def test_errors_are_the_plain_ones_over_the_verified_rays(tmp_path):
    noise = random.Random(1)
    row = case("bvh_sah", "s", "camera", "closest", noise)
    row |= {"verified": 1000, "leak": 1, "wrong": 2, "false_miss": 3, "false_hit": 4, "wrong_marginal": 500}
    unverified = case("bvh_sah", "s", "random", "closest", noise, verified=0)
    run = results.read(write_run(tmp_path / "run", [row, unverified]))
    assert run.cases["errors"].iloc[0] == pytest.approx(0.01)
    assert run.cases["errors"].isna().iloc[1]


def spoil_missing_directory(run):
    return run / "absent", "no such directory"


def spoil_other_folder(run):
    (run / "cases.csv").unlink()
    return run, r"not a result folder: it has none of cases\.csv \(raybench run\), verdicts\.csv"


def spoil_older_format(run):
    (run / "run.json").write_text(json.dumps({"machine": {}, "seed": 1}))
    return run, rf"run\.json: result format unknown; this raybench reads {columns.FORMAT}: measure again"


def test_a_folder_without_columns_that_came_later_is_read(tmp_path):
    write_run(tmp_path / "run", full_run())
    cases = tmp_path / "run" / "cases.csv"
    table = pd.read_csv(cases, dtype=str, keep_default_na=False)
    table.drop(columns=columns.later("cases.csv")).to_csv(cases, index=False)
    assert "device_ns" not in cases.read_text()
    assert read(tmp_path / "run").cases["device_ns"].isna().all()


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


def spoil_no_rows(run):
    write_run(run, [])
    return run, r"cases\.csv: no cases"


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
