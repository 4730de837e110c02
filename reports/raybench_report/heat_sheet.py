"""A sheet of heat maps: structures side by side on one scale, as `raybench render --heat` leaves it."""

import textwrap
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib import colors, ticker

from . import style
from .heat import CLIP, KINDS, scale_of, short
from .pictures import ramp
from .results import write_atomically

DPI = 144
COLOURS = colors.ListedColormap(np.array(ramp(256)) / 255)
ACROSS = 6  # structures side by side; more go into further rows
SHEET = 2000  # pixels that a sheet may be wide before its panels shrink
SMALLEST, LARGEST = 300, 640  # pixels of a panel's width
LOWEST = 190  # pixels of a row's height, where panels are flat: room for a colour bar's label
TEXT, SMALL, TITLE = 8, 7, 11  # points
LINE = 21  # pixels of a line of text of size TEXT
GAP, MARGIN = 16, 20  # pixels
BAR, BAR_ROOM = 16, 135  # pixels: width of a colour bar, and what it takes with its numbers and label


def write(heat, out, kinds=tuple(KINDS), scale="auto"):
    """Draws the sheet as the PNG file `out`. Throws OSError."""
    figure = sheet(heat, kinds, scale)
    write_atomically(Path(out), lambda path: figure.savefig(path, dpi=DPI, metadata={"Software": None}))
    plt.close(figure)


def norm(maps, scale="auto"):
    """scale_of() as matplotlib's."""
    top, log, clipped = scale_of(maps, scale)
    return (colors.FuncNorm((np.log1p, np.expm1), 0, top) if log else colors.Normalize(0, top)), clipped


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


def _number(value):
    return f"{value:,.1f}" if value < 1000 else f"{value:,.0f}"
