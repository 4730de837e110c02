"""Heat maps: what traversal costs per pixel, structure by structure, and the scale that they share.

A folder of heat maps, as `raybench render --heat` and `raybench run` write it, holds heat.json and a .npy file a map:
{"scene": NAME, "picture": FILE, "maps": [{"spec": S, "steps": FILE, "prims": FILE} or {"spec": S, "why_not": TEXT}]}
with files relative to the folder. A map is a matrix of counts, row 0 at the top.
"""

import json
import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image

from .results import RunError

KINDS = {
    "steps": ("traversal steps\nper ray", "Traversal steps: nodes or cells a ray traverses, leaves included.", "steps"),
    "prims": ("primitive tests\nper ray", "Primitive tests: ray–primitive tests, repeats included.", "tests"),
}
CLIP = 99.9  # percentile of all counts at which the colours end, so that a few rays do not darken all others
APART = 5  # log colours where most structures stay below 1/APART of the range


class NothingCounted(RunError):
    """None of the structures can count."""


@dataclass(frozen=True)
class Heat:
    """The heat maps of one scene. `maps` has for each spec {"steps": matrix, "prims": matrix} or a text: why not."""

    scene: str
    picture: np.ndarray
    maps: dict

    @property
    def counted(self):
        """The maps of the structures that have some."""
        return {spec: maps for spec, maps in self.maps.items() if not isinstance(maps, str)}


def read(folder):
    """Reads a folder of heat maps. Throws RunError: one line that says what is wrong with it."""
    folder = Path(folder)
    path = folder / "heat.json"
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        picture = np.asarray(Image.open(folder / content["picture"]).convert("RGB"))
        maps = {
            entry["spec"]: entry["why_not"] if "why_not" in entry else {k: _map(folder / entry[k]) for k in KINDS}
            for entry in content["maps"]
        }
        heat = Heat(content["scene"], picture, maps)
    except FileNotFoundError as error:
        raise RunError(f"{error.filename}: missing, so there are no heat maps to draw") from None
    except (ValueError, KeyError, TypeError, OSError) as error:
        raise RunError(f"{path}: no heat maps: {type(error).__name__}: {' '.join(str(error).split())}") from None
    shapes = {m.shape for maps in heat.counted.values() for m in maps.values()}
    if not shapes:
        raise NothingCounted(f"{path}: nothing was counted")
    if len(shapes) > 1:
        raise RunError(f"{path}: maps of different sizes")
    return heat


def _map(path):
    counts = np.load(path, allow_pickle=False)
    if counts.ndim != 2 or counts.dtype.kind != "u" or counts.size == 0:
        raise ValueError(f"{path.name}: not a matrix of counts")
    return counts


def scale_of(maps, scale="auto"):
    """(top, log, clipped) of one colour scale for these maps: from 0 to a high percentile of all counts; whether it is
    logarithmic, by log(1 + count), so that zero has a place; whether some counts lie above."""
    most = max(int(counts.max()) for counts in maps)
    top = max(1.0, float(np.ceil(np.percentile(np.concatenate([counts.ravel() for counts in maps]), CLIP))))
    if most <= 1.05 * top:
        top = float(max(1, most))
    if scale == "auto":
        tops = sorted(float(np.percentile(counts, CLIP)) for counts in maps)
        scale = "log" if top > APART * max(1.0, tops[(len(tops) - 1) // 2]) else "linear"
    return top, scale == "log", most > top


def short(scene):
    """A file's name without its folders."""
    return os.path.basename(scene) if "(" not in scene else scene
