"""How time, memory and visits grow with the number of primitives: exponents fitted where one generator was measured at
several sizes."""

import numpy as np
import pandas as pd

from ..results import NULL
from . import vega
from .vega import Chart

LEAST = 3  # sizes that a fit needs
# Student's t at 97.5 % for 1, 2, ... degrees of freedom.
T = [12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228]

# What grows: title, unit, column of a case, its factor; of a build or of each kind of ray.
OF_BUILDS = [
    ("build time", "ms", "median_ns", 1e-6),
    ("memory of the tree", "MiB", "tree_bytes", 2.0**-20),
    ("peak of the build", "MiB", "build_peak_bytes", 2.0**-20),
]
OF_RAYS = [
    ("time per ray", "ns", "median_ns", 1),
    ("visits per ray", "steps", "steps", 1),
    ("bytes per ray", "bytes", "bytes", 1),
]


def points(report):
    """One row a structure x size x quantity: `measure` grows, `quantity` says of what and in which unit."""
    cases = report.timed_cases
    cases = cases[(cases["structure"] != NULL) & cases["scene"].str.contains("(", regex=False)]
    cases = cases.assign(family=cases["scene"].str.replace(r"\(.*", "", regex=True) + " (" + cases["run"] + ")")
    if len(report.runs) == 1:
        cases["family"] = cases["scene"].str.replace(r"\(.*", "", regex=True)
    cases = cases[cases["threads"] == cases.groupby(["run", "label", "spec", "query"])["threads"].transform("min")]
    cases["tree_bytes"] = cases["node_bytes"] + cases["prim_bytes"]
    build = cases["query"] == "build"
    parts = []
    for chosen, measures in ((cases[build], OF_BUILDS), (cases[~build], OF_RAYS)):
        of = "build" if measures is OF_BUILDS else chosen["rays_label"]
        for title, unit, column, factor in measures:
            value = pd.to_numeric(chosen[column]) * factor
            name = f"{title}, {unit}" if measures is OF_BUILDS else of + f", {unit} per ray"
            parts.append(chosen.assign(measure=title, of=of, quantity=name, value=value)[value > 0])
    known = pd.concat(parts)
    sizes = known.groupby(["family", "spec", "quantity"])["primitives"].transform("nunique")
    columns = ["run", "family", "label", "spec", "measure", "of", "quantity", "primitives", "value"]
    return known.loc[sizes >= LEAST, columns]


def fits(report):
    """Exponent of value ~ primitives^exponent by least squares of logarithms, with its interval of 95 %."""
    rows = []
    by = ["family", "spec", "measure", "of", "quantity"]
    for (family, spec, measure, of, quantity), here in points(report).groupby(by, sort=False):
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
                "measure": measure,
                "of": of,
                "quantity": quantity,
                "sizes": len(x),
                "exponent": slope,
                "lo": slope - wide,
                "hi": slope + wide,
            }
        )
    return pd.DataFrame(rows, columns=[*by, "sizes", "exponent", "lo", "hi"])


def charts(report):
    """Exponents, and the figures behind them, of builds and of rays."""
    known = points(report)
    if known.empty:
        return []
    fitted = fits(report)
    text = [f"N^{e:.2f} [{a:.2f}, {b:.2f}]" for e, a, b in fitted[["exponent", "lo", "hi"]].itertuples(index=False)]
    by = ["family", "spec", "quantity"]
    known = known.merge(fitted[[*by, "exponent"]].assign(text=text), on=by)
    fitted["panel"] = fitted["family"] + ": " + fitted["measure"]
    unit = known["quantity"].str.split(", ").str[-1]
    known["panel"] = known["family"] + ": " + unit.where(known["of"] != "build", known["quantity"])
    is_build = known["of"] == "build"
    made = []
    for name, what, rows in (("build", "builds and memory", known[is_build]), ("ray", "rays", known[~is_build])):
        if not rows.empty:
            here = fitted[(fitted["of"] == "build") == (name == "build")]
            made += [_exponents(report, name, what, here), _curves(report, name, what, rows)]
    return made


def _order(report, rows):
    return [spec for spec in report.order if spec in set(rows["spec"])]


def _exponents(report, name, what, fitted):
    panel = vega.intervals(
        "exponent",
        "lo",
        "hi",
        "exponent: it grows as N to this power",
        vega.names(order=_order(report, fitted)),
        vega.series("of", "of", list(dict.fromkeys(fitted["of"]))),
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
    panel["layer"][0]["encoding"]["x"]["scale"] = panel["layer"][1]["encoding"]["x"]["scale"] = {"zero": True}
    return Chart(
        f"scaling_exponents_{name}",
        f"Growth with the number of primitives: {what}",
        "Dots: fitted exponents with intervals of 95 %.",
        panel,
        fitted,
        list(fitted.columns),
        facet="panel",
        most=9,
        notes=[
            "Least squares of logarithms; interval of 95 % by Student's t, which calls the fit's residuals independent."
        ],
    )


def _curves(report, name, what, known):
    shown = vega.tooltip(
        ("spec", "structure"),
        ("family", "scene"),
        ("primitives", "primitives", ","),
        ("value", "value", ",.4~g"),
        ("text", "fit"),
    )
    colour = vega.series("spec", "structure", _order(report, known))
    x, y = vega.number("primitives", "primitives (log scale)"), vega.free(vega.number("value", "value (log scale)"))
    line = {"x": x, "y": y, "color": colour["color"]}
    return Chart(
        f"scaling_curves_{name}",
        f"Figures behind the exponents: {what}",
        "Lines: the quantity against the number of primitives, one a structure.",
        {
            "layer": [
                {"mark": {"type": "line", "strokeWidth": 1.2}, "encoding": line},
                {"mark": {"type": "point"}, "encoding": {"x": x, "y": y} | colour | shown},
            ]
        },
        known,
        list(known.columns),
        facet="panel",
        single="of",
        most=9,
        height=200,
        spans={"x": {"of": ["primitives"], "factor": 1}},
        resolve={"scale": {"y": "independent"}},
    )
