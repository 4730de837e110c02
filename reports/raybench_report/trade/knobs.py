"""What can be turned, and how far: the knobs of `raybench tradeoff`."""

import difflib
import re
from dataclasses import dataclass, field

from ..results import RunError

# Structures whose arithmetic is compared, where the program has them.
ARITHMETIC = ("bvh_sah", "bvh_wide", "kdtree_sah")
LIBRARY = ("embree", "embree(robust=true)", "embree(compact=true)", "embree(robust=true,compact=true)")
# (structure, parameter, values): what the knob `parameters` turns; answers must not move.
PARAMETERS = (
    ("bvh_sah", "leaf_size", (1, 2, 4, 8, 16)),
    ("bvh_sah", "bins", (4, 8, 16, 32, 64)),
    ("bvh_wide(builder=spatial)", "split_budget", (0, 0.25, 0.5, 1, 2)),
    ("kdtree_sah", "max_depth", (0, 8, 12, 16, 20, 24)),
    ("grid", "density", (0.25, 0.5, 1, 2, 4, 8)),
)
VALUES = {(s, p): v for s, p, v in PARAMETERS}

PICTURES = {  # knob → (what it turns, values, quick ones)
    "depth": ("most reflections and refractions in a row", (0, 1, 2, 3, 4, 6, 8, 16), (0, 1, 2, 4, 8)),
    "contribution": ("contribution below which a path ends", (0.1, 0.03, 0.01, 0.003, 0.001, 0.0003), (0.1, 0.01, 0.001)),
    "samples": ("N x N camera rays a pixel, in each pattern", (1, 2, 3, 4, 6, 8), (1, 2, 4)),
    "adaptive": ("contrast above which a pixel gets all of 4 x 4 samples", (0.3, 0.1, 0.03, 0.01), (0.1, 0.03)),
    "filter": ("filter of 4 x 4 low-discrepancy samples, against the same filter of the reference's", ("box", "tent", "gaussian", "mitchell"), ("box", "mitchell")),
    "shadows": ("what shadow rays ask: whether anything is in the way, or what is nearest; must be exact", ("any", "closest"), ("any", "closest")),
    "lod": ("share of the triangles that `decimate` leaves", (0.5, 0.25, 0.1, 0.05, 0.02), (0.5, 0.1)),
    "secondary_lod": ("the same for all rays but those of the camera; also started as far away as the surfaces are apart", (0.5, 0.25, 0.1, 0.05, 0.02), (0.5, 0.1)),
}  # fmt: skip
PATTERNS = ("uniform", "jittered", "low-discrepancy")
STRUCTURES = {
    "numerics": "arithmetic of bvh_sah, bvh_wide and kdtree_sah; Embree fast, robust, compact",
    "tests": "published ray-triangle and ray-box tests in bvh_sah, where this raybench has them; named alone, also with FMA",
    "precision": "bvh_wide: full, 16-bit and 8-bit boxes x width, indexed leaves: must be exact; vertices of 16 and 8 bits: scored",
    "parameters": "sizes of leaves, bins, depth, density, splits; must be exact",
}
GROUPS = {"tracer": ("depth", "contribution", "samples", "adaptive", "filter", "shadows")}
DEFAULT = ("numerics", "tests", "precision", "tracer")


@dataclass
class Point:
    """One setting of a knob.

    spec     the structure, of structures
    options  of `raybench render`, of pictures
    scene    of pictures: parameters of `decimate`, through which all rays see the scene; None: as it is
    secondary  the same for all rays but those of the camera
    moved    whether these start as far from a surface as the scene and that level of detail are apart
    """

    knob: str
    label: str
    must_be_exact: bool = False
    spec: str | None = None
    options: tuple = ()
    scene: str | None = None
    secondary: str | None = None
    moved: bool = False


@dataclass
class Chosen:
    """The points of all knobs asked for, and lines that say what was left out, and why."""

    points: list = field(default_factory=list)
    left_out: list = field(default_factory=list)

    @property
    def structures(self):
        return [p for p in self.points if p.spec]

    @property
    def pictures(self):
        return [p for p in self.points if not p.spec]


class Structures:
    """What `raybench list structures` knows, asked for when needed."""

    def __init__(self, program):
        self._list, self._known = program.list, {}
        listed = program.list("structures")
        self._absent = {s["name"]: s["unavailable"] for s in listed if s.get("unavailable")}
        self.names = [s["name"] for s in listed if s["name"] not in self._absent]

    def parameters(self, name):
        """{name: parameter} of a structure."""
        if name in self._absent:
            raise RunError(f"structure '{name}' is not here: {self._absent[name]}")
        if name not in self.names:
            raise RunError(f"unknown structure '{name}'{meant(name, self.names)}; allowed: {', '.join(self.names)}")
        if name not in self._known:
            self._known[name] = {p["name"]: p for p in self._list("structure", name)["parameters"]}
        return self._known[name]

    def full(self, spec):
        """(name, {parameter: value as text}) with all defaults, numbers as floats: what equal settings have in common."""
        name, values = split(spec)
        own = self.parameters(name)
        for key in values:
            if key not in own:
                raise RunError(f"{name} has no parameter '{key}'{meant(key, own)}; it has: {', '.join(own) or 'none'}")
        found = {key: normal(values.get(key, p["default"])) for key, p in own.items()}
        return name, tuple(sorted(found.items()))


def choose(text, structures, scene_facts, quick):
    """The points of a list of knobs such as "numerics,depth,bvh_sah.leaf_size=1|4". Throws RunError."""
    chosen, asked = Chosen(), [w for w in _words(text) if w]
    if not asked:
        raise RunError("--knobs: empty; raybench tradeoff --list shows the knobs")
    names = [n for word in asked for n in GROUPS.get(word, (word,))]
    for name in dict.fromkeys(names):
        knob, _, values = name.partition("=")
        values = tuple(v for v in values.split("|") if v) if "=" in name else None
        if knob in STRUCTURES:
            if values is not None:
                raise RunError(f"--knobs {name}: {knob} takes no values")
            if knob == "tests" and not scene_facts["triangles"]:
                chosen.left_out.append("tests: left out: the scene has no triangles")
                continue
            _add_structures(chosen, knob, structures, scene_facts, quick, knob in _words(text))
        elif knob in PICTURES:
            _add_pictures(chosen, knob, values, scene_facts, quick)
        elif "." in knob:
            chosen.points += _parameter(knob, values, structures, quick)
        else:
            known = [*GROUPS, *STRUCTURES, *PICTURES]
            raise RunError(
                f"--knobs: unknown knob '{knob}'{meant(knob, known)}; allowed: {', '.join(known)}, or "
                "STRUCTURE.PARAMETER, such as bvh_sah.leaf_size=1|4|16"
            )
    return chosen


def _add_structures(chosen, knob, structures, facts, quick, by_name):
    if knob == "numerics":
        for name in ARITHMETIC:
            choices = _choices(structures, name, "numerics")
            chosen.points += [Point(knob, s, spec=s) for s in (f"{name}(numerics={c})" for c in choices)]
        if "embree" in structures.names:
            chosen.points += [Point(knob, spec, spec=spec) for spec in LIBRARY[: 2 if quick else None]]
    elif knob == "tests":
        _add_tests(chosen, structures, quick, by_name)
    elif knob == "precision":
        _add_precision(chosen, structures, facts, quick)
    else:
        for spec, parameter, values in PARAMETERS:
            if split(spec)[0] in structures.names:
                chosen.points += _parameter(f"{spec}.{parameter}", None, structures, quick)


def _add_precision(chosen, structures, facts, quick):
    """Every form of boxes and, beside the smallest of them, every form of leaves."""
    widths = _choices(structures, "bvh_wide", "width")
    leaves = [form for form in _choices(structures, "bvh_wide", "leaves") if form != "copied"]
    if facts.get("procedural") and leaves:
        chosen.left_out.append("precision: left out: vertices of 16 and 8 bits, which are of triangles alone")
        leaves = [form for form in leaves if form == "indexed"]
    for width in widths[1:2] if quick else widths:
        for nodes in _choices(structures, "bvh_wide", "nodes"):
            spec = f"bvh_wide(width={width},nodes={nodes})"
            chosen.points.append(Point("precision", spec, True, spec))
        for form in leaves:
            spec = f"bvh_wide(leaves={form},nodes=quantized8,width={width})"  # where names are cut, the form is seen
            chosen.points.append(Point("precision", spec, form == "indexed", spec))


def _add_tests(chosen, structures, quick, by_name):
    """Every ray-triangle test, with FMA too where the knob was named; every ray-box test under woop_double."""
    own = structures.parameters("bvh_sah") if "bvh_sah" in structures.names else {}
    if "triangle" not in own:
        if by_name:
            chosen.left_out.append("tests: left out: bvh_sah of this raybench has no parameter `triangle`")
        return
    fma = ("", ",fma=true") if by_name and not quick and "fma" in own else ("",)
    for test in own["triangle"]["choices"]:
        if test == "as_numerics":  # not called triangle by triangle, as these are
            continue
        for more in fma if test != "exact" else ("",):
            spec = f"bvh_sah(triangle={test}{more})"
            chosen.points.append(Point("tests", spec, spec=spec))
    for slab in own["slab"]["choices"] if "slab" in own else ():
        if slab != "as_numerics":
            spec = f"bvh_sah(triangle=woop_double,slab={slab})"
            chosen.points.append(Point("tests", spec, spec=spec))


def _add_pictures(chosen, knob, values, facts, quick):
    what, all_values, few = PICTURES[knob]
    values = _checked(knob, values) if values is not None else few if quick else all_values
    if knob in ("depth", "contribution"):
        needs = facts["needs"]
        if not (needs["reflection_rays"]["needed"] or needs["refraction_rays"]["needed"]):
            chosen.left_out.append(f"{knob}: left out: {needs['reflection_rays']['why']}, so no picture depends on it")
            return
    if knob in LEVELS and facts.get("procedural"):
        chosen.left_out.append(f"{knob}: left out: decimate takes triangles alone")
        return
    if knob == "shadows" and (why := _why_shadows_are_one_kind(facts["needs"])):
        chosen.left_out.append(f"shadows: left out: {why}")
        return
    for value in values:
        if knob == "depth":
            chosen.points.append(Point(knob, f"depth {value}", options=("--depth", value)))
        elif knob == "contribution":
            chosen.points.append(Point(knob, f"cut-off {value:g}", options=("--min-contribution", value)))
        elif knob == "samples" and int(value) == 1:
            chosen.points.append(Point(knob, "1 center", options=("--samples", 1)))
        elif knob == "samples":
            for pattern in PATTERNS:
                options = ("--samples", value, "--pattern", pattern)
                chosen.points.append(Point(knob, f"{int(value) ** 2} {pattern}", options=options))
        elif knob == "adaptive":
            options = ("--samples", 4, "--pattern", "low-discrepancy", "--adaptive", value)
            chosen.points.append(Point(knob, f"16 adaptive {value:g}", options=options))
        elif knob == "filter":
            options = ("--samples", 4, "--pattern", "low-discrepancy", "--filter", value)
            chosen.points.append(Point(knob, f"16 {value}", options=options))
        elif knob == "shadows":
            chosen.points.append(Point(knob, f"{value} hit", True, options=("--shadows", value)))
        elif knob == "lod":
            chosen.points.append(Point(knob, f"keep {value:g}", scene=f"keep={value:g}"))
        else:
            for moved in (False, True):
                label = f"secondary {value:g}{', moved' if moved else ''}"
                chosen.points.append(Point(knob, label, secondary=f"keep={value:g}", moved=moved))


def _why_shadows_are_one_kind(needs):
    """Why all shadow rays ask the same whatever the knob says; None where they do not."""
    if not needs["shadow_rays"]["needed"]:
        return f"{needs['shadow_rays']['why']}, so there are no shadow rays"
    if needs["transmittance"]["needed"]:
        return f"{needs['transmittance']['why']}, so shadow rays follow all that they pass"
    return None


LEVELS = ("lod", "secondary_lod")
RANGES = {"depth": (int, 0, 63), "contribution": (float, 0, 1), "samples": (int, 1, 64), "adaptive": (float, 0, 1)} | dict.fromkeys(LEVELS, (float, 0, 1))  # fmt: skip


def _checked(knob, texts):
    if knob in ("filter", "shadows"):
        if bad := [t for t in texts if t not in PICTURES[knob][1]]:
            raise RunError(f"--knobs {knob}={bad[0]}: allowed: {', '.join(PICTURES[knob][1])}")
        return texts
    kind, lo, hi = RANGES[knob]
    found = []
    for text in texts:
        try:
            value = kind(text)
        except ValueError:
            value = -1
        if not lo <= value <= hi:
            raise RunError(
                f"--knobs {knob}={text}: allowed: {'whole ' if kind is int else ''}numbers from {lo} to {hi}"
            )
        found.append(value)
    if not found:
        raise RunError(f"--knobs {knob}=: no value given")
    return tuple(found)


def _parameter(knob, values, structures, quick):
    """The points of STRUCTURE.PARAMETER or STRUCTURE(X=1).PARAMETER."""
    base, _, parameter = knob.rpartition(".")
    name, given = split(base)
    own = structures.parameters(name)
    structures.full(base)
    if parameter not in own:
        raise RunError(
            f"--knobs {knob}: {name} has no parameter '{parameter}'{meant(parameter, own)}; it has: {', '.join(own) or 'none'}"
        )
    description = own[parameter]
    if values is None:
        values = VALUES.get((base, parameter)) or _ladder(knob, description)
        values = values[:: 2 if quick and len(values) > 3 else 1]
    points = []
    for value in values:
        _check_value(knob, description, value)
        spec = f"{name}({','.join(f'{k}={v}' for k, v in [*given.items(), (parameter, value)])})"
        points.append(Point(knob, spec, not description["approximate"], spec))
    return points


def _ladder(knob, p):
    """Values of a parameter that nobody named: all choices, or multiples of the default by powers of two."""
    if p["type"] == "choice":
        return p["choices"]
    if p["type"] == "bool":
        return ("false", "true")
    if not p["default"]:
        raise RunError(f"--knobs {knob}: say which values, such as {knob}={p['lo']:g}|{min(p['hi'], p['lo'] + 2):g}")
    kind = int if p["type"] == "integer" else float
    ladder = [kind(p["default"] * factor) for factor in (0.125, 0.25, 0.5, 1, 2, 4, 8)]
    return tuple(f"{v:g}" for v in dict.fromkeys(ladder) if p["lo"] <= v <= p["hi"])


def _check_value(knob, p, value):
    allowed = p.get("choices") if p["type"] == "choice" else ("false", "true") if p["type"] == "bool" else None
    if allowed:
        good, text = str(value) in allowed, ", ".join(allowed)
    else:
        try:
            number = int(value) if p["type"] == "integer" else float(value)
            good = p["lo"] <= number <= p["hi"]
        except ValueError:
            good = False
        text = f"{'a whole' if p['type'] == 'integer' else 'a'} number from {p['lo']:g} to {p['hi']:g}"
    if not good:
        raise RunError(f"--knobs {knob}={value}: allowed: {text}")


def split(spec):
    """("bvh_sah", {"bins": "4"}) of "bvh_sah(bins=4)". Throws RunError."""
    found = re.fullmatch(r"(\w+)(?:\(([^()]*)\))?", spec.strip())
    if not found:
        raise RunError(f"'{spec}': not a structure; write NAME or NAME(KEY=VALUE,...)")
    pairs = [pair.partition("=") for pair in (found[2] or "").split(",") if pair]
    return found[1], {key.strip(): value.strip() for key, _, value in pairs}


def _words(text):
    """Split at commas outside of parentheses."""
    return [w.strip() for w in re.split(r",(?![^()]*\))", text)]


def normal(value):
    """A parameter's value such that equal ones are equal: numbers as floats, truth as text."""
    if isinstance(value, bool):
        return str(value).lower()
    try:
        return float(value)
    except ValueError:
        return str(value)


def _choices(structures, name, parameter):
    own = structures.parameters(name) if name in structures.names else {}
    return own[parameter]["choices"] if parameter in own else ()


def meant(word, known):
    near = difflib.get_close_matches(word, list(known), 1)
    return f" (did you mean '{near[0]}'?)" if near else ""


def text_of_all():
    """For --list."""
    rows = [("tracer", ", ".join(GROUPS["tracer"])), *STRUCTURES.items()]
    rows += [(name, f"{what}: {', '.join(map(str, values))}") for name, (what, values, _) in PICTURES.items()]
    rows.append(
        ("STRUCTURE.PARAMETER[=V|W|...]", "any parameter: scored where it may change answers, else it must be exact")
    )
    width = max(len(name) for name, _ in rows)
    lines = [f"{name.ljust(width)}  {what}" for name, what in rows]
    return "\n".join([*lines, f"Default: {','.join(DEFAULT)} (tests where there are some)"]) + "\n"
