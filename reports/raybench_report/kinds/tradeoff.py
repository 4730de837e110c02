"""Folders of `raybench tradeoff`."""

import base64
import io
from dataclasses import dataclass
from pathlib import Path

import pandas as pd
from PIL import Image

from ..charts import fronts as charts
from ..results import RunError, read_info, read_table, short_names
from ..trade import fronts
from . import BAD, GOOD, Kind, Section, Table

PICTURES = 8  # shown a knob


@dataclass
class Tradeoff:
    """What `raybench tradeoff --out DIR` wrote. `found`: the fronts, worked out anew."""

    directory: Path
    rows: pd.DataFrame
    info: dict
    found: list
    shown: str = ""


def read(directory):
    """Reads DIR/tradeoff.csv and tradeoff.json. Throws RunError."""
    info = read_info(directory / "tradeoff.json")
    rows = read_table(directory / "tradeoff.csv")
    if rows.empty:
        raise RunError(f"{directory / 'tradeoff.csv'}: no rows, so there is nothing to show")
    return Tradeoff(directory, rows, info, fronts.fronts(rows))


def sections(report, folders):
    """A section for each folder: sentences, fronts, pictures with their differences, all points."""
    return [_section(folder, at, len(folders) > 1) for at, folder in enumerate(folders)]


def _section(folder, at, several):
    rows = folder.rows
    bad = rows[rows["status"].isin(["refused", "disagrees"])]
    says = [str(text) for text in folder.info.get("says") or []]
    says += [f"Left out or changed: {note}" for note in folder.info.get("notes") or []]
    tables = []
    if len(bad):
        heads = ["scene", "point", "rays", "what", "why", "see it by"]
        listed = [[r.scene, r.point, r.ray_set, r.status, r.note, r.error_command] for r in bad.itertuples()]
        tables.append(Table(f"tradeoff_bad_{at}", "On no front", heads, listed))
    tables += _tables(folder, at)
    name = f"tradeoff_{at}" if at else "tradeoff"
    title = "What accuracy costs" + (f" ({folder.shown})" if several else "")
    return Section(
        name,
        title,
        "Trade-off",
        says,
        charts.charts(folder, at),
        tables,
        _pictures(folder),
        answer=_answer(folder, bad),
    )


def _answer(folder, bad):
    points = folder.rows.drop_duplicates(["scene", "knob", "point"])
    text = f"{len(points):,} points on {len(folder.found):,} fronts. "
    if len(bad):
        what = bad.drop_duplicates(["scene", "point"])
        return BAD, text + f"{len(what):,} broke a claim or disagree where answers must be exact, and stand on none: " + ", ".join(
            f"`{p}`" for p in what["point"].head(3)
        ) + "."  # fmt: skip
    return GOOD, text + "Every claim was kept, and what must be exact agrees."


def _tables(folder, at):
    """Every front as a table, the best first, with the command of each point."""
    found = []
    label = short_names(folder.rows["scene"].unique())
    for number, front in enumerate(folder.found):
        heads = ["place", "point", front.y.title, front.x.title, "dominated by", "again by"]
        rows = front.rows.sort_values(front.y.column, ascending=front.y.better == "low")
        listed = [
            [r["place"], r["point"], r[front.y.column] * front.y.factor,
             fronts.share(r[front.x.column]) if front.x.percent else r[front.x.column] * front.x.factor,
             r["dominated_by"], r["command"]]
            for _, r in rows.iterrows()
        ]  # fmt: skip
        title = f"{front.title}: {label[front.scene]}" + (f", {front.ray_set} rays" if front.ray_set else "")
        found.append(Table(f"front_{at}_{number}", title, heads, listed))
    return found


def _pictures(folder):
    """[(heading, [(data URL, caption)])]: of each knob the worst picture, the best, and some between, each with its
    difference."""
    found = []
    shown = folder.rows[(folder.rows["picture"] != "") & (folder.rows["status"] == "measured")]
    label = short_names(folder.rows["scene"].unique())
    for (scene, knob), here in shown.groupby(["scene", "knob"], sort=False):
        here = here.sort_values("rmse", ascending=False)
        step = max(1, -(-len(here) // (PICTURES // 2)))
        row = []
        for r in here.iloc[::step].itertuples():
            error = f"FLIP {r.flip_mean:.3f}" if r.flip_mean == r.flip_mean else f"RMSE {r.rmse:.2g}"
            row.append((_source(folder.directory / r.picture), f"{r.point}: {error}, {r.seconds:.3g} s"))
            row.append((_source(folder.directory / r.difference), f"difference ({r.differing:,.0f} pixels)"))
        found.append((f"{label[scene]}: {knob}", row))
    return found


def _source(path):
    """The picture as a data URL. Throws RunError."""
    try:
        out = io.BytesIO()
        Image.open(path).convert("RGB").save(out, "WEBP", quality=85, method=4)
    except OSError as error:
        raise RunError(f"{path}: cannot be read as a picture: {error}") from None
    return "data:image/webp;base64," + base64.b64encode(out.getvalue()).decode()


KIND = Kind("tradeoff", "tradeoff.csv", "raybench tradeoff", read, sections)
