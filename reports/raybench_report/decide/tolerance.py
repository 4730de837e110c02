"""How much slower is allowed: 2 % unless a TOML file says otherwise."""

import fnmatch
import tomllib
from dataclasses import dataclass, field
from pathlib import Path

from .. import results

DEFAULT = 0.02
LARGEST = 10.0
_KEYS = ("scene", "structure", "ray_set", "query", "threads")


@dataclass(frozen=True)
class Tolerances:
    """Rules in the order of the file; the last one that fits a comparison counts.

    default = 0.02          # 2 % slower is allowed
    [[rule]]
    query = "build"         # shell patterns over scene, structure (its spec), ray_set, query; threads is a number
    tolerance = 0.05
    """

    default: float = DEFAULT
    rules: list = field(default_factory=list)

    def of(self, comparison):
        """Of one comparison, as a share: 0.02 is 2 %."""
        values = {
            "scene": comparison.scene,
            "structure": comparison.spec,
            "ray_set": comparison.ray_set,
            "query": comparison.query,
        }
        tolerance = self.default
        for patterns, value in self.rules:
            fits = all(
                comparison.threads == pattern if key == "threads" else fnmatch.fnmatchcase(values[key], pattern)
                for key, pattern in patterns.items()
            )
            tolerance = value if fits else tolerance
        return tolerance


def read(path):
    """Throws RunError naming file and key."""
    try:
        data = tomllib.loads(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        raise results.RunError(f"{path}: {error.strerror}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise results.RunError(f"{path}: not TOML: {error}") from None
    for key in data:
        if key not in ("default", "rule"):
            raise results.RunError(f"{path}: unknown key '{key}'; allowed: default, [[rule]]")
    rules = data.get("rule", [])
    if not isinstance(rules, list):
        raise results.RunError(f"{path}: rule: write [[rule]]")
    read_rules = []
    for number, rule in enumerate(rules, start=1):
        where = f"{path}: rule {number}"
        for key, value in rule.items():
            if key not in (*_KEYS, "tolerance"):
                raise results.RunError(f"{where}: unknown key '{key}'; allowed: {', '.join(_KEYS)}, tolerance")
            if key in _KEYS and not isinstance(value, int if key == "threads" else str):
                raise results.RunError(f"{where}: {key} must be {'a number' if key == 'threads' else 'text'}")
        if "tolerance" not in rule:
            raise results.RunError(f"{where}: lacks tolerance")
        patterns = {key: value for key, value in rule.items() if key != "tolerance"}
        read_rules.append((patterns, _share(rule["tolerance"], f"{where}: tolerance")))
    return Tolerances(_share(data.get("default", DEFAULT), f"{path}: default"), read_rules)


def _share(value, where):
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0 <= value <= LARGEST:
        raise results.RunError(f"{where}: must be a share between 0 and {LARGEST:g}, such as 0.02 for 2 %")
    return float(value)
