"""Instructions that both programs execute, by valgrind's callgrind: nearly exact, and blind to caches."""

import re
import shutil
import subprocess

from .. import results

# So that the number of passes does not depend on how long one takes.
FEWEST = {"--repetitions": "1", "--passes": "1"}


def compare(programs, work):
    """Lines that say how many instructions one more process of each program takes, and the change. A program built for
    this very processor may use instructions that valgrind does not know: then, or without valgrind, one line that says
    so."""
    if shutil.which("valgrind") is None:
        return ["--instructions: valgrind is not installed (apt install valgrind)"]
    counts = []
    for side, program in zip("AB", programs):
        # with children: a command line may begin with `env`, or be a script
        words = ["valgrind", "--tool=callgrind", "--callgrind-out-file=/dev/null", "--trace-children=yes"]
        more = ["--again", str(program.folder)] if program.again else []
        folder = work / f"instructions-{side}"
        command = [*words, *shortest(program.words()), "--no-report", "--out", str(folder), *more]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        shutil.rmtree(folder, ignore_errors=True)
        found = [int(count) for count in re.findall(r"Collected\s*:\s*(\d+)", done.stderr)]
        if done.returncode not in (0, 1, 3) or not found:
            return [f"--instructions: valgrind cannot run {side}: {_why(done)}"]
        counts.append(sum(found))
    if counts[0] == 0:
        raise results.RunError("--instructions: callgrind counted none")
    return [f"instructions: {counts[0]:,} and {counts[1]:,}, {100 * (counts[1] / counts[0] - 1):+.2f} %"]


def shortest(words):
    """A command line with FEWEST in place of its own such options."""
    kept, skip = [], False
    for word in words:
        name, equals, _ = word.partition("=")
        if not skip and name not in FEWEST:
            kept.append(word)
        skip = not skip and name in FEWEST and not equals
    return [*kept, *(word for option in FEWEST.items() for word in option)]


def _why(done):
    if done.returncode < 0 or "unrecognised instruction" in done.stderr or "Unrecognised instruction" in done.stderr:
        return "it uses instructions that valgrind does not know; build it by the preset portable"
    said = [line for line in done.stderr.splitlines() if line.strip() and not line.startswith("==")]
    hint = "under valgrind libraries choose other code, and long double is double: name --structures without libraries"
    return f"{said[-1] if said else f'exit code {done.returncode}'} ({hint})"
