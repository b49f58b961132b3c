"""The program `organza`, run beside Blender."""

import importlib.util
import os
import pathlib
import shutil
import subprocess
import sys
import threading


def found(named):
    """The words that call organza, and the environment that they need: the program that is named,
    one on the path, or the Python package that came with the extension; no words without any."""
    environment = dict(os.environ)
    if named:
        return [named], environment
    on_path = shutil.which("organza")
    if on_path:
        return [on_path], environment
    package = importlib.util.find_spec("organza")
    if package is None or not package.origin:
        return [], environment
    folder = pathlib.Path(package.origin).parent.parent
    environment["PYTHONPATH"] = str(folder)
    return [sys.executable, "-m", "organza"], environment


class Run:
    """Commands of organza, one after the other. `line` is what was said last, `error` why they
    ended early; `is_done` once nothing runs any more."""

    def __init__(self, words, environment, commands):
        self.line, self.error = "", None
        self.is_done = self.is_stopped = False
        self._words, self._environment, self._child = words, environment, None
        self._thread = threading.Thread(target=self._run, args=[commands], daemon=True)
        self._thread.start()

    def _run(self, commands):
        try:
            for command in commands:
                if not self.is_stopped:
                    self._one(command)
                if self.error:
                    break
        except OSError as error:
            self.error = f"{self._words[0]}: {error}"
        self.is_done = True

    def _one(self, command):
        self._child = subprocess.Popen(
            [*self._words, *command],
            env=self._environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
            encoding="utf-8",
            errors="replace",
        )
        if self.is_stopped:
            self._child.terminate()
        for line in self._child.stderr:
            self.line = line.strip()
        if self._child.wait() != 0 and not self.is_stopped:
            self.error = self.line or f"organza ended with {self._child.returncode}"

    def wait(self):
        self._thread.join()

    def stop(self):
        self.is_stopped = True
        if self._child is not None:
            self._child.terminate()
