"""How much a picture differs from its reference."""

import numpy as np
from PIL import Image
from scipy import ndimage

from ..pictures import ramp
from ..results import RunError

try:
    import flip_evaluator  # by FLIP's authors; there are wheels for x86-64 alone
except ImportError:
    flip_evaluator = None

SHOWN_UP_TO = 0.25  # of the range as shown: the brightest colour of a difference


def read(path):
    """A picture of `raybench render`, .exr: height x width x 3, linear. Throws RunError."""
    try:
        import OpenEXR
    except ImportError:
        raise RunError("pictures need the module OpenEXR of reports/requirements.txt") from None
    try:
        with OpenEXR.File(str(path)) as file:
            channels = file.channels()
            name = next((n for n in ("RGB", "RGBA") if n in channels), None)
            pixels = channels[name].pixels[..., :3] if name else np.stack([channels[c].pixels for c in "RGB"], -1)
    except (KeyError, RuntimeError, OSError, ValueError) as error:
        raise RunError(f"{path}: not a picture of raybench: {error}") from None
    return np.asarray(pixels, dtype=np.float32)


def shown(picture):
    """As a screen shows it: sRGB, clamped to [0, 1]."""
    x = np.clip(picture.astype(float), 0, 1)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)


def measures(picture, reference):
    """{column of tradeoff.csv: value}; None where there is none."""
    x, r = picture.astype(float), reference.astype(float)
    off = np.abs(x - r)
    seen, seen_reference = shown(picture), shown(reference)
    squared = float(np.mean((seen - seen_reference) ** 2))
    found = {
        "pixels": off.shape[0] * off.shape[1],
        "differing": int((picture != reference).any(axis=-1).sum()),
        "rmse": float(np.sqrt(np.mean(off**2))),
        "relmse": float(np.mean(off**2 / (r**2 + 0.01))),
        "max_error": float(off.max()),
        "visible": float((off > 1 / 255).any(axis=-1).mean()),
        "psnr": -10 * float(np.log10(squared)) if squared else None,
        "ssim": ssim(luminance(seen), luminance(seen_reference)),
    }
    flip = flip_map(seen, seen_reference)
    return found | {
        "flip_mean": None if flip is None else float(flip.mean()),
        "flip_p99": None if flip is None else float(np.percentile(flip, 99)),
    }


def luminance(picture):
    """Rec. 709's weights."""
    return picture @ np.array([0.2126, 0.7152, 0.0722])


def ssim(a, b, top=1.0):
    """Mean structural similarity of two grey pictures in [0, top] (Wang, Bovik, Sheikh, Simoncelli 2004): windows are
    Gaussians of 1.5 pixels, 11 across; the border of 5 pixels does not count."""
    blur = lambda x: ndimage.gaussian_filter(x, 1.5, truncate=3.5)
    c1, c2 = (0.01 * top) ** 2, (0.03 * top) ** 2
    mean_a, mean_b = blur(a), blur(b)
    var_a, var_b, both = blur(a * a) - mean_a**2, blur(b * b) - mean_b**2, blur(a * b) - mean_a * mean_b
    value = (2 * mean_a * mean_b + c1) * (2 * both + c2) / ((mean_a**2 + mean_b**2 + c1) * (var_a + var_b + c2))
    border = 5 if min(a.shape) > 10 else 0
    return float(value[border : a.shape[0] - border, border : a.shape[1] - border].mean())


def flip_map(seen, reference):
    """FLIP's error of each pixel, at 67 pixels a degree; None without its package."""
    if flip_evaluator is None:
        return None
    as_float = lambda x: np.ascontiguousarray(x, dtype=np.float32)
    return flip_evaluator.evaluate(as_float(reference), as_float(seen), "LDR", applyMagma=False)[0][..., 0]


def save(picture, path):
    """As shown, 8 bits."""
    Image.fromarray(np.round(255 * shown(picture)).astype(np.uint8)).save(path)


def save_difference(picture, reference, path):
    """The largest difference of the three colours as shown: black where there is none, yellow from SHOWN_UP_TO on."""
    off = np.abs(shown(picture) - shown(reference)).max(axis=-1) / SHOWN_UP_TO
    colours = np.array([[0, 0, 0], *ramp(63)], dtype=np.uint8)
    at = np.where(off > 0, 1 + np.round(62 * np.clip(off, 0, 1)), 0).astype(int)
    Image.fromarray(colours[at]).save(path)
