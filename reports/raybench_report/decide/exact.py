"""The exact part of a decision: figures that are the same on every run of the same program."""

import datetime
import getpass
import json
from dataclasses import dataclass
from pathlib import Path

from .. import columns, results
from . import samples

FORMAT = 1  # of baseline files


@dataclass(frozen=True)
class Difference:
    """One figure that is not what it was. `old` or `new` is None where the figure, or its whole case, is not there."""

    comparison: samples.Comparison
    figure: str
    old: object
    new: object

    @property
    def change(self):
        """new/old - 1, or None where they are no numbers."""
        if isinstance(self.old, (int, float)) and isinstance(self.new, (int, float)) and self.old:
            return self.new / self.old - 1
        return None


@dataclass(frozen=True)
class Figures:
    """{comparison: {figure: value}}, and the names of all figures that this raybench knows: a figure that another
    version had not yet, or has no more, is not compared."""

    cases: dict
    names: frozenset


def figures_of(folder, own_only=False):
    """Figures of a result folder: all columns that do not vary between runs; absent values are left out, and those of a
    tree stand with its build alone. `own_only`: without structures of libraries, whose code changes with their versions.
    Throws RunError."""
    rows = samples.read_rows(folder)
    libraries = _libraries(folder) if own_only else set()
    names = [name for name in samples.deterministic_columns() if not rows or name in rows[0]]
    texts = {name for name, kind, *_ in columns.columns_of("cases.csv") if kind == "text"}
    cases = {}
    for row in rows:
        if row["structure"] in libraries:
            continue
        try:
            values = {name: _plain(row[name], name in texts) for name in names if row[name] != ""}
        except ValueError as error:
            raise results.RunError(f"{folder / 'cases.csv'}: case {row['case_id']}: {error}") from None
        cases[samples.comparison_of(row)] = values
    builds = {}
    for c, values in cases.items():
        if c.query == "build":
            builds.setdefault((c.scene, c.spec), values)
    for c, values in cases.items():
        of_build = builds.get((c.scene, c.spec), {}) if c.query != "build" else {}
        for name in [name for name in values if name != "status" and of_build.get(name) == values[name]]:
            del values[name]
    return Figures(cases, frozenset(names))


def _libraries(folder):
    """Names of the run's structures that libraries have made."""
    told = results.read_info(folder / "run.json").get("structures") or []
    return {s["spec"].partition("(")[0] for s in told if s.get("family") == "library"}


def _plain(text, is_text):
    """A field as JSON has it: whole numbers without a point."""
    if is_text:
        return text
    return int(text) if text.lstrip("-").isdigit() else float(text)


def differences(old, new):
    """All that differs between two Figures, in their order."""
    found = []
    for comparison in [*old.cases, *(c for c in new.cases if c not in old.cases)]:
        if comparison not in new.cases:
            found.append(Difference(comparison, "case", "there", None))
        elif comparison not in old.cases:
            found.append(Difference(comparison, "case", None, "there"))
        else:
            a, b = old.cases[comparison], new.cases[comparison]
            for name in [*a, *(n for n in b if n not in a)]:
                if name in old.names and name in new.names and a.get(name) != b.get(name):
                    found.append(Difference(comparison, name, a.get(name), b.get(name)))
    return found


# ---- baselines: small text files, one line a case, made to be read in a diff ----


def read_baseline(path):
    """(Figures, list of what was accepted before). Throws RunError naming the line."""
    try:
        lines = Path(path).read_text(encoding="utf-8").splitlines()
    except OSError as error:
        raise results.RunError(f"{path}: {error.strerror}; write it by --accept WHY") from None
    cases, names, accepted = {}, frozenset(), []
    for number, line in enumerate(lines, start=1):
        if not line.strip():
            continue
        try:
            entry = json.loads(line)
            if number == 1:
                if entry.get("raybench_baseline") != FORMAT:
                    raise ValueError(f"no baseline of format {FORMAT}")
                names = frozenset(entry["figures"])
            elif "accepted" in entry:
                accepted.append(entry)
            else:
                key = entry.pop("case")
                cases[samples.Comparison(*key[:-1], int(key[-1]))] = entry
        except (ValueError, TypeError, KeyError, AttributeError) as error:
            raise results.RunError(f"{path}: line {number}: not of a baseline: {error}") from None
    if not lines:
        raise results.RunError(f"{path}: empty; a baseline starts with a line of its format")
    return Figures(cases, names), accepted


def write_baseline(path, figures, accepted):
    """Through a temporary file. `accepted`: oldest first."""
    lines = [json.dumps({"raybench_baseline": FORMAT, "figures": sorted(figures.names)})]
    lines += [json.dumps(entry, ensure_ascii=False) for entry in accepted]
    for c, values in figures.cases.items():
        key = [c.scene, c.spec, c.ray_set, c.order, c.query, c.threads]
        lines.append(json.dumps({"case": key, **values}, ensure_ascii=False))
    text = "\n".join(lines) + "\n"
    Path(path).parent.mkdir(parents=True, exist_ok=True)
    results.write_atomically(Path(path), lambda temporary: temporary.write_text(text, encoding="utf-8"))


def acceptance(why, changed, commit, author=None, now=None):
    """The line that says who accepted new figures, when and why, with up to 100 old and new ones."""
    now = now or datetime.datetime.now(datetime.timezone.utc)
    shown = [[d.comparison.name, d.figure, d.old, d.new] for d in changed[:100]]
    return {
        "accepted": why,
        "author": author or _author(),
        "date": now.strftime("%Y-%m-%dT%H:%M:%SZ"),
        "commit": commit,
        "figures_changed": len(changed),
        "old_and_new": shown,
    }


def _author():
    import subprocess

    try:
        name = subprocess.run(
            ["git", "config", "user.name"], capture_output=True, text=True, check=False
        ).stdout.strip()
    except OSError:
        name = ""
    try:
        return name or getpass.getuser()
    except (KeyError, OSError):
        return "unknown"
