"""Two commits of a repository, each built in a worktree of its own."""

import os
import shlex
import signal
import subprocess
import time
from contextlib import contextmanager, suppress

from .. import results
from . import pairs

BUILD = "cmake --preset release && cmake --build --preset release --target raybench -j $(nproc)"
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
            begin = time.monotonic()
            code, said = _build(build, tree, folder / f"build-{side}.log", f"building {name} ({commit[:10]})")
            if code != 0:
                raise results.RunError(f"--build: exit code {code} for {name}: " + " | ".join(said))
            print(f"built {name} ({commit[:10]}) in {time.monotonic() - begin:.0f} s", flush=True)
            words = shlex.split(binary.replace("{tree}", shlex.quote(str(tree))))
            if (tree / words[0]).exists():
                words[0] = str(tree / words[0])
            commands.append(shlex.join(words))
        yield commands
    finally:
        for tree in trees:
            _git("worktree", "remove", "--force", str(tree))


def _build(command, tree, log, title):
    """Runs the shell's command there and shows its last line meanwhile. (exit code, last lines)."""
    say = pairs.Progress()

    def last_lines():
        return [line for line in log.read_text(encoding="utf-8", errors="replace").splitlines() if line.strip()][-3:]

    # Where the build uses ccache, one worktree takes what it compiled for another.
    environment = {"CCACHE_BASEDIR": str(tree), **os.environ}
    with open(log, "w", encoding="utf-8") as file:
        process = subprocess.Popen(
            command, shell=True, cwd=tree, stdout=file, stderr=subprocess.STDOUT, env=environment,
            start_new_session=True,
        )  # fmt: skip
        try:
            while process.poll() is None:
                say(f"{title}: {' '.join(last_lines()[-1:])[:100]}")
                with suppress(subprocess.TimeoutExpired):
                    process.wait(0.5)
        finally:
            if process.poll() is None:  # with all that it has started
                os.killpg(process.pid, signal.SIGTERM)
                process.wait()
    say(None)
    return process.returncode, last_lines()


def _git(*words):
    """Its output, None where it fails."""
    done = subprocess.run(["git", *words], capture_output=True, text=True, check=False)
    return done.stdout.strip() if done.returncode == 0 else None
