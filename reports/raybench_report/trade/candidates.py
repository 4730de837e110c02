"""What `raybench advise` tries, and why it may win. Short on purpose: each row has been the cheapest, or within some
percent of it, for some scene and some number of rays."""

from dataclasses import dataclass, replace


@dataclass(frozen=True)
class Candidate:
    spec: str
    why: str  # it may win; completes "NAME: ..."
    most_primitives: float = float("inf")  # of scenes that it is tried on
    after: str = ""  # it is tried only where this one, before it, comes near the best


# What builds fast stands first: it bounds what the others may cost.
EXACT_ENOUGH = (
    Candidate("bvh_morton", "the fastest to build of the trees"),
    Candidate("bvh_wide(builder=morton)", "a fast build, traced by SIMD"),
    Candidate("bvh_wide(builder=morton,width=8)", "the same with smaller nodes"),
    Candidate("grid", "builds in one pass; for few rays, or primitives of one size everywhere"),
    Candidate("bvh_sah(bins=8)", "the SAH with few bins: builds faster than with many"),
    Candidate("bvh_wide(bins=8)", "the SAH with few bins, traced by SIMD"),
    Candidate("bvh_wide", "the default of the fastest family"),
    Candidate("bvh_wide(width=8)", "nodes of half the size: better where a ray meets few children"),
    Candidate("bvh_wide(reinsertion=2)", "a better tree for somewhat more time to build"),
    Candidate("bvh_wide(builder=sweep)", "every plane of the SAH: where sizes are uneven"),
    Candidate("bvh_wide(builder=sweep,reinsertion=2)", "the best tree without splits: for many rays"),
    Candidate("bvh_wide(builder=sweep,width=8,reinsertion=2)", "the same with smaller nodes"),
    Candidate("bvh_sweep(reinsertion=2)", "the best binary tree: small scenes"),
    Candidate("bvh_wide(builder=spatial)", "splits primitives: where boxes overlap"),
    # These take long to build. Where overlap is what costs, spatial splits show it.
    Candidate(
        "bvh_wide(builder=spatial,split_budget=3)",
        "splits more: where boxes overlap much",
        after="bvh_wide(builder=spatial)",
    ),
    Candidate(
        "kdtree_sah",
        "no overlap at all: for many rays among long thin triangles in all directions",
        after="bvh_wide(builder=spatial)",
    ),
    Candidate("brute", "no build at all", 256),
)
# Where memory is short.
SMALL = (
    Candidate("bvh_wide(nodes=quantized8)", "boxes of 8 bits: the smallest nodes, the same answers"),
    Candidate("bvh_wide(nodes=quantized8,builder=morton)", "the same, built fast"),
    Candidate("bvh_wide(nodes=quantized8,leaves=indexed)", "the least memory: triangles stay in the scene's own arrays"),
    Candidate("bvh_sweep", "few bytes a primitive"),
)
# Where some answers may be wrong.
INEXACT = (
    Candidate("embree(quality=low)", "Embree's fastest build; rays leak at edges"),
    Candidate("embree", "as its users have it; rays leak at edges"),
    Candidate("embree(robust=true)", "fewer leaks than without"),
    Candidate("embree(quality=high)", "spatial splits, for many rays; rays leak at edges"),
    Candidate("bvh_morton(numerics=fast)", "a cheaper test of triangles; rays leak at edges"),
    Candidate("bvh_wide(numerics=fast)", "a cheaper test of triangles; rays leak at edges"),
    Candidate("bvh_wide(builder=sweep,reinsertion=2,numerics=fast)", "the same for many rays"),
)

# What giving up accuracy would bring, where nothing may be wrong.
TEMPTING = ("embree", "bvh_wide(numerics=fast)")


def chosen(primitives, max_error, memory, numerics, known, also=()):
    """The candidates for a scene, in the order in which they are tried. `numerics`: what our own structures compute
    with where it is not the default; `known`: names of the structures of this build."""
    rows = list(EXACT_ENOUGH)
    if memory:
        rows += SMALL
    if max_error > 0:
        rows += INEXACT
    if numerics:
        rows = [
            replace(c, spec=_with(c.spec, numerics), after=c.after and _with(c.after, numerics))
            for c in rows
            if c not in INEXACT
        ]
    rows += [Candidate(spec, "named by --also") for spec in also]
    return [c for c in rows if c.spec.split("(")[0] in known and primitives <= c.most_primitives]


def _with(spec, numerics):
    name, _, rest = spec.partition("(")
    values = [v for v in rest.rstrip(")").split(",") if v]
    return f"{name}({','.join([*values, f'numerics={numerics}'])})"
