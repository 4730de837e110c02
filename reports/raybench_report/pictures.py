"""Pictures for the page: renders, heat maps of one scale as grey values, boxes of trees."""

import base64
import io
import json

import numpy as np
from PIL import Image

from . import heat
from .results import RunError

COLOURS = 64  # of the ramp
LOSSY_ABOVE = 40_000  # bytes of a render's PNG from which WebP is used instead


def gather(runs):
    """{"scenes": [...]}: for each scene of each run its picture, its heat maps and its trees' boxes, where there are some."""
    scenes = []
    for run in runs:
        for path in sorted((run.directory / "images").glob("*.png")):
            entry = {"run": run.shown, "label": _label(run, path.stem), "stem": path.stem, "picture": _render(path)}
            entry["heat"] = _heat(run.directory / "heat" / path.stem)
            entry["trees"] = _boxes(run.directory / "boxes" / f"{path.stem}.json")
            scenes.append(entry)
    return {"scenes": scenes, "ramp": ramp()}


def _label(run, stem):
    for scene in run.info.get("scenes", []):
        if scene.get("image") == f"images/{stem}.png":
            here = run.cases[run.cases["scene"] == scene["scene"]]
            return here["label"].iloc[0] if len(here) else scene["scene"]
    return stem


def _render(path):
    data, kind = path.read_bytes(), "png"
    if len(data) > LOSSY_ABOVE:
        out = io.BytesIO()
        Image.open(path).convert("RGB").save(out, "WEBP", quality=88, method=4)
        data, kind = out.getvalue(), "webp"
    with Image.open(path) as image:
        width, height = image.size
    return {"src": _url(data, kind), "width": width, "height": height}


def _heat(folder):
    """Maps of both kinds: each a grey picture, 0 to 255 from 0 to `top`, linear or by log(1 + count), in as many steps as
    the ramp has colours. Lossless WebP is a third smaller than PNG, and these maps are most of a large page."""
    try:
        read = heat.read(folder)
    except RunError:
        return None
    kinds = {}
    for kind in heat.KINDS:
        maps = {spec: m[kind] for spec, m in read.counted.items()}
        top, log, clipped = heat.scale_of(list(maps.values()))
        entries = []
        for spec, counts in maps.items():
            share = np.log1p(counts) / np.log1p(top) if log else counts / top
            grey = np.round(np.round((COLOURS - 1) * np.clip(share, 0, 1)) * (255 / (COLOURS - 1))).astype(np.uint8)
            out = io.BytesIO()
            Image.fromarray(grey).convert("RGB").save(out, "WEBP", lossless=True, method=2, quality=30)
            entries.append(
                {
                    "spec": spec,
                    "src": _url(out.getvalue(), "webp"),
                    "mean": float(counts.mean()),
                    "most": int(counts.max()),
                }
            )
        kinds[kind] = {"top": float(top), "log": log, "clipped": clipped, "maps": entries}
    height, width = next(iter(read.counted.values()))["steps"].shape
    silent = {spec: why for spec, why in read.maps.items() if isinstance(why, str)}
    return {"width": width, "height": height, "kinds": kinds, "silent": silent}


def _boxes(path):
    """Boxes of trees as the run left them (reports/README.md)."""
    try:
        return json.loads(path.read_text(encoding="utf-8"))["trees"]
    except FileNotFoundError:
        return None
    except (ValueError, KeyError, TypeError) as error:
        raise RunError(f"{path}: not a file of boxes: {type(error).__name__}: {error}") from None


def _url(data, kind):
    return f"data:image/{kind};base64,{base64.b64encode(data).decode()}"


def ramp(steps=COLOURS):
    """Colours from dark to bright for counts: lightness grows evenly in Oklab (Ottosson 2020), hue from blue to yellow."""
    colours = []
    for x in np.linspace(0, 1, steps):
        lightness, chroma = 0.17 + 0.78 * x, 0.05 + 0.14 * np.sin(np.pi * min(1.0, 0.15 + x)) ** 0.8
        hue = np.radians(285 + 185 * x)  # blue, magenta, orange, yellow
        a, b = chroma * np.cos(hue), chroma * np.sin(hue)
        l, m, s = (
            (lightness + p * a + q * b) ** 3
            for p, q in ((0.3963377774, 0.2158037573), (-0.1055613458, -0.0638541728), (-0.0894841775, -1.2914855480))
        )
        linear = (
            4.0767416621 * l - 3.3077115913 * m + 0.2309699292 * s,
            -1.2684380046 * l + 2.6097574011 * m - 0.3413193965 * s,
            -0.0041960863 * l - 0.7034186147 * m + 1.7076147010 * s,
        )
        srgb = [12.92 * c if c <= 0.0031308 else 1.055 * max(c, 0) ** (1 / 2.4) - 0.055 for c in linear]
        colours.append([int(round(255 * min(1, max(0, c)))) for c in srgb])
    return colours
