"""A headless Chromium, driven over a pipe by the DevTools protocol: it takes the pictures of a page."""

from __future__ import annotations

import base64
import json
import os
import select
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from types import TracebackType
from typing import Any

from ngalpha_pin.common.optional import MissingPackageError
from ngalpha_pin.errors import NgalphaError

PROGRAMS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome", "microsoft-edge")
FLAGS = (
    "--headless",
    "--disable-gpu",
    "--use-gl=angle",
    "--use-angle=swiftshader",  # WebGL without a graphics card
    "--enable-unsafe-swiftshader",
    "--disable-quic",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-extensions",
    "--disable-dev-shm-usage",
    "--no-first-run",
    "--no-default-browser-check",
    "--hide-scrollbars",
    "--mute-audio",
    "--remote-debugging-pipe",
)
# the protocol uses the file descriptors 3 and 4: move the pipes there and become the browser
LAUNCHER = """
import os, sys
pipes = [os.dup(int(number)) for number in sys.argv[1:3]]
for number, pipe in zip((3, 4), pipes):
    os.dup2(pipe, number)
    os.set_inheritable(number, True)
os.execv(sys.argv[3], sys.argv[3:])
"""


class BrowserError(NgalphaError):
    """The browser stopped, or did not answer in time, or a script in the page failed."""


def find_browser(path: str | os.PathLike[str] | None = None) -> str:
    """The program to run: the one given, or the first known one that is installed.

    Raises:
        MissingPackageError: there is none.
    """
    found = shutil.which(path) if path is not None else next(filter(None, map(shutil.which, PROGRAMS)), None)
    if found is None:
        wanted = f"{path} is not a program" if path is not None else "no Chromium or Chrome is on the PATH"
        raise MissingPackageError(f"{wanted}: apt-get install chromium, or give browser='/path/to/chrome'")
    return found


class Browser:
    """One page of a headless browser; use it as a context manager.

    Args:
        width: of the page [pixels].
        height: of the page [pixels].
        path: of the program; None looks for one.
        timeout: for every answer [s].

    Attributes:
        messages: events that the browser reported, such as "Network.requestWillBeSent".
    """

    def __init__(
        self, width: int = 1280, height: int = 720, path: str | os.PathLike[str] | None = None, timeout: float = 60.0
    ):
        if os.name != "posix":
            raise NotImplementedError("the headless browser is driven over POSIX pipes")
        self.timeout = timeout
        self.messages: list[dict[str, Any]] = []
        self._count = 0
        self._buffer = b""
        self._session: str | None = None
        program = find_browser(path)
        self._profile = tempfile.TemporaryDirectory(prefix="replay-browser-", ignore_cleanup_errors=True)
        self._launch(program, width, height)
        try:
            target = self.call("Target.createTarget", url="about:blank")["targetId"]
            self._session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
            for domain in ("Page", "Runtime", "Network", "Log"):
                self.call(f"{domain}.enable")
            self.resize(width, height)
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Browser:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    def resize(self, width: int, height: int) -> None:
        """Set the size of the page [pixels]."""
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)

    def open(self, page: str | os.PathLike[str], ready: str = "true", fragment: str = "") -> None:
        """Load a page from a file or an http address, at "#fragment", and wait until `ready` holds in it."""
        address = page if str(page).startswith("http://") else Path(page).resolve().as_uri()
        self.call("Page.navigate", url=f"{address}#{fragment}" if fragment else str(address))
        end = time.monotonic() + self.timeout
        while not self.evaluate(f"document.readyState === 'complete' && Boolean({ready})"):
            if time.monotonic() > end:
                raise BrowserError(f"{page} is not ready after {self.timeout:g} s: {self.complaints()}")
            time.sleep(0.02)

    def evaluate(self, expression: str) -> Any:
        """Value of a JavaScript expression in the page; a promise is waited for."""
        answer = self.call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in answer:
            details = answer["exceptionDetails"]
            raise BrowserError(details.get("exception", {}).get("description", details["text"]))
        return answer["result"].get("value")

    def screenshot(self) -> bytes:
        """The page as it is now, as a PNG file."""
        return base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"])

    def complaints(self) -> list[str]:
        """Errors and exceptions that the page has reported so far."""
        found = []
        for message in self.messages:
            params = message["params"]
            if message["method"] == "Runtime.exceptionThrown":
                details = params["exceptionDetails"]
                found.append(details.get("exception", {}).get("description", details["text"]))
            if message["method"] == "Runtime.consoleAPICalled" and params["type"] in ("error", "assert"):
                found.append(" ".join(str(a.get("value", a.get("description"))) for a in params["args"]))
            if message["method"] == "Log.entryAdded" and params["entry"]["level"] == "error":
                found.append(params["entry"]["text"])
        return found

    def requests(self) -> list[str]:
        """Addresses that the page has asked for so far."""
        sent = (m["params"] for m in self.messages if m["method"] == "Network.requestWillBeSent")
        return [params["request"]["url"] for params in sent]

    def call(self, method: str, **params: Any) -> dict[str, Any]:
        """Call a method of the DevTools protocol and return its result.

        Raises:
            BrowserError: the browser refuses, stops or does not answer.
        """
        self._count += 1
        request: dict[str, Any] = {"id": self._count, "method": method, "params": params}
        if self._session is not None:
            request["sessionId"] = self._session
        try:
            self._write(json.dumps(request).encode() + b"\0")
        except BrokenPipeError as error:
            raise BrowserError("the browser has stopped") from error
        end = time.monotonic() + self.timeout
        while True:
            message = self._read(end, method)
            if message.get("id") == self._count:
                if "error" in message:
                    raise BrowserError(f"{method}: {message['error']['message']}")
                return message["result"]
            if "method" in message:
                self.messages.append(message)

    def close(self) -> None:
        """End the browser and remove its profile."""
        if self._process.poll() is None:
            os.killpg(self._process.pid, signal.SIGKILL)  # a group of its own: the browser and its children
        self._process.wait()
        for end in (self._in, self._out):
            os.close(end)
        self._profile.cleanup()

    def _launch(self, program: str, width: int, height: int) -> None:
        child_in, self._out = os.pipe()
        self._in, child_out = os.pipe()
        command = [sys.executable, "-I", "-S", "-c", LAUNCHER, str(child_in), str(child_out)]
        command += [program, *FLAGS, f"--window-size={width},{height}", f"--user-data-dir={self._profile.name}"]
        if os.geteuid() == 0:
            command.append("--no-sandbox")
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            pass_fds=(child_in, child_out),
            start_new_session=True,
        )
        os.close(child_in)
        os.close(child_out)

    def _write(self, content: bytes) -> None:
        while content:
            content = content[os.write(self._out, content) :]

    def _read(self, end: float, method: str) -> dict[str, Any]:
        while b"\0" not in self._buffer:
            ready, _, _ = select.select([self._in], [], [], max(end - time.monotonic(), 0.0))
            if not ready:
                raise BrowserError(f"{method}: no answer within {self.timeout:g} s")
            chunk = os.read(self._in, 1 << 20)
            if not chunk:
                raise BrowserError("the browser has stopped")
            self._buffer += chunk
        head, _, self._buffer = self._buffer.partition(b"\0")
        return json.loads(head)
