"""Heat maps: a sheet that shows what traversal costs per pixel, structures side by side on one scale.

A folder of heat maps, as `raybench render --heat` and `raybench run` write it, holds heat.json and a .npy file a map:
{"scene": NAME, "picture": FILE, "maps": [{"spec": S, "steps": FILE, "prims": FILE} or {"spec": S, "why_not": TEXT}]}
with files relative to the folder. A map is a matrix of counts, row 0 at the top.
"""

import json
import os
import textwrap
from dataclasses import dataclass
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib import colors, ticker

from . import style
from .results import RunError, in_parallel, write_atomically

KINDS = {
    "steps": ("traversal steps\nper ray", "Traversal steps: nodes or cells a ray traverses, leaves included.", "steps"),
    "prims": ("primitive tests\nper ray", "Primitive tests: ray–primitive tests, repeats included.", "tests"),
}
CLIP = 99.9  # percentile of all counts at which the colours end, so that a few rays do not darken all others
APART = 5  # log colours where most structures stay below 1/APART of the range

DPI = 144
COLOURS = "inferno"  # perceptually uniform, from black to light yellow
ACROSS = 6  # structures side by side; more go into further rows
SHEET = 2000  # pixels that a sheet may be wide before its panels shrink
SMALLEST, LARGEST = 300, 640  # pixels of a panel's width
LOWEST = 190  # pixels of a row's height, where panels are flat: room for a colour bar's label
TEXT, SMALL, TITLE = 8, 7, 11  # points
LINE = 21  # pixels of a line of text of size TEXT
GAP, MARGIN = 16, 20  # pixels
BAR, BAR_ROOM = 16, 135  # pixels: width of a colour bar, and what it takes with its numbers and label


class NothingCounted(RunError):
    """None of the structures can count."""


@dataclass(frozen=True)
class Heat:
    """The heat maps of one scene. `maps` has for each spec {"steps": matrix, "prims": matrix} or a text: why not."""

    scene: str
    picture: np.ndarray
    maps: dict

    @property
    def counted(self):
        """The maps of the structures that have some."""
        return {spec: maps for spec, maps in self.maps.items() if not isinstance(maps, str)}


def read(folder):
    """Reads a folder of heat maps. Throws RunError: one line that says what is wrong with it."""
    folder = Path(folder)
    path = folder / "heat.json"
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        picture = plt.imread(folder / content["picture"])
        maps = {
            entry["spec"]: entry["why_not"] if "why_not" in entry else {k: _map(folder / entry[k]) for k in KINDS}
            for entry in content["maps"]
        }
        heat = Heat(content["scene"], picture, maps)
    except FileNotFoundError as error:
        raise RunError(f"{error.filename}: missing, so there are no heat maps to draw") from None
    except (ValueError, KeyError, TypeError, OSError) as error:
        raise RunError(f"{path}: no heat maps: {type(error).__name__}: {' '.join(str(error).split())}") from None
    shapes = {m.shape for maps in heat.counted.values() for m in maps.values()}
    if not shapes:
        raise NothingCounted(f"{path}: nothing was counted")
    if len(shapes) > 1:
        raise RunError(f"{path}: maps of different sizes")
    return heat


def _map(path):
    counts = np.load(path, allow_pickle=False)
    if counts.ndim != 2 or counts.dtype.kind != "u" or counts.size == 0:
        raise ValueError(f"{path.name}: not a matrix of counts")
    return counts


def write(heat, out, kinds=tuple(KINDS), scale="auto"):
    """Draws the sheet as the PNG file `out`. Throws OSError."""
    figure = sheet(heat, kinds, scale)
    write_atomically(Path(out), lambda path: figure.savefig(path, dpi=DPI, metadata={"Software": None}))
    plt.close(figure)


def draw_all(run):
    """Writes DIR/plots/heat_STEM.png for each DIR/heat/STEM that a run left. Returns [(name, what it shows)]."""
    folders = sorted(path.parent for path in (run.directory / "heat").glob("*/heat.json"))
    return [entry for entry in in_parallel(_draw, [(run, folder) for folder in folders]) if entry]


def _draw(run, folder):
    try:
        heat = read(folder)
    except NothingCounted:
        return None
    name = f"heat_{folder.name}"
    write(heat, run.directory / "plots" / f"{name}.png")
    return name, f"{short(heat.scene)}: what each camera ray costs"


def norm(maps, scale="auto"):
    """One colour scale for these maps, from 0 to a high percentile of all counts; and whether some lie above."""
    most = max(int(counts.max()) for counts in maps)
    top = max(1.0, float(np.ceil(np.percentile(np.concatenate([counts.ravel() for counts in maps]), CLIP))))
    if most <= 1.05 * top:
        top = float(max(1, most))
    if scale == "auto":
        tops = sorted(float(np.percentile(counts, CLIP)) for counts in maps)
        scale = "log" if top > APART * max(1.0, tops[(len(tops) - 1) // 2]) else "linear"
    if scale == "log":  # log(1 + count), so that zero has a place
        return colors.FuncNorm((np.log1p, np.expm1), 0, top), most > top
    return colors.Normalize(0, top), most > top


def sheet(heat, kinds=tuple(KINDS), scale="auto"):
    """The figure: the picture, then what was counted side by side; a row, or several, for each of `kinds`."""
    specs = list(heat.counted)
    lines = -(-len(specs) // ACROSS)
    across = -(-len(specs) // lines)
    height, width = next(iter(heat.counted.values()))["steps"].shape
    panel_width = _panel_width(width, across + 1)
    panel_height = max(1, round(panel_width * height / width))
    names = {spec: style.wrap_spec(spec, int(panel_width / 8.2)) for spec in specs}
    cell_height = max(panel_height, LOWEST)
    head = LINE * (2 + max(name.count("\n") for name in names.values())) + 6
    rows = len(kinds) * lines
    sheet_width = 2 * MARGIN + (across + 1) * (panel_width + GAP) + BAR_ROOM
    top = 2 * MARGIN + LINE

    norms = {kind: norm([maps[kind] for maps in heat.counted.values()], scale) for kind in kinds}
    notes = _notes(heat, kinds, norms, width, height)
    figure = plt.figure(dpi=DPI)
    small = {"fontsize": SMALL, "color": style.GREY, "linespacing": 1.35}
    # The notes go under the picture where they fit, else below everything.
    room = panel_height + head - LINE if rows > 1 else 0
    beside = [_wrap(notes, panel_width, separator) for separator in ("\n\n", "\n")]
    beside = next((text for text in beside if _height(figure, text, small) <= room), None)
    paragraphs = beside or _wrap(notes, sheet_width - 2 * MARGIN, " ")
    foot = MARGIN if beside else MARGIN + GAP + _height(figure, paragraphs, small)
    sheet_height = top + rows * (head + cell_height + GAP) + foot
    figure.set_size_inches(sheet_width / DPI, sheet_height / DPI)

    def place(x, y, w, h):
        """Axes at pixels from the top left corner."""
        return figure.add_axes((x / sheet_width, 1 - (y + h) / sheet_height, w / sheet_width, h / sheet_height))

    def write_text(x, y, text, **look):
        figure.text(x / sheet_width, 1 - y / sheet_height, text, va="top", **look)

    title = f"{short(heat.scene)}: what each camera ray costs"
    write_text(MARGIN, MARGIN, textwrap.shorten(title, int(sheet_width / 15)), fontsize=TITLE, weight="bold")
    picture = place(MARGIN, top + head, panel_width, panel_height)
    _blank(picture)
    picture.imshow(heat.picture, aspect="auto", interpolation="antialiased")
    picture.set_title("the scene", fontsize=TEXT, loc="left", pad=4)
    under = top + head + cell_height + GAP + LINE if beside else sheet_height - foot + GAP / 2
    write_text(MARGIN, under, paragraphs, **small)

    for row in range(rows):
        kind, line = kinds[row // lines], row % lines
        y = top + row * (head + cell_height + GAP) + head
        for column, spec in enumerate(specs[line * across : (line + 1) * across]):
            axis = place(MARGIN + (column + 1) * (panel_width + GAP), y, panel_width, panel_height)
            _blank(axis)
            counts = heat.maps[spec][kind]
            drawn = axis.imshow(counts, cmap=COLOURS, norm=norms[kind][0], aspect="auto", interpolation="antialiased")
            facts = f"mean {_number(counts.mean())}, max {counts.max():,}"
            axis.set_title(f"{names[spec]}\n{facts}", fontsize=TEXT, loc="left", pad=4, linespacing=1.3)
        bar = place(MARGIN + (across + 1) * (panel_width + GAP), y, BAR, cell_height)
        _colour_bar(figure, drawn, bar, *norms[kind], KINDS[kind][0])
    return figure


def _panel_width(width, columns):
    """As many pixels as the maps have, where that fits: so each is shown as it is."""
    room = (SHEET - 2 * MARGIN - BAR_ROOM) // columns - GAP
    most = min(LARGEST, max(SMALLEST, room))
    if width > most:
        return most
    return width * -(-SMALLEST // width)


def _colour_bar(figure, drawn, axis, scale, clipped, label):
    bar = figure.colorbar(drawn, cax=axis, extend="max" if clipped else "neither", extendfrac=0.04)
    if isinstance(scale, colors.FuncNorm):
        first = 1 if scale.vmax > 100 else 0  # 1 lies close to 0 on a long scale
        bar.set_ticks([0, *(10**k for k in range(first, 12) if 10**k <= scale.vmax)])
        bar.ax.yaxis.set_minor_locator(ticker.NullLocator())
    else:
        bar.ax.yaxis.set_major_locator(ticker.MaxNLocator(6, integer=True, steps=[1, 2, 2.5, 5, 10]))
    bar.ax.yaxis.set_major_formatter(
        ticker.FuncFormatter(lambda value, _: f"{value:,.0f}" if value < 1e5 else style.number(value))
    )
    bar.ax.tick_params(labelsize=SMALL, width=0.6, length=3)
    bar.outline.set_linewidth(0.5)
    bar.set_label(label + (", log scale" if isinstance(scale, colors.FuncNorm) else ""), fontsize=TEXT, labelpad=6)


def _blank(axis):
    axis.set_xticks([])
    axis.set_yticks([])
    for spine in axis.spines.values():
        spine.set_visible(False)


def _notes(heat, kinds, norms, width, height):
    """Sentences that say what is seen."""
    notes = [f"{width:,} × {height:,} camera rays, one through the centre of each pixel; closest hits."]
    notes += [KINDS[kind][1] for kind in kinds]
    notes.append("Equal colours mean equal counts in all panels that share a colour bar.")
    for kind in kinds:
        if norms[kind][1]:
            notes.append(
                f"Colours for {KINDS[kind][2]} end at {norms[kind][0].vmax:,.0f}, the {CLIP}th percentile of all rays "
                "shown; the arrow stands for more."
            )
    notes += [f"{spec} is not shown: it {why}." for spec, why in heat.maps.items() if isinstance(why, str)]
    return notes


def _wrap(notes, pixels, separator):
    width = max(20, int(pixels / 7.2))
    return "\n".join(textwrap.fill(note, width) for note in separator.join(notes).split("\n"))


def _height(figure, text, look):
    """In pixels, of a text as it will be drawn."""
    artist = figure.text(0, 0, text, **look)
    height = artist.get_window_extent(figure.canvas.get_renderer()).height
    artist.remove()
    return round(height)


def short(scene):
    """A file's name without its folders."""
    return os.path.basename(scene) if "(" not in scene else scene


def _number(value):
    return f"{value:,.1f}" if value < 1000 else f"{value:,.0f}"
