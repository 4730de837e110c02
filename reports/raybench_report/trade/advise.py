"""`raybench advise`: the structure, arithmetic and parameters that are cheapest for a scene and a number of rays."""

import argparse
import json
import subprocess
import tempfile
from pathlib import Path

from ..errors import RunError
from . import advice, candidates, costs
from .files import require_folder, toml, write_file
from .search import Search
from .trials import Trials, TrialsEnded

JUDGED = 4096  # rays on which the winner is compared with the truth, of the mix and of aimed ones each
OFFSET_RAYS = 16384  # by which `raybench offset` is asked


def main(argv):
    """Returns the exit code. Throws RunError for wrong input, a budget that nothing fits into included."""
    arguments = _parser().parse_args(argv)
    require_folder(arguments.out)
    scene = _scene(arguments)
    precision = advice.Precision.of(scene)
    listed = json.loads(_call(arguments, "list", "structures", "--json"))
    known = {s["name"] for s in listed if not s.get("unavailable")}
    rows = candidates.chosen(
        scene["primitives"], arguments.max_error, arguments.memory, precision.numerics,
        known, arguments.also,
    )  # fmt: skip
    rays = arguments.rays * arguments.rebuild_every
    try:
        with Trials(
            arguments.program, arguments.scene, mix=arguments.mix, seed=arguments.seed, plugins=arguments.plugin,
            rays=1 << 15 if 0 < arguments.max_error < 1e-3 else 1 << 14,
        ) as trials:  # fmt: skip
            admission = Admission(trials, arguments.max_error)
            search = Search(trials, rows, rays, arguments.seconds, arguments.memory, admission.admits)
            ranked, judged = _first_right(trials, search.run())
            if not ranked:
                raise RunError(_nothing_fits(arguments, search))
            tempting = [spec for spec in candidates.TEMPTING if spec.split("(")[0] in known]
            found = advice.Advice(
                arguments, trials.facts, scene, precision, rays, ranked, search.all, judged, admission,
                search.over(), search.beside_best(tempting) if arguments.max_error == 0 else {},
                None if arguments.no_offset else _offset(arguments, ranked[0].spec),
            )  # fmt: skip
    except TrialsEnded as ended:
        return ended.code
    report = found.as_json()
    print(json.dumps(report, indent=1) if arguments.json else advice.text(found))
    if arguments.out:
        arguments.out.mkdir(parents=True, exist_ok=True)
        write_file(arguments.out / "advice.json", json.dumps(report, indent=1) + "\n")
        comments = [f"raybench advise '{arguments.scene}' --rays {arguments.rays} --mix {arguments.mix}"]
        write_file(arguments.out / "advised.toml", toml(ranked[0].spec, comments))
    return 0


def _parser():
    parser = argparse.ArgumentParser(prog="raybench advise", allow_abbrev=False)
    parser.add_argument("scene")
    parser.add_argument("--program", required=True)
    parser.add_argument("--plugin", action="append", default=[])
    parser.add_argument("--also", action="append", default=[])
    parser.add_argument("--mix", default="picture")
    parser.add_argument("--rays", type=int, default=1000000)
    parser.add_argument("--rebuild-every", type=int, default=1)
    parser.add_argument("--max-error", type=float, default=0.0)
    parser.add_argument("--memory", type=int, default=0)
    parser.add_argument("--seconds", type=float, default=30.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--no-offset", action="store_true")
    return parser


class Admission:
    """Who may be advised: what claims to be watertight or exact; with --max-error also a tree whose rate of wrong
    answers among the rays of the mix is below that with 95 % confidence."""

    def __init__(self, trials, max_error):
        self._trials, self.max_error = trials, max_error
        self.rays = trials.training_rays
        # So few rays cannot show so low a rate, whatever they answer.
        self.can_be_shown = max_error > 0 and costs.rays_for(max_error) <= self.rays
        self.bounds = {}  # of each spec that was measured

    def admits(self, built):
        if built.claims in ("watertight", "exact"):
            return True
        if not self.can_be_shown:
            return False
        of = self._trials.judge(built.tree, self.rays)["mix"]
        self.bounds[built.spec] = costs.upper_bound(of["errors"], of["rays"])
        return self.bounds[built.spec] <= self.max_error


def _first_right(trials, ranked):
    """Verdict first: the cheapest that keeps what it claims, those behind it, and what was found about it."""
    for i, contestant in enumerate(ranked):
        if contestant.tree is None:
            continue
        judged = trials.judge(contestant.tree, min(JUDGED, trials.training_rays))
        if not judged["broken"]:
            return ranked[i:], judged
        contestant.out = "broke its claim: " + judged["broken"]
    return [], None


def _nothing_fits(arguments, search):
    built = [c for c in search.all if c.bytes]
    if arguments.memory and built:
        small = min(built, key=lambda c: c.bytes)
        return (
            f"--memory {arguments.memory}: no candidate fits into so few bytes; the smallest, {small.spec}, "
            f"takes {small.bytes}"
        )
    reasons = sorted({f"{c.spec}: {c.out}" for c in search.all})
    return f"no candidate can be advised for '{arguments.scene}': {'; '.join(reasons)}"


def _scene(arguments):
    return json.loads(_call(arguments, "list", "scene", arguments.scene, "--json"))


def _call(arguments, *words):
    plugins = [f"--plugin={p}" for p in arguments.plugin]
    done = subprocess.run([arguments.program, *plugins, *words], capture_output=True, text=True)
    if done.returncode != 0:
        raise RunError(done.stderr.strip().removeprefix("raybench: "))
    return done.stdout


def _offset(arguments, spec):
    """What `raybench offset` says of the structure, in its own words; None where this build has no such command or the
    scene is not for it."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "offset"
        words = [arguments.program, *(f"--plugin={p}" for p in arguments.plugin), "offset", arguments.scene]
        words += ["--structure", spec, "--rays", str(OFFSET_RAYS), "--out", str(out)]
        subprocess.run(words, capture_output=True)
        file = out / "offset.json"
        return json.loads(file.read_text())["advice"] if file.exists() else None
