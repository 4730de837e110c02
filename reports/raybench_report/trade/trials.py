"""`raybench trials` as a child process: trees of one scene, built and timed beside each other as Python decides."""

import json
import subprocess
from dataclasses import dataclass

import numpy as np

from ..errors import RunError


class TrialsEnded(Exception):
    """The program ended by itself, after saying why on stderr. `code`: its exit code."""

    def __init__(self, code):
        super().__init__(f"raybench trials ended with {code}")
        self.code = code


@dataclass(frozen=True)
class Built:
    """What came of building `spec`. Without `tree` it was given up, `stopped` says why."""

    spec: str
    seconds: float  # processor time
    tree: int | None = None
    bytes: int = 0  # nodes, primitives, and the mesh where it is still needed
    claims: str = ""  # watertight, exact, inexact, nothing
    stopped: str = ""


class Trials:
    """Use as a context. Times are processor time of one thread."""

    def __init__(self, program, scene, *, mix="picture", rays=1 << 14, seed=1, plugins=()):
        words = [program, *(f"--plugin={p}" for p in plugins), "trials", f"--mix={mix}", f"--rays={rays}"]
        words += [f"--seed={seed}", "--", scene]
        self._process = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self.facts = self._read()
        self._shares = np.array([s["share"] for s in self.facts["sets"]])

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._process.stdin.close()
        self._process.stdout.close()
        self._process.wait()

    @property
    def training_rays(self):
        """The largest part of the mix for which no set runs out of rays."""
        return self._most("training")

    @property
    def held_out_rays(self):
        return self._most("held_out")

    def build(self, spec, seconds=1e9):
        """Gives up after so many seconds. Any number of trees may be there at once, as memory allows."""
        return Built(spec=spec, **self._ask(build=spec, seconds=min(max(seconds, 0.0), 1e9)))

    def time(self, trees, rays, rounds=1, held_out=False, seconds=1e9):
        """Nanoseconds a ray of the mix: an array with a row for each tree and a column for each round. There may be
        fewer rounds, where `seconds` are over, but at least one."""
        answer = self._ask(time=trees, rays=int(rays), rounds=int(rounds), held_out=held_out, seconds=seconds)
        return np.array(answer["ns"]) @ self._shares

    def judge(self, tree, rays):
        """Errors against exact truth: of rays of the mix ("mix") and of rays aimed at edges and vertices ("aimed")."""
        return self._ask(judge=tree, rays=int(rays))

    def drop(self, *trees):
        if trees:
            self._ask(drop=list(trees))

    def _most(self, half):
        return int(min(s[half] / s["share"] for s in self.facts["sets"]))

    def _ask(self, **request):
        try:
            self._process.stdin.write(json.dumps(request) + "\n")
            self._process.stdin.flush()
        except BrokenPipeError:
            pass  # it has ended, and _read() says so
        answer = self._read()
        if "error" in answer:
            raise RunError(answer["error"])
        return answer

    def _read(self):
        line = self._process.stdout.readline()
        if not line:
            raise TrialsEnded(self._process.wait())
        return json.loads(line)
