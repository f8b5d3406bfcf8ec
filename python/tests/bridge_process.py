"""Bridges as processes, for the tests."""

import atexit
import re
import signal
import subprocess
import sys
import threading
from typing import List

from conftest import Server


class Process:
    """One process, and what it prints."""

    def __init__(self, command: List[str]) -> None:
        self.log: List[str] = []
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        atexit.register(self.process.kill)  # of a test that fails
        self._changed = threading.Condition()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            with self._changed:
                self.log.append(line)
                self._changed.notify_all()

    def wait_for(self, pattern: str) -> "re.Match[str]":
        """The first match in the log, now or later."""
        with self._changed:
            assert self._changed.wait_for(lambda: re.search(pattern, "".join(self.log)), 60), (pattern, self.log)
            match = re.search(pattern, "".join(self.log))
        assert match is not None
        return match

    def stop(self) -> None:
        """Ends it as Ctrl-C does."""
        self.process.send_signal(signal.SIGINT)
        assert self.process.wait(30) == 0, self.log
        self._reader.join(30)
        assert "Traceback" not in "".join(self.log), self.log


class Bridge(Process):
    """One process of `python3 -m hapticd.igtlink`, on a free port."""

    def __init__(self, server: Server, *options: str) -> None:
        super().__init__([sys.executable, "-m", "hapticd.igtlink", "--server", server.tcp, "--listen", "127.0.0.1:0", *options])
        self.port = int(self.wait_for(r"listening on 127\.0\.0\.1:([0-9]+) ").group(1))
