"""Runs the commands of raybench that measure."""

import json
import shlex
import subprocess
import tempfile
import threading

from ..results import RunError


class TooSlow(Exception):
    """A command took longer than it was given."""


class Program:
    """raybench itself, with its plugins. `say(text)`: where progress goes."""

    def __init__(self, path, plugins=(), say=lambda text: None):
        self.path, self.say = str(path), say
        self.options = [word for plugin in plugins for word in ("--plugin", str(plugin))]

    def shown(self, *words):
        """The command as a user types it."""
        return shlex.join(["raybench", *self.options, *map(str, words)])

    def list(self, *words):
        """`raybench list ... --json`, read."""
        return json.loads(self.run("list", *words, "--json"))

    def run(self, *words, allowed=(0,), phase="", seconds=None):
        """What the command prints. Its progress is passed on as "PHASE: ...". Throws RunError with what it complained of
        when the exit code is not one of `allowed`, TooSlow after `seconds`."""
        words = [self.path, *self.options, *map(str, words)]
        said = []
        with tempfile.TemporaryFile("w+", encoding="utf-8") as out:
            try:
                child = subprocess.Popen(
                    words, stdin=subprocess.DEVNULL, stdout=out, stderr=subprocess.PIPE, text=True, errors="replace"
                )
            except OSError as error:
                raise RunError(f"{self.path}: {error.strerror}") from None
            reader = threading.Thread(target=self._read, args=(child.stderr, said, phase), daemon=True)
            reader.start()
            try:
                code = child.wait(seconds)
            except subprocess.TimeoutExpired:
                raise TooSlow from None
            finally:
                if child.poll() is None:
                    child.kill()
                    child.wait()
                reader.join()
                child.stderr.close()
            if code not in allowed:
                raise RunError(
                    (said or [f"exit code {code} of `{self.shown(*words[1:])}`"])[-1].removeprefix("raybench: ")
                )
            out.seek(0)
            return out.read()

    def _read(self, stream, said, phase):
        for line in map(str.strip, stream):
            if line.startswith("[") and phase:
                self.say(f"{phase}: {line}")
            elif line:
                said.append(line)
