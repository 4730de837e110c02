"""Two commits of a repository, each built in a worktree of its own."""

import shlex
import subprocess
from contextlib import contextmanager

from .. import results

BUILD = "./test.sh --build-only"
BINARY = "build/release/raybench run --quick"


@contextmanager
def built(names, build, binary, folder):
    """Checks both commits out below `folder`, runs `build` in each and gives the two command lines: `binary`, with the
    worktree for {tree}, and its program taken from there if there is one. Removes the worktrees in the end. Throws
    RunError."""
    trees = []
    try:
        commands = []
        for side, name in zip(("A", "B"), names):
            commit = _git("rev-parse", "--verify", "--quiet", "--end-of-options", name + "^{commit}")
            if not commit:
                raise results.RunError(f"--commits {name}: the repository in this folder has no such commit")
            tree = folder / f"commit-{side}"
            if _git("worktree", "add", "--detach", str(tree), commit) is None:
                raise results.RunError(f"--commits {name}: git cannot make a worktree of it")
            trees.append(tree)
            print(f"building {name} ({commit[:10]})", flush=True)
            log = folder / f"build-{side}.log"
            with open(log, "w", encoding="utf-8") as file:
                code = subprocess.run(build, shell=True, cwd=tree, stdout=file, stderr=subprocess.STDOUT, check=False)
            if code.returncode != 0:
                said = log.read_text(encoding="utf-8", errors="replace").strip().splitlines()[-20:]
                raise results.RunError(f"--build: exit code {code.returncode} for {name}: " + " | ".join(said[-3:]))
            words = shlex.split(binary.replace("{tree}", shlex.quote(str(tree))))
            if (tree / words[0]).exists():
                words[0] = str(tree / words[0])
            commands.append(shlex.join(words))
        yield commands
    finally:
        for tree in trees:
            _git("worktree", "remove", "--force", str(tree))


def _git(*words):
    """Its output, None where it fails."""
    done = subprocess.run(["git", *words], capture_output=True, text=True, check=False)
    return done.stdout.strip() if done.returncode == 0 else None
