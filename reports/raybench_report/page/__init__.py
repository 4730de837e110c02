"""report.html: one file with everything in it, made of the templates, styles and scripts beside this module."""

import base64
import gzip
import json
import os
import re
from pathlib import Path

import jinja2
import markupsafe
import numpy as np
import pandas as pd
import vl_convert

from .. import answer, tables
from ..charts import vega
from ..results import NULL, write_atomically

HERE = Path(__file__).parent
SCRIPTS = ["data.js", "state.js", "table.js", "charts.js", "pictures.js", "explain.js", "main.js"]
# Hashes that nobody reads on the page, and what is text of its own in the file.
LEFT_OUT = {"case_id", "ray_hash", "params", "oracle", "seed", "cold_ns"}


def write(path, report, sections):
    """Writes the page. Throws OSError."""
    page = render(report, sections)
    write_atomically(path, lambda temporary: temporary.write_text(page, encoding="utf-8"))


def render(report, sections):
    """The page's text."""
    found = answer.best(report)
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(HERE), autoescape=True, trim_blocks=True, lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )  # fmt: skip
    environment.filters |= {"code": _code, "cell": cell}
    return environment.get_template("report.html.j2").render(
        report=report,
        title=_title(report),
        sections=sections,
        answers=answer.sentences(report, found),
        others=[section for section in sections if section.answer],
        doubts=answer.doubts(report),
        matrix=_matrix(found, report),
        queries_count=len(report.queries) if report.runs else 0,
        style=markupsafe.Markup((HERE / "report.css").read_text(encoding="utf-8")),
        script=markupsafe.Markup("".join((HERE / name).read_text(encoding="utf-8") for name in SCRIPTS)),
        library=_packed(library()),
        data=_packed(json.dumps(_data(report, sections), separators=(",", ":"), allow_nan=False).encode()),
        infos=[_facts(folder) for folder in [*report.runs, *report.others] if hasattr(folder, "info")],
        licences=_licences(report),
    )


def _title(report):
    if not report.runs:
        return "raybench: " + ", ".join(folder.shown for folder in report.others)
    scenes = report.scenes
    return "raybench: " + (
        ", ".join(scenes) if len(scenes) <= 4 else f"{', '.join(scenes[:3])} and {len(scenes) - 3} more scenes"
    )


def _code(text):
    """Text with `names` as code."""
    return markupsafe.Markup(re.sub(r"`([^`]*)`", r"<code>\1</code>", str(markupsafe.escape(text))))


def cell(value):
    """A static table's cell: its text."""
    if value is None or (isinstance(value, float) and np.isnan(value)):
        return "–"
    if isinstance(value, bool) or not isinstance(value, int | float | np.number):
        return str(value)
    return f"{int(value):,}" if float(value).is_integer() and abs(value) < 1e15 else f"{value:.4g}"


def library():
    """Vega, Vega-Lite and Vega-Embed as one script, from vl-convert. It takes seconds to put together, so it is kept in
    raybench's cache."""
    base = (
        os.environ.get("RAYBENCH_CACHE")
        or Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "raybench"
    )
    kept = Path(base) / "page" / f"vega-{vl_convert.__version__}.js"
    if kept.is_file():
        return kept.read_bytes()
    text = vl_convert.javascript_bundle().encode()
    try:
        kept.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(kept, lambda temporary: temporary.write_bytes(text))
    except OSError:
        pass  # only slower the next time
    return text


def _packed(data):
    """Compressed, as text; the same bytes each time."""
    return markupsafe.Markup(base64.b64encode(gzip.compress(data, 9, mtime=0)).decode())


def _data(report, sections):
    """All that the scripts read."""
    charts = [chart for section in sections for chart in section.charts]
    data = {
        "charts": [_chart(chart) for chart in charts],
        "themes": {theme: vega.config(theme) for theme in ("light", "dark")},
        "panels": {section.template: section.data for section in sections if section.template},
        "order": [], "raySets": [], "scenes": [], "runs": [],
    }  # fmt: skip
    if report.runs:
        cases = report.cases
        kept = [c for c in cases.columns if c not in LEFT_OUT]
        data |= {
            "cases": packed_columns(cases[kept]),
            "structures": packed_columns(tables.structures(report)),
            "tables": {
                "structures": tables.columns(tables.STRUCTURES, report),
                "rays": tables.columns(tables.RAYS, report),
            },
            "order": report.order, "raySets": report.ray_sets, "scenes": report.scenes,
            "runs": [run.shown for run in report.runs], "null": NULL,
        }  # fmt: skip
    return data


def _chart(chart):
    own = not isinstance(chart.rows, str)
    return {
        "name": chart.name, "title": chart.title, "says": chart.says, "panel": chart.panel, "facet": chart.facet,
        "single": chart.single, "resolve": chart.resolve, "spans": chart.spans, "step": chart.step, "most": chart.most, "height": chart.height, "columns": chart.columns,
        "rows": packed_columns(chart.rows) if own else chart.rows,
    }  # fmt: skip


def packed_columns(table):
    """{column: {"v": values} or {"d": distinct texts, "i": their numbers}}; null where nothing is known, "inf" as text."""
    packed = {}
    for name in table.columns:
        column = table[name]
        if pd.api.types.is_bool_dtype(column):
            packed[name] = {"v": [bool(v) for v in column]}
        elif pd.api.types.is_numeric_dtype(column):
            packed[name] = {"v": [_plain(v) for v in column.tolist()]}
        else:
            codes, distinct = pd.factorize(column.fillna("").astype(str))
            packed[name] = {"d": list(distinct), "i": codes.tolist()}
    return packed


def _plain(value):
    if value is None or value != value:
        return None
    if value in (float("inf"), float("-inf")):
        return 1e300 if value > 0 else -1e300
    return int(value) if float(value).is_integer() and abs(value) < 2**53 else value


def _matrix(found, report):
    """The fastest for each kind of ray on each scene: heads, and rows of (name, cells); scenes across where they are few."""
    if found.empty:
        return None
    runs = found["run"].unique()
    found = found.sort_values("label", key=lambda labels: labels.map(report.scenes.index), kind="stable")
    found = found.assign(place=found["label"] if len(runs) == 1 else found["label"] + " · " + found["run"])
    places, sets = list(found["place"].unique()), [s for s in report.ray_sets if s in set(found["rays_label"])]
    cells = {(row.place, row.rays_label): row for row in found.itertuples()}
    if len(places) > 4:
        rows = [(place, [cells.get((place, s)) for s in sets]) for place in places]
        return {"heads": sets, "rows": rows, "corner": "scene"}
    return {"heads": places, "rows": [(s, [cells.get((p, s)) for p in places]) for s in sets], "corner": "rays"}


def _facts(folder):
    """What a reader asks of machine and settings: [(name, value)], and all of it as JSON."""
    info = folder.info
    machine, build, timing = info.get("machine", {}), info.get("build", {}), info.get("timing", {})
    libraries = {k: v.get("version", "") if isinstance(v, dict) else v for k, v in info.get("libraries", {}).items()}
    if isinstance(info.get("libraries", {}).get("embree"), dict):
        embree = info["libraries"]["embree"]
        libraries["embree"] = (
            f"{embree.get('version', '')} ({embree.get('instruction_set', '')}, {embree.get('tasking', '')})"
        )
    memory = machine.get("memory_bytes")
    if isinstance(timing, dict):
        known = {k.replace("_", " "): v for k, v in timing.items() if k != "engine_remarks" and v not in ([], None)}
        timing = ", ".join(f"{k}: {v}" for k, v in known.items())
    pairs = [
        ("command", " ".join(map(_quoted, info.get("command_line", [])))),
        ("started", info.get("started")), ("took", f"{info['seconds']:.0f} s" if "seconds" in info else None),
        ("raybench", " ".join(str(x) for x in (build.get("version"), build.get("commit")) if x)),
        ("seed", info.get("seed")),
        ("processor", machine.get("cpu")),
        ("cores", f"{machine.get('allowed_cpus')} of {machine.get('logical_cpus')} logical, {machine.get('physical_cores')} physical" if machine.get("logical_cpus") else None),
        ("memory", f"{memory / 2**30:.1f} GiB" if memory else None),
        ("system", ", ".join(str(x) for x in (machine.get("os"), machine.get("kernel")) if x)),
        ("governor", machine.get("governor")),
        ("compiler", " ".join(str(x) for x in (build.get("compiler"), build.get("build_type"), build.get("flags")) if x)),
        ("libraries", ", ".join(f"{k} {v}" for k, v in libraries.items())),
        ("timing", timing),
        ("oracle", "; ".join(f"{s['scene']}: {s['oracle'].get('name')}, {s['oracle'].get('audited', 0)} answers audited"
                             for s in info.get("scenes", []) if isinstance(s.get("oracle"), dict))),
    ]  # fmt: skip
    pairs = [(name, value) for name, value in pairs if value not in (None, "")]
    return {"name": folder.shown, "pairs": pairs, "json": json.dumps(info, indent=2, ensure_ascii=False)}


def _quoted(word):
    return word if re.fullmatch(r"[\w./:=,@%+-]+", word) else "'" + word.replace("'", "'\\''") + "'"


def _licences(report):
    """(scene, primitives, source, licence) of every scene."""
    rows = []
    for folder in report.runs:
        for scene in folder.info.get("scenes", []):
            row = (
                scene.get("scene"),
                (scene.get("triangles") or 0) + (scene.get("procedural") or 0),
                scene.get("source"),
                scene.get("licence"),
            )
            if row not in rows:
                rows.append(row)
    return rows
