"""What the sheet of heat maps needs of matplotlib: fonts, grey, names that wrap, numbers."""

import textwrap

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np

GREY = "#666666"

plt.rcParams.update({"font.family": "sans-serif", "text.parse_math": False})  # names come from users


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
