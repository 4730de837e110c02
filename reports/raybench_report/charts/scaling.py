"""How time grows with the number of primitives: exponents fitted where one generator was measured at several sizes."""

import numpy as np
import pandas as pd

from ..results import NULL
from . import vega
from .vega import Chart

LEAST = 3  # sizes that a fit needs
# Student's t at 97.5 % for 1, 2, ... degrees of freedom.
T = [12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228]


def points(report):
    """One row a structure x size x quantity: `value` in ms (builds) or ns per ray."""
    cases = report.timed_cases
    cases = cases[(cases["structure"] != NULL) & cases["scene"].str.contains("(", regex=False)]
    cases = cases.assign(family=cases["scene"].str.replace(r"\(.*", "", regex=True) + " (" + cases["run"] + ")")
    if len(report.runs) == 1:
        cases["family"] = cases["scene"].str.replace(r"\(.*", "", regex=True)
    cases = cases[cases["threads"] == cases.groupby(["run", "label", "spec", "query"])["threads"].transform("min")]
    build = cases["query"] == "build"
    cases = cases.assign(
        quantity=np.where(build, "build, ms", cases["rays_label"] + ", ns per ray"),
        value=np.where(build, cases["median_ns"] / 1e6, cases["median_ns"]),
    )
    sizes = cases.groupby(["family", "spec", "quantity"])["primitives"].transform("nunique")
    return cases.loc[sizes >= LEAST, ["run", "family", "label", "spec", "quantity", "primitives", "value"]]


def fits(report):
    """Exponent of value ~ primitives^exponent by least squares of logarithms, with its interval of 95 %."""
    rows = []
    for (family, spec, quantity), here in points(report).groupby(["family", "spec", "quantity"], sort=False):
        x, y = np.log(here["primitives"].to_numpy()), np.log(here["value"].to_numpy())
        spread = ((x - x.mean()) ** 2).sum()
        slope = ((x - x.mean()) * (y - y.mean())).sum() / spread
        rest, degrees = y - y.mean() - slope * (x - x.mean()), len(x) - 2
        error = np.sqrt((rest**2).sum() / degrees / spread)
        wide = error * (T[degrees - 1] if degrees <= len(T) else 2.0)
        rows.append(
            {
                "family": family,
                "spec": spec,
                "quantity": quantity,
                "sizes": len(x),
                "exponent": slope,
                "lo": slope - wide,
                "hi": slope + wide,
            }
        )
    return pd.DataFrame(rows, columns=["family", "spec", "quantity", "sizes", "exponent", "lo", "hi"])


def charts(report):
    """Exponents, and the times behind them."""
    known = points(report)
    if known.empty:
        return []
    fitted = fits(report)
    wanted = [q for q in dict.fromkeys(known["quantity"])]
    text = fitted.assign(
        text=[
            f"N^{e:.2f} [{a:.2f}, {b:.2f}]"
            for e, a, b in zip(fitted["exponent"], fitted["lo"], fitted["hi"], strict=True)
        ]
    )
    known = known.merge(text[["family", "spec", "quantity", "text", "exponent"]], on=["family", "spec", "quantity"])
    order = [spec for spec in report.order if spec in set(known["spec"])]
    shown = vega.tooltip(
        ("spec", "structure"),
        ("family", "scene"),
        ("primitives", "primitives", ","),
        ("value", "value", ",.4~g"),
        ("text", "fit"),
    )
    colour = vega.series("spec", "structure", order)
    x, y = vega.number("primitives", "primitives (log scale)"), vega.free(vega.number("value", "time (log scale)"))
    curves = {
        "layer": [
            {
                "mark": {"type": "line", "strokeWidth": 1.2},
                "encoding": {"x": x, "y": y, "color": colour["color"], "detail": {"field": "family"}},
            },
            {"mark": {"type": "point"}, "encoding": {"x": x, "y": y} | colour | shown},
        ]
    }
    exponents = vega.intervals(
        "exponent",
        "lo",
        "hi",
        "exponent: time grows as N to this power",
        vega.names(order=order),
        vega.series("quantity", "of", wanted),
        vega.tooltip(
            ("spec", "structure"),
            ("quantity", "of"),
            ("exponent", "exponent", ".3f"),
            ("lo", "from", ".3f"),
            ("hi", "to", ".3f"),
            ("sizes", "sizes"),
        ),
        log=False,
    )
    exponents["layer"][0]["encoding"]["x"]["scale"] = exponents["layer"][1]["encoding"]["x"]["scale"] = {"zero": True}
    return [
        Chart(
            "scaling_exponents",
            "Growth with the number of primitives",
            "Dots: fitted exponents with intervals of 95 %.",
            exponents,
            fitted,
            list(fitted.columns),
            facet="family",
            notes=[
                "Least squares of logarithms; interval of 95 % by Student's t, which calls the fit's residuals independent."
            ],
        ),
        Chart(
            "scaling_times",
            "Times behind the exponents",
            "Lines: time against number of primitives, one panel a quantity.",
            curves,
            known,
            ["run", "family", "label", "spec", "quantity", "primitives", "value", "exponent"],
            facet="quantity",
            height=200,
            spans={"x": {"of": ["primitives"], "factor": 1}},
            resolve={"scale": {"y": "independent"}},
        ),
    ]
