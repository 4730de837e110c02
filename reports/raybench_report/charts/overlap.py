"""When does a kd-tree win over a BVH? Where boxes overlap much: cells of a kd-tree never do."""

import pandas as pd

from . import predictors, vega
from .vega import Chart

NAMED = 4  # scenes whose names stand beside their dots


def rows(report):
    """One row a run x scene x ray set: the fastest kd-tree and the fastest binary BVH, both of raybench's default
    arithmetic, so that binary trees are compared with binary trees. ratio: the kd-tree's speed over the BVH's, lo and hi from
    the ends of both intervals; epo: that of the BVH's tree (Aila, Karras, Laine 2013)."""
    cases = report.timed_queries
    if cases.empty:
        return pd.DataFrame()
    cases = cases[
        ~cases["spec"].str.contains("numerics=", regex=False)
        & (cases["order"] != "shuffled")
        & (cases["threads"] == cases["threads"].min())
    ]
    relative = cases["median_ns"] / cases["anchor_ns"].where(cases["anchor_ns"].notna(), 1)  # parts of a set
    cases = cases.assign(relative=relative).sort_values("relative", kind="stable")
    key = ["run", "label", "rays_label"]
    fastest = lambda chosen: chosen.drop_duplicates(key)[
        [*key, "spec", "relative", "median_ns", "lo_ns", "hi_ns", "epo", "ray_set"]
    ]
    kd = fastest(cases[cases["structure"].str.startswith("kdtree_")])
    bvh = fastest(cases[predictors.is_binary(cases) & cases["epo"].notna()])
    both = kd.merge(bvh, on=[*key, "ray_set"], suffixes=("_kd", "_bvh"))
    ratio = both["relative_bvh"] / both["relative_kd"]
    return both.assign(
        ratio=ratio,
        lo=ratio * (both["lo_ns_bvh"] / both["median_ns_bvh"]) * (both["median_ns_kd"] / both["hi_ns_kd"]),
        hi=ratio * (both["hi_ns_bvh"] / both["median_ns_bvh"]) * (both["median_ns_kd"] / both["lo_ns_kd"]),
        epo=both["epo_bvh"],
        kdtree=both["spec_kd"],
        bvh=both["spec_bvh"],
    )


def charts(report):
    """Speed of the kd-tree over the BVH's against overlap."""
    known = rows(report)
    if known.empty:
        return []
    x = vega.number("epo", "overlap of the BVH's boxes, EPO (log scale)")
    x["scale"] |= {"domain": [known["epo"].min() / 1.4, known["epo"].max() * 1.4], "padding": 0}
    y = vega.number("ratio", "kd-tree's speed / BVH's (log)")
    panel = {
        "layer": [
            {"mark": {"type": "rule", "strokeDash": [3, 3]}, "encoding": {"y": {"datum": 1, "type": "quantitative"}}},
            {
                "mark": {"type": "rule", "opacity": 0.45},
                "encoding": {"x": x, "y": y | {"field": "lo"}, "y2": {"field": "hi"}},
            },
            {
                "mark": {"type": "point"},
                "encoding": {"x": x, "y": y}
                | vega.series("rays_label", "rays", [s for s in report.ray_sets if s in set(known["rays_label"])])
                | vega.tooltip(
                    ("label", "scene"), ("rays_label", "rays"), ("run", "run"), ("kdtree", "kd-tree"), ("bvh", "BVH"),
                    ("ratio", "kd-tree's speed over the BVH's", ".3f"), ("lo", "from", ".3f"), ("hi", "to", ".3f"), ("epo", "EPO", ".3~g"),
                ),
            },
            *(
                {
                    "transform": [
                        {"joinaggregate": [{"op": end, "field": field, "as": "end"}], "groupby": ["label"]},
                        {"filter": f"datum.{field} == datum.end && datum.name == '{name}'"},
                    ],
                    "mark": {"type": "text", "dy": dy, "style": "note"},
                    "encoding": {"x": x, "y": y | {"field": "end"}, "text": {"field": "label"}},
                }
                for end, field, name, dy in (("max", "hi", "above", -9), ("min", "lo", "below", 10))
            ),
        ]
    }  # fmt: skip
    columns = ["run", "label", "rays_label", "kdtree", "bvh", "epo", "ratio", "lo", "hi"]
    # names of the scenes where the kd-tree does best, by turns above and below their dots: more would hide these
    best = known.groupby("label")["ratio"].max().nlargest(NAMED).index
    scenes = known[known["label"].isin(best)].sort_values("epo")["label"].unique()
    place = {scene: ("above", "below")[at % 2] for at, scene in enumerate(scenes)}
    known = known.assign(name=known["label"].map(place).fillna(""))
    return [
        Chart(
            "overlap",
            "When does a kd-tree win over a BVH?",
            "Dots: speed of the fastest kd-tree over that of the fastest binary BVH, by overlap of the BVH's boxes; above 1 the kd-tree wins.",
            panel,
            known[[*columns, "ray_set", "name"]],
            columns,
            facet=None,
            height=240,
            spans={"x": {"of": ["epo"], "factor": 1}, "y": {"of": ["lo", "hi"], "factor": 1}},
            notes=[
                "Above 1 the kd-tree wins. One dot a scene and kind of ray: the fastest of each, both binary trees, default "
                "arithmetic. Cells of a kd-tree do not overlap (EPO 0), and the nearest one is visited first."
            ],
        )
    ]
