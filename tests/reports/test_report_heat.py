"""Sheets of heat maps on small made-up maps: one scale for all, sizes, texts that fit, and what unfit input is told."""

import json
import shutil
from itertools import combinations

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import sync_playwright
from raybench_report import heat, heat_sheet
from raybench_report.__main__ import main

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
SPECS = ["bvh_sah", "bvh_sah(numerics=fast)", "grid(resolution_x=35,insertion=bounds)", "kdtree", "octree", "lbvh", "x"]


def make_folder(folder, specs=("bvh_sah", "bvh_sah(numerics=fast)"), size=(64, 48), silent=("embree",)):
    """A folder of heat maps: the k-th structure costs k + 1 times as much as the first."""
    folder.mkdir(parents=True, exist_ok=True)
    width, height = size
    noise = np.random.default_rng(5)
    base = noise.integers(0, 40, (height, width))
    base[0, 0] = 900  # beyond the percentile
    maps = []
    for k, spec in enumerate(specs):
        for kind, counts in (("steps", base * 2), ("prims", base[::-1])):
            np.save(folder / f"{k}_{kind}.npy", (counts * (k + 1)).astype(np.uint32))
        maps.append({"spec": spec, "steps": f"{k}_steps.npy", "prims": f"{k}_prims.npy"})
    maps += [{"spec": spec, "why_not": "cannot count"} for spec in silent]
    Image.fromarray(noise.integers(0, 256, (height, width, 3), np.uint8)).save(folder / "picture.png")
    (folder / "heat.json").write_text(json.dumps({"scene": "/models/a$b$.obj", "picture": "picture.png", "maps": maps}))
    return folder


def words(sheet):
    return " ".join(" ".join(text["lines"]) for text in sheet.texts)


def test_a_sheet_is_drawn_and_its_panels_differ(tmp_path):
    folder, out = make_folder(tmp_path / "maps"), tmp_path / "sheet.png"
    assert main(["heat", str(folder), "--out", str(out)]) == 0
    assert [path.name for path in tmp_path.iterdir() if path.is_file()] == ["sheet.png"]  # nothing temporary left
    pixels, sheet = np.asarray(Image.open(out)).astype(int), heat_sheet.sheet(heat.read(folder))
    assert pixels.shape == (sheet.height, sheet.width, 3)
    shown = [pixels[y : y + h, x : x + w] for x, y, w, h, _ in sheet.images]
    assert len(shown) == 5
    for one, other in combinations(shown, 2):
        assert np.abs(one - other).mean() > 2
    # a pixel of a map is a square of its colour
    x, y, w, h, painted = sheet.images[1]
    assert w % 64 == 0 and np.array_equal(shown[1][:: h // 48, :: w // 64], painted)
    assert (pixels == 0).any() or pixels.min() < 60  # there is text


def test_equal_colours_are_equal_counts_in_all_panels_of_a_row(tmp_path):
    maps = heat.read(make_folder(tmp_path, SPECS[:3]))
    sheet = heat_sheet.sheet(maps)
    for kind, images, (*_, scale, _) in zip(
        ("steps", "prims"), (sheet.images[1:4], sheet.images[4:]), sheet.bars, strict=True
    ):
        counts = np.concatenate([m[kind].ravel() for m in maps.counted.values()])
        assert scale.top == np.ceil(np.percentile(counts, 99.9)) < counts.max() and scale.clipped
        colours = np.concatenate([painted.reshape(-1, 3) for *_, painted in images])
        for count in (20, 60):
            assert len(np.unique(colours[counts == count], axis=0)) == 1
        assert len(np.unique(colours, axis=0)) > 50


def test_titles_say_mean_and_maximum_and_the_rest_is_said_in_words(tmp_path):
    maps = heat.read(make_folder(tmp_path))
    sheet = heat_sheet.sheet(maps)
    steps = maps.maps["bvh_sah"]["steps"]
    assert ["bvh_sah", f"mean {steps.mean():.1f}, max 1,800"] in [text["lines"] for text in sheet.texts]
    said = words(sheet) + " ".join(" ".join(label) for *_, label in sheet.bars)
    for expected in ("a$b$.obj: what", "64 × 48 camera rays", "traversal steps per ray", "primitive tests per ray",
                     "99.9th percentile", "embree is not shown: it cannot count."):  # fmt: skip
        assert expected in said
    assert "/models" not in heat_sheet.svg(sheet)


SHEETS = [*((n, (96, 48)) for n in (1, 2, 4, 6, 7)), (1, (900, 100)), (3, (900, 100)), (2, (16, 40))]


@pytest.mark.skipif(CHROMIUM is None, reason="no chromium here (Debian's package)")
def test_no_text_touches_another_or_a_panel_or_leaves_the_sheet(tmp_path):
    boxes_of = """svg => [null, ...svg.querySelectorAll("text, image.panel")].map(e => {
        const b = (e || svg).getBoundingClientRect(), o = svg.getBoundingClientRect();
        return [e ? e.tagName : "svg", e ? e.textContent : "", b.left - o.left, b.top - o.top, b.right - o.left, b.bottom - o.top];
    })"""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        page = browser.new_page()
        for at, (count, size) in enumerate(SHEETS):
            maps = heat.read(make_folder(tmp_path / str(at), SPECS[:count], size))
            for kinds in (("steps",), ("steps", "prims")):
                page.set_content(heat_sheet.svg(heat_sheet.sheet(maps, kinds)))
                (_, _, *whole), *boxes = page.evaluate(f"({boxes_of})(document.querySelector('svg'))")
                assert len([box for box in boxes if box[0] == "image"]) == 1 + count * len(kinds)
                for one, other in combinations(boxes, 2):
                    (_, a, *p), (_, b, *q) = one, other
                    apart = p[2] <= q[0] + 1 or q[2] <= p[0] + 1 or p[3] <= q[1] + 3 or q[3] <= p[1] + 3
                    assert apart, (count, size, kinds, a, b, p, q)
                for _, text, left, top, right, bottom in boxes:
                    assert left >= 0 and top >= 0 and right <= whole[2] and bottom <= whole[3], (count, size, text)
        browser.close()


def test_the_scale_is_logarithmic_where_one_structure_costs_far_more_or_on_demand():
    scale = lambda maps, kind="auto": heat_sheet.Scale(*heat.scale_of(maps, kind))
    cheap, dear = np.full((4, 4), 30, np.uint32), np.full((4, 4), 60_000, np.uint32)
    cheap[0, 0] = 0
    linear = scale([cheap, cheap * 2])
    assert not linear.log and linear.top == 60 and linear.ticks() == [0, 10, 20, 30, 40, 50, 60]
    log = scale([cheap, dear])
    assert log.log and not log.clipped and log.ticks() == [0, 10, 100, 1000, 10_000]
    assert float(log.shares(0)) == 0 and float(log.shares(60_000)) == 1 and 0.3 < float(log.shares(30)) < 0.35
    assert scale([cheap], "log").log and not scale([cheap, dear], "linear").log
    assert scale([cheap * 0]).top == 1 and scale([cheap * 0]).ticks() == [0, 1]


def spoil_missing_folder(folder):
    return folder / "absent", "missing"


def spoil_missing_map(folder):
    (folder / "1_prims.npy").unlink()
    return folder, "1_prims.npy: missing"


def spoil_missing_picture(folder):
    (folder / "picture.png").unlink()
    return folder, "picture.png: missing"


def spoil_json(folder):
    (folder / "heat.json").write_text("[")
    return folder, "heat.json: no heat maps"


def spoil_keys(folder):
    (folder / "heat.json").write_text('{"maps": []}')
    return folder, "heat.json: no heat maps"


def spoil_map(folder):
    (folder / "0_steps.npy").write_bytes(b"junk")
    return folder, "heat.json: no heat maps"


def spoil_pickle(folder):
    np.save(folder / "0_steps.npy", np.array([{}], dtype=object), allow_pickle=True)
    return folder, "heat.json: no heat maps"


def spoil_dimensions(folder):
    np.save(folder / "0_steps.npy", np.zeros(7, np.uint8))
    return folder, "0_steps.npy: not a matrix of counts"


def spoil_sizes(folder):
    np.save(folder / "0_steps.npy", np.zeros((7, 7), np.uint8))
    return folder, "maps of different sizes"


def spoil_counted(folder):
    return make_folder(folder / "silent", specs=()), "nothing was counted"


@pytest.mark.parametrize("spoil", [f for name, f in sorted(globals().items()) if name.startswith("spoil_")])
def test_unfit_input_gets_one_line_and_exit_code_2(tmp_path, capsys, spoil):
    folder, message = spoil(make_folder(tmp_path / "maps"))
    assert main(["heat", str(folder), "--out", str(tmp_path / "a.png")]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and message in error
    assert not (tmp_path / "a.png").exists()


def test_wrong_arguments_get_exit_code_2(tmp_path, capsys):
    folder = str(make_folder(tmp_path / "maps"))
    assert main(["heat", folder]) == 2
    assert main(["heat", folder, "--out", "a.png", "--kind", "colour"]) == 2
    assert main(["heat", folder, "--out", str(tmp_path / "no" / "a.png")]) == 2
    assert main(["heat", "--help"]) == 0
    capsys.readouterr()
