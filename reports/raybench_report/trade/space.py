"""What `raybench tune` may change: a structure's parameters, as `raybench list structure NAME --json` describes them."""

import json
import math
import re
import subprocess
from dataclasses import dataclass

from ..errors import RunError

# A range that reaches more than so many times the default is searched on a logarithmic scale, whatever its flag says:
# most of a linear one would lie where nobody has been.
WIDE = 16


@dataclass(frozen=True)
class Spec:
    """`name(key=value,...)`; values are text."""

    name: str
    values: tuple  # of (key, text), as typed

    @classmethod
    def parse(cls, text):
        match = re.fullmatch(r"\s*([\w.-]+)\s*(?:\((.*)\))?\s*", text, re.DOTALL)
        if match is None:
            raise RunError(f"'{text}' is no structure; allowed: NAME or NAME(key=value,...)")
        items = [item for item in (match[2] or "").split(",") if item.strip()]
        return cls(match[1], tuple(tuple(part.strip() for part in item.split("=", 1)) for item in items))

    def with_values(self, values):
        """The spec as text, with these parameters too."""
        items = [*self.values, *((name, as_text(value)) for name, value in values.items())]
        return self.name + (f"({','.join(f'{k}={v}' for k, v in items)})" if items else "")


def as_text(value):
    return str(value).lower() if isinstance(value, bool) else str(value)


def describe(program, name, plugins=()):
    """The parameters of a structure, as raybench describes them."""
    words = [program, *(f"--plugin={p}" for p in plugins), "list", "structure", name, "--json"]
    done = subprocess.run(words, capture_output=True, text=True)
    if done.returncode != 0:
        raise RunError(done.stderr.strip().removeprefix("raybench: "))
    return json.loads(done.stdout)["parameters"]


def tunable(parameters, spec):
    """Those that may change: neither given in the spec, nor able to change answers."""
    given = {key for key, _ in spec.values}
    return [p for p in parameters if not p["approximate"] and p["name"] not in given]


def suggest(trial, parameter):
    """A value for an Optuna trial.

    Where 0 is the default and the lower end, it stands for "none" or "by a rule" and is no small number: whether to
    leave it so is asked first, and only then for a number from 1 (or from a thousandth of the upper end).
    """
    name, kind = parameter["name"], parameter["type"]
    if kind == "choice":
        return trial.suggest_categorical(name, parameter["choices"])
    if kind == "bool":
        return trial.suggest_categorical(name, [False, True])
    lo, hi, default = parameter["lo"], parameter["hi"], parameter["default"]
    if lo == default == 0:
        if trial.suggest_categorical(f"{name}: default", [True, False]):
            return default
        lo = 1 if kind == "integer" else hi / 1000
    log = hi > WIDE * max(default, lo) or parameter["logarithmic"]
    if log and lo <= 0:
        lo = 1 if kind == "integer" else min(default, hi) / WIDE
    if kind == "integer":
        return trial.suggest_int(name, math.ceil(lo), int(hi), log=log)
    return float(f"{trial.suggest_float(name, lo, hi, log=log):.3g}")


def defaults(parameters):
    """The trial that leaves everything as it is, for Study.enqueue_trial()."""
    fixed = {}
    for p in parameters:
        if p["type"] not in ("choice", "bool") and p["lo"] == p["default"] == 0:
            fixed[f"{p['name']}: default"] = True
        else:
            fixed[p["name"]] = p["default"]
    return fixed


def changed(parameters, values):
    """The values that differ from the defaults."""
    of = {p["name"]: p["default"] for p in parameters}
    return {name: value for name, value in values.items() if value != of[name]}
