"""Wrong answers that `raybench verify` saw, or could have missed."""

import numpy as np

from . import vega
from .vega import Chart


def charts(rows):
    """Share of wrong answers by structure and ray set. `rows` of verdicts.csv with run and label."""
    wrong = rows[["leak", "wrong", "false_miss", "false_hit"]].sum(axis=1)
    judged = rows["rays"].clip(lower=1)
    rows = rows.assign(
        errors=wrong,
        share=wrong / judged,
        shown=np.where(wrong > 0, wrong / judged, 1 - 0.05 ** (1 / judged)),
        seen=np.where(wrong > 0, "measured", "none seen: at most (95 %)"),
        rays_label=rows["ray_set"] + " (" + rows["query"] + ")",
    )
    seen = ["measured", "none seen: at most (95 %)"]
    x = vega.number("shown", "share of wrong answers (log scale, left is better)")
    x["axis"] = {"labelExpr": "format(datum.value, '~%')", "values": [10.0**d for d in range(-9, 1)]}
    panel = {
        "mark": {"type": "point", "opacity": 0.7},
        "encoding": vega.names(order=sorted(rows["spec"].unique()))
        | {
            "x": x,
            "color": {"field": "seen", "type": "nominal", "title": None, "sort": seen, "scale": {"domain": seen}},
            "shape": {
                "field": "seen",
                "type": "nominal",
                "title": None,
                "sort": seen,
                "scale": {"domain": seen, "range": ["circle", "triangle-left"]},
            },
        }
        | vega.tooltip(
            ("spec", "structure"),
            ("rays_label", "rays"),
            ("errors", "wrong", ","),
            ("rays", "rays", ","),
            ("leak_upper", "leaks at most (95 %)", ".2~e"),
            ("plain_upper", "plain errors at most (95 %)", ".2~e"),
        ),
    }
    columns = [
        "run",
        "label",
        "spec",
        "claim",
        "ray_set",
        "query",
        "rays",
        "errors",
        "share",
        "leak_upper",
        "plain_upper",
    ]
    return [
        Chart(
            "verdicts",
            "Wrong answers of raybench verify",
            "Dots: share of wrong answers by structure, one dot a ray set.",
            panel,
            rows[[*columns, "rays_label", "shown", "seen"]],
            columns,
            notes=["Every ray was judged. Triangles: none was wrong; the true share lies left of them (95 %)."],
        )
    ]
