"""Instructions that both programs execute, by valgrind's callgrind: nearly exact, and blind to caches."""

import re
import shutil
import subprocess

from .. import results


def compare(programs, work):
    """Lines that say how many instructions one judged process of each program takes, and the change. A program built
    for this very processor may use instructions that valgrind does not know: then, or without valgrind, one line that
    says so."""
    if shutil.which("valgrind") is None:
        return ["--instructions: valgrind is not installed (apt install valgrind)"]
    counts = []
    for side, program in zip("AB", programs):
        words = ["valgrind", "--tool=callgrind", "--callgrind-out-file=/dev/null", "--trace-children=no"]
        more = ["--again", str(program.folder)] if program.again else []
        folder = work / f"instructions-{side}"
        done = subprocess.run(
            [*words, *program.words("--no-report", "--repetitions", "1", "--out", str(folder), *more)],
            capture_output=True, text=True, check=False,
        )  # fmt: skip
        shutil.rmtree(folder, ignore_errors=True)
        found = re.search(r"Collected\s*:\s*(\d+)", done.stderr)
        if done.returncode not in (0, 1, 3) or found is None:
            return [f"--instructions: valgrind cannot run {side}; build it by the preset portable"]
        counts.append(int(found.group(1)))
    if counts[0] == 0:
        raise results.RunError("--instructions: callgrind counted none")
    return [f"instructions: {counts[0]:,} and {counts[1]:,}, {100 * (counts[1] / counts[0] - 1):+.2f} %"]
