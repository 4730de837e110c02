"""The look all plots share: sizes for a paper's column, colours and marks per structure, axes, notes."""

import textwrap

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib import ticker
from matplotlib.lines import Line2D

COLUMN = 3.5  # inches: one column of a two-column paper
PAGE = 8.5  # inches: a figure taller than this gets two columns of panels

# Okabe and Ito's colours, safe for colour-blind readers, without black and yellow; marks tell apart in grey.
COLOURS = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9"]
MARKS = ["o", "s", "^", "D", "v", "P", "X"]
GREY = "#666666"

plt.rcParams.update(
    {
        "font.family": "sans-serif",
        "font.size": 7,
        "axes.titlesize": 7,
        "axes.labelsize": 7,
        "xtick.labelsize": 6.5,
        "ytick.labelsize": 6.5,
        "legend.fontsize": 6.5,
        "legend.frameon": False,
        "axes.linewidth": 0.5,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "xtick.major.width": 0.5,
        "ytick.major.width": 0.5,
        "xtick.minor.width": 0.3,
        "ytick.minor.width": 0.3,
        "xtick.major.size": 2.5,
        "xtick.minor.size": 1.5,
        "ytick.major.size": 2.5,
        "ytick.minor.size": 1.5,
        "xtick.major.pad": 2,
        "ytick.major.pad": 2,
        "lines.markersize": 3,
        "hatch.linewidth": 0.4,
        "text.parse_math": False,  # names come from users
        "svg.fonttype": "none",  # text stays text
        "svg.hashsalt": "raybench",  # the same run gives the same file
        "savefig.dpi": 300,
    }
)


def looks(specs):
    """Colour and mark of each structure: the same in every plot of a run."""
    return {spec: (COLOURS[i % len(COLOURS)], MARKS[i % len(MARKS)]) for i, spec in enumerate(specs)}


def wrap_spec(spec, width):
    """Breaks a long name(key=value,...) after commas and the parenthesis."""
    spaced = spec.replace("(", "(\t").replace(",", ",\t")
    lines = textwrap.wrap(
        spaced.replace(" ", "\0"),
        width,
        expand_tabs=False,
        replace_whitespace=False,
        break_long_words=False,
        break_on_hyphens=False,
    )
    return "\n".join(lines).replace("\t", "").replace("\0", " ")


def shorten(name, width):
    """A name from a user's file, cut in the middle where it is longer than `width`."""
    return name if len(name) <= width else f"{name[: width - 16]}…{name[-15:]}"


def panels(count):
    """Figure with so many panels; finish() gives it its size and lays it out."""
    figure = plt.figure()
    return figure, [figure.add_axes((0.1, 0.1, 0.8, 0.8), label=str(i)) for i in range(count)]


def finish(figure, heights, x_label, legend=None, notes=()):
    """Sets panels of these heights (inches) below each other, in two columns where a page would not hold one.

    All panels get the same width. `legend` goes above them, the sentences of `notes` below in small print.
    """
    axes = figure.axes
    title, ticks, label, pad = 0.2, 0.2, 0.13, 0.04
    columns = 1 if len(axes) == 1 or sum(heights) + (title + ticks) * len(axes) <= PAGE else 2
    width = COLUMN * columns
    rows = [max(heights[i : i + columns]) for i in range(0, len(heights), columns)]

    text = textwrap.fill(" ".join(filter(None, notes)), int(width * 24), break_long_words=False)
    small = figure.text(0, 0, text, fontsize=5.5, color=GREY, va="bottom") if text else None
    figure.set_size_inches(width, 1)
    above = _inches(figure, legend)[1] + 2 * pad if legend else 0
    below = _inches(figure, small)[1] + 2 * pad if small else pad
    height = above + sum(rows) + (title + ticks) * len(rows) + label + below
    figure.set_size_inches(width, height)
    if legend:
        legend.set_bbox_to_anchor((pad / width, 1 - pad / height), figure.transFigure)
    if small:
        small.set_position((pad / width, pad / height))

    left = [0.0] * columns
    for i, axis in enumerate(axes):
        names = [_inches(figure, name)[0] for name in axis.get_yticklabels() if name.get_text()]
        left[i % columns] = max([left[i % columns], *names])
    extra = pad + 0.06 + (0.17 if axes[0].get_ylabel() else 0)
    top = height - above
    for i, axis in enumerate(axes):
        row, column = divmod(i, columns)
        if column == 0:
            top -= title
        start = column * COLUMN + left[column] + extra
        axis.set_position(
            (
                start / width,
                (top - heights[i]) / height,
                ((column + 1) * COLUMN - 0.12 - start) / width,
                heights[i] / height,
            )
        )
        if axis.get_ylabel():
            axis.yaxis.set_label_coords(-(left[column] + 0.12) / ((column + 1) * COLUMN - 0.12 - start), 0.5)
        if i + columns >= len(axes):
            axis.set_xlabel(x_label, labelpad=2)
        if column == columns - 1:
            top -= rows[row] + ticks
    return figure


def _inches(figure, artist):
    """Width and height of something drawn."""
    box = artist.get_window_extent(figure.canvas.get_renderer())
    return box.width / figure.dpi, box.height / figure.dpi


def scale(axes, values, which="x"):
    """One scale for all panels: linear from zero where the values lie within a factor of five, else logarithmic;
    with a place for zero where there are zeros."""
    values = np.asarray(values, dtype=float)
    values = values[np.isfinite(values)]
    positive = values[values > 0]
    low, high = (positive.min(), positive.max()) if len(positive) else (1, 1)
    zeros = (values == 0).any()
    for axes_ in axes:
        axis = getattr(axes_, f"{which}axis")
        set_scale, set_limits = getattr(axes_, f"set_{which}scale"), getattr(axes_, f"set_{which}lim")
        if high / low < 5:
            set_limits(0, 1.06 * high)
            axis.set_major_locator(ticker.MaxNLocator(5, steps=[1, 2, 5, 10]))
        else:
            first, last = int(np.floor(np.log10(low))), int(np.ceil(np.log10(high)))
            every = -(-(last - first) // 5)
            decades = [10.0**d for d in range(first, last + 1, every)]
            if zeros:
                set_scale("symlog", linthresh=10.0**first, linscale=0.6)
                set_limits(-0.2 * 10.0**first, high * 1.6)
                axis.set_major_locator(ticker.FixedLocator([0, *decades]))
            else:
                margin = (high / low) ** 0.05
                set_scale("log")
                set_limits(low / margin, high * margin)
                short = high / low < 100
                axis.set_major_locator(ticker.LogLocator(subs=(1, 2, 5)) if short else ticker.FixedLocator(decades))
            within = last - first <= 7
            axis.set_minor_locator(
                ticker.FixedLocator(
                    [k * 10.0**d for d in range(first, last + 1) for k in range(1, 10)] if within else []
                )
            )
        axis.set_major_formatter(ticker.FuncFormatter(lambda value, _: number(value)))
        axis.set_minor_formatter(ticker.NullFormatter())


def number(value):
    """A tick's label: plain from 0.001 to 9999, else as a power of ten."""
    if value == 0:
        return "0"
    if 0.9e-3 < abs(value) < 1e4:
        return f"{value:.4g}" if abs(value) < 1000 else f"{value:.0f}"
    exponent = int(np.floor(np.log10(abs(value)) + 1e-9))
    mantissa = f"{value / 10.0**exponent:.3g}"
    power = "10" + str(exponent).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
    return power if mantissa == "1" else f"{mantissa}·{power}"


def mark(label, colour, shape, hollow=False, size=3):
    """Entry of a legend."""
    return Line2D(
        [],
        [],
        color=colour,
        marker=shape,
        linestyle="none",
        label=wrap_spec(label, 60),
        markersize=size,
        markerfacecolor="white" if hollow else colour,
        markeredgewidth=0.7,
    )


def legend(figure, handles):
    """Legend of these entries, as many side by side as fit one column."""
    longest = max(len(line) for handle in handles for line in handle.get_label().split("\n"))
    return figure.legend(
        handles=handles,
        loc="upper left",
        ncols=max(1, min(len(handles), int(COLUMN * 17 / (longest + 4)))),
        handletextpad=0.3,
        columnspacing=1.0,
        borderpad=0.1,
        borderaxespad=0,
        labelspacing=0.3,
    )
