"""A sheet of heat maps: structures side by side on one scale, as `raybench render --heat` leaves it."""

import base64
import io
import textwrap
from dataclasses import dataclass, field
from pathlib import Path

import jinja2
import numpy as np
import vl_convert
from PIL import Image

from .charts import vega
from .heat import CLIP, KINDS, scale_of, short
from .pictures import ramp
from .results import write_atomically

ACROSS = 6  # structures side by side; more go into further rows
# Pixels from here on.
SHEET = 2000  # that a sheet may be wide before its panels shrink
SMALLEST, LARGEST = 300, 640  # of a panel's width
LOWEST = 200  # of a row's height, where panels are flat: room for a colour bar's label
TEXT, SMALL, TITLE = 16, 14, 22  # sizes of letters
LINE = 21  # of a line of TEXT; those of others are in proportion
GAP, MARGIN = 16, 20
BAR, BAR_ROOM = 16, 135  # width of a colour bar, and what it takes with its numbers and label
WIDE = 0.52  # mean width of a letter, in its size; names in code are wider than sentences


@dataclass
class Scale:
    """What the colours of one kind of count mean: from 0 to `top`, by log(1 + count) where `log`; `clipped`: some counts lie
    above."""

    top: float
    log: bool
    clipped: bool

    def shares(self, counts):
        """0 to 1, from the darkest colour to the brightest."""
        values = np.asarray(counts, dtype=float)
        return np.clip(np.log1p(values) / np.log1p(self.top) if self.log else values / self.top, 0, 1)

    def ticks(self):
        """Counts with a number beside the colour bar."""
        if self.log:
            first = 1 if self.top > 100 else 0  # 1 lies close to 0 on a long scale
            return [0, *(10**k for k in range(first, 12) if 10**k <= self.top)]
        steps = (m * 10**k for k in range(12) for m in (1, 2, 2.5, 5) if float(m * 10**k).is_integer())
        step = next(s for s in steps if self.top / s <= 6)
        return [int(k * step) for k in range(int(self.top / step) + 1)]


@dataclass
class Sheet:
    """What stands where, in pixels from the top left corner; the template draws it."""

    width: int
    height: int = 0
    texts: list = field(default_factory=list)  # x, y of the first line's top, lines, size, colour, weight
    images: list = field(default_factory=list)  # x, y, width, height, pixels
    bars: list = field(default_factory=list)  # x, y, height, Scale, lines of the label

    def write(self, x, y, text, size=TEXT, colour="ink", bold=False):
        """Text of one or more lines. Returns its height."""
        lines = text.split("\n")
        self.texts.append(
            {"x": x, "y": y, "lines": lines, "size": size, "line": _line(size), "colour": colour, "bold": bold}
        )
        return len(lines) * _line(size)


def write(heat, out, kinds=tuple(KINDS), scale="auto"):
    """Draws the sheet as the PNG file `out`. Throws OSError."""
    png = vl_convert.svg_to_png(svg(sheet(heat, kinds, scale)), scale=1, ppi=72)
    image = Image.open(io.BytesIO(png)).convert("RGB")  # a third smaller than with an alpha of 255
    write_atomically(Path(out), lambda path: image.save(path, optimize=True))


def svg(sheet):
    """The sheet as an SVG that needs no other file."""
    environment = jinja2.Environment(loader=jinja2.FileSystemLoader(Path(__file__).parent), autoescape=True)
    environment.filters |= {"url": _url, "count": _count}
    look = vega.config("print")
    return environment.get_template("heat_sheet.svg.j2").render(
        sheet=sheet, font=look["font"], bar=BAR, ramp=np.array(ramp(256), np.uint8)[::-1, None], small=SMALL, size=TEXT, line=LINE,
        colours={"ink": look["axis"]["labelColor"], "faint": look["axis"]["titleColor"]},
    )  # fmt: skip


def sheet(heat, kinds=tuple(KINDS), scale="auto"):
    """The picture, then what was counted side by side; a row, or several, for each of `kinds`."""
    specs = list(heat.counted)
    lines = -(-len(specs) // ACROSS)
    across = -(-len(specs) // lines)
    height, width = next(iter(heat.counted.values()))["steps"].shape
    panel_width = _panel_width(width, across + 1)
    panel_height = max(1, round(panel_width * height / width))
    names = {spec: wrap_spec(spec, int(panel_width / (WIDE * TEXT))) for spec in specs}
    cell_height = max(panel_height, LOWEST)
    head = LINE * (2 + max(name.count("\n") for name in names.values())) + 6
    rows = len(kinds) * lines
    scales = {kind: Scale(*scale_of([maps[kind] for maps in heat.counted.values()], scale)) for kind in kinds}

    found = Sheet(2 * MARGIN + (across + 1) * (panel_width + GAP) + BAR_ROOM)
    title = textwrap.shorten(f"{short(heat.scene)}: what each camera ray costs", int(found.width / (0.65 * TITLE)))
    found.write(MARGIN, MARGIN, title, TITLE, bold=True)
    top = 2 * MARGIN + LINE
    found.write(MARGIN, top + head - LINE - 4, "the scene")
    found.images.append((MARGIN, top + head, panel_width, panel_height, heat.picture))
    for row in range(rows):
        kind, line = kinds[row // lines], row % lines
        y = top + row * (head + cell_height + GAP) + head
        for column, spec in enumerate(specs[line * across : (line + 1) * across]):
            counts, x = heat.maps[spec][kind], MARGIN + (column + 1) * (panel_width + GAP)
            found.images.append((x, y, panel_width, panel_height, _painted(counts, scales[kind])))
            text = f"{names[spec]}\nmean {_number(counts.mean())}, max {counts.max():,}"
            found.write(x, y - LINE * (1 + text.count("\n")) - 4, text)
        label = KINDS[kind][0] + (", log scale" if scales[kind].log else "")
        found.bars.append(
            (MARGIN + (across + 1) * (panel_width + GAP), y, cell_height, scales[kind], label.split("\n"))
        )

    bottom = top + rows * (head + cell_height + GAP)
    notes = _notes(heat, kinds, scales, width, height)
    # They go under the picture where they fit, else below everything.
    room = panel_height + head - LINE if rows > 1 else 0
    beside = [_wrap(notes, panel_width, separator) for separator in ("\n\n", "\n")]
    beside = next((text for text in beside if (1 + text.count("\n")) * _line(SMALL) <= room), None)
    if beside:
        found.write(MARGIN, top + head + cell_height + GAP + LINE, beside, SMALL, "faint")
        found.height = bottom + MARGIN
    else:
        text = _wrap(notes, found.width - 2 * MARGIN, " ")
        found.height = bottom + found.write(MARGIN, bottom, text, SMALL, "faint") + MARGIN
    return found


def _line(size):
    return round(size * LINE / TEXT)


def _panel_width(width, columns):
    """As many pixels as the maps have, or a multiple, where that fits: so each is shown as it is."""
    room = (SHEET - 2 * MARGIN - BAR_ROOM) // columns - GAP
    most = min(LARGEST, max(SMALLEST, room))
    return most if width > most else width * (most // width)


def _painted(counts, scale):
    colours = np.array(ramp(256), np.uint8)
    return colours[np.round(255 * scale.shares(counts)).astype(np.uint8)]


def _url(pixels, width, height):
    """An image of that size as a data URL: pixels stay sharp where it grows, and are averaged where it shrinks."""
    image = Image.fromarray(np.ascontiguousarray(pixels))
    image = image.resize((width, height), Image.Resampling.NEAREST if width >= image.width else Image.Resampling.BOX)
    out = io.BytesIO()
    image.save(out, "PNG")
    return f"data:image/png;base64,{base64.b64encode(out.getvalue()).decode()}"


def _notes(heat, kinds, scales, width, height):
    """Sentences that say what is seen."""
    notes = [f"{width:,} × {height:,} camera rays, one through the centre of each pixel; closest hits."]
    notes += [KINDS[kind][1] for kind in kinds]
    notes.append("Equal colours mean equal counts in all panels that share a colour bar.")
    for kind in kinds:
        if scales[kind].clipped:
            notes.append(
                f"Colours for {KINDS[kind][2]} end at {scales[kind].top:,.0f}, the {CLIP}th percentile of all rays "
                "shown; the arrow stands for more."
            )
    notes += [f"{spec} is not shown: it {why}." for spec, why in heat.maps.items() if isinstance(why, str)]
    return notes


def _wrap(notes, pixels, separator):
    width = max(20, int(pixels / (WIDE * SMALL)))
    return "\n".join(textwrap.fill(note, width) for note in separator.join(notes).split("\n"))


def wrap_spec(spec, width):
    """Breaks a long name(key=value,...) after commas and the parenthesis."""
    spaced = spec.replace("(", "(\t").replace(",", ",\t")
    lines = textwrap.wrap(
        spaced.replace(" ", "\0"), width, expand_tabs=False, replace_whitespace=False, break_long_words=False,
        break_on_hyphens=False,
    )  # fmt: skip
    return "\n".join(lines).replace("\t", "").replace("\0", " ")


def _number(value):
    return f"{value:,.1f}" if value < 1000 else f"{value:,.0f}"


def _count(value):
    """A tick's label: in full, or as a power of ten from 100,000 on."""
    if value < 1e5:
        return f"{value:,.0f}"
    exponent = int(np.floor(np.log10(value) + 1e-9))
    power = "10" + str(exponent).translate(str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹"))
    mantissa = f"{value / 10.0**exponent:.3g}"
    return power if mantissa == "1" else f"{mantissa}·{power}"
