"""What `raybench tune` and `raybench advise` write: tables, and files whole or not at all."""

import json
import math
import os
import tempfile

from ..errors import RunError
from . import space


def table(rows):
    """Lines of aligned columns, the first to the left."""
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    return [
        "  ".join(cell.ljust(w) if i == 0 else cell.rjust(w) for i, (cell, w) in enumerate(zip(row, widths))).rstrip()
        for row in rows
    ]


def toml(spec, comments):
    """A file for `raybench run --params`: the table of one structure."""
    parsed = space.Spec.parse(spec)
    lines = [f"# {comment}" for comment in comments] + [f"[{parsed.name}]"]
    for key, value in parsed.values:
        plain = value in ("true", "false") or _is_number(value)
        lines.append(f"{key} = {value if plain else json.dumps(value)}")
    return "\n".join(lines) + "\n"


def _is_number(text):
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False


def require_folder(path):
    """Before anything is measured: throws RunError where the folder --out can be neither used nor made."""
    there = path
    while there is not None and not there.exists() and there != there.parent:
        there = there.parent
    if path is not None and not (there.is_dir() and os.access(there, os.W_OK | os.X_OK)):
        raise RunError(f"--out {path}: {there} is no folder that can be written to")


def write_file(path, content):
    """Whole or not at all."""
    with tempfile.NamedTemporaryFile("w", dir=path.parent, delete=False) as file:
        file.write(content)
    os.replace(file.name, path)
