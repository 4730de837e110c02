"""Sheets of heat maps on small made-up maps: one scale for all, sizes, texts that fit, and what unfit input is told."""

import json
from itertools import combinations

import matplotlib.pyplot as plt
import numpy as np
import pytest
from raybench_report import heat, heat_sheet
from raybench_report.__main__ import main

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
    plt.imsave(folder / "picture.png", noise.random((height, width, 3)))
    (folder / "heat.json").write_text(json.dumps({"scene": "/models/a$b$.obj", "picture": "picture.png", "maps": maps}))
    return folder


def panels(figure):
    """The axes that show maps, by title and row from the top."""
    return [axis for axis in figure.axes if axis.images and "\n" in axis.get_title(loc="left")]


def drawn_texts(figure):
    texts = list(figure.texts)
    for axis in figure.axes:
        low, high = axis.get_ylim()
        ticks = zip(axis.get_yticks(), axis.get_yticklabels(), strict=True)
        texts += [axis._left_title, axis.yaxis.label, *(label for place, label in ticks if low <= place <= high)]
    return [text for text in texts if text.get_text() and text.get_visible()]


def test_a_sheet_is_drawn_and_its_panels_differ(tmp_path):
    folder, out = make_folder(tmp_path / "maps"), tmp_path / "sheet.png"
    assert main(["heat", str(folder), "--out", str(out)]) == 0
    assert [path.name for path in tmp_path.iterdir() if path.is_file()] == ["sheet.png"]  # nothing temporary left
    pixels = plt.imread(out)
    figure = heat_sheet.sheet(heat.read(folder))
    width, height = figure.get_size_inches() * heat_sheet.DPI
    assert pixels.shape[:2] == (round(height), round(width))
    shown = []
    for axis in panels(figure):
        box = axis.get_position()
        rows = slice(round((1 - box.y1) * height), round((1 - box.y0) * height))
        shown.append(pixels[rows, round(box.x0 * width) : round(box.x1 * width)])
    assert len(shown) == 4
    for one, other in combinations(shown, 2):
        rows, columns = (min(a, b) for a, b in zip(one.shape[:2], other.shape[:2], strict=True))
        difference = np.abs(one[:rows, :columns] - other[:rows, :columns]).mean()
        same = np.array_equal(one[:rows, :columns], other[:rows, :columns])
        assert not same and difference > 0.01
    plt.close(figure)


def test_equal_colours_are_equal_counts_in_all_panels_of_a_row(tmp_path):
    maps = heat.read(make_folder(tmp_path, SPECS[:3]))
    figure = heat_sheet.sheet(maps)
    for kind, axes in (("steps", panels(figure)[:3]), ("prims", panels(figure)[3:])):
        limits = {axis.images[0].get_clim() for axis in axes}
        assert len(limits) == 1
        counts = np.concatenate([m[kind].ravel() for m in maps.counted.values()])
        low, high = limits.pop()
        assert low == 0 and high == np.ceil(np.percentile(counts, 99.9)) < counts.max()
        colours = [axis.images[0].to_rgba(np.array([[20.0]])) for axis in axes]
        assert all(np.array_equal(colours[0], colour) for colour in colours)
    plt.close(figure)


def test_titles_say_mean_and_maximum_and_the_rest_is_said_in_words(tmp_path):
    maps = heat.read(make_folder(tmp_path))
    figure = heat_sheet.sheet(maps)
    steps = maps.maps["bvh_sah"]["steps"]
    assert panels(figure)[0].get_title(loc="left") == f"bvh_sah\nmean {steps.mean():.1f}, max 1,800"
    words = " ".join(" ".join(text.get_text().split()) for text in drawn_texts(figure))
    for expected in ("a$b$.obj: what", "64 × 48 camera rays", "traversal steps per ray", "primitive tests per ray",
                     "99.9th percentile", "embree is not shown: it cannot count."):  # fmt: skip
        assert expected in words
    assert "/models" not in words
    plt.close(figure)


@pytest.mark.parametrize("kinds", [("steps",), ("steps", "prims")])
@pytest.mark.parametrize(
    ("count", "size"), [*((n, (96, 48)) for n in (1, 2, 4, 6, 7)), (1, (900, 100)), (3, (900, 100)), (2, (16, 40))]
)
def test_no_text_touches_another_or_leaves_the_sheet(tmp_path, count, size, kinds):
    figure = heat_sheet.sheet(heat.read(make_folder(tmp_path, SPECS[:count], size)), kinds)
    figure.canvas.draw()
    whole = figure.bbox
    boxes = [(text.get_text(), text.get_window_extent()) for text in drawn_texts(figure)]
    for name, box in boxes:
        assert box.x0 >= 0 and box.y0 >= 0 and box.x1 <= whole.x1 and box.y1 <= whole.y1, name
    for (name, box), (other_name, other) in combinations(boxes, 2):
        apart = box.x1 <= other.x0 or other.x1 <= box.x0 or box.y1 <= other.y0 or other.y1 <= box.y0
        assert apart, (name, other_name)
    for name, box in boxes:
        for axis in panels(figure):
            panel = axis.get_window_extent()
            apart = (box.x1 <= panel.x0 or panel.x1 <= box.x0
                     or box.y1 <= panel.y0 + 1 or panel.y1 - 1 <= box.y0)  # fmt: skip
            assert apart, name
    assert len(panels(figure)) == count * len(kinds)
    plt.close(figure)


def test_the_scale_is_logarithmic_where_one_structure_costs_far_more_or_on_demand():
    cheap, dear = np.full((4, 4), 30, np.uint32), np.full((4, 4), 60_000, np.uint32)
    cheap[0, 0] = 0
    linear, _ = heat_sheet.norm([cheap, cheap * 2])
    assert not isinstance(linear, heat_sheet.colors.FuncNorm) and linear.vmax == 60
    log, clipped = heat_sheet.norm([cheap, dear])
    assert isinstance(log, heat_sheet.colors.FuncNorm) and not clipped
    assert float(log(0)) == 0 and float(log(60_000)) == 1 and 0.3 < float(log(30)) < 0.35
    assert isinstance(heat_sheet.norm([cheap], "log")[0], heat_sheet.colors.FuncNorm)
    assert not isinstance(heat_sheet.norm([cheap, dear], "linear")[0], heat_sheet.colors.FuncNorm)
    assert heat_sheet.norm([cheap * 0])[0].vmax == 1


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
