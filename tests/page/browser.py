"""Chromium without a window, driven through chromedriver by the requests of W3C WebDriver."""

from __future__ import annotations

import base64
import json
import shutil
import socket
import subprocess
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from fenics_contact import clean_environment

DRIVER = shutil.which("chromedriver")
CHROMIUM = shutil.which("chromium") or shutil.which("google-chrome")
MISSING = "needs Chromium and chromedriver, on Debian: apt-get install chromium chromium-driver"
OPTIONS = (
    "--headless", "--no-sandbox", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--disable-dev-shm-usage", "--hide-scrollbars",
    "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
)  # fmt: skip


class Browser:
    """A browser with one page.

    Attributes:
        url: Address of its driver's session.
    """

    def __init__(self, url: str) -> None:
        self.url = url

    def _post(self, what: str, content: dict[str, Any]) -> Any:
        return answer(f"{self.url}/{what}", content)

    def open(self, page: Path, width: int = 640, height: int = 480) -> None:
        """Open a page at a width of the screen and wait until it has drawn."""
        self.go(page, width, height)
        self.wait("return Number(document.getElementById('view').dataset.drawn || 0) > 0")

    def go(self, page: Path, width: int = 640, height: int = 480) -> None:
        """Open a page and forget what was asked for and complained about before."""
        self.requests(), self.messages()
        size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 600}
        self._post("goog/cdp/execute", {"cmd": "Emulation.setDeviceMetricsOverride", "params": size})
        self._post("url", {"url": page.as_uri()})

    def run(self, script: str, *arguments: Any) -> Any:
        """Return what a script returns."""
        return self._post("execute/sync", {"script": script, "args": list(arguments)})

    def wait(self, script: str, seconds: float = 60.0) -> None:
        """Wait until a script returns something true, or the page tells that something went wrong."""
        end = time.monotonic() + seconds
        while not self.run(script):
            assert self.trouble() == "", self.trouble()
            assert time.monotonic() < end, f"never true: {script}; {self.messages()}"
            time.sleep(0.05)

    def choose(self, control: str, value: Any) -> None:
        """Set a menu, a slider or a box as a user does, and wait until it is drawn."""
        before = self.run("return Number(document.getElementById('view').dataset.drawn)")
        self.run(
            """
            const control = document.getElementById(arguments[0]);
            control[control.type === "checkbox" ? "checked" : "value"] = arguments[1];
            control.dispatchEvent(new Event("input", { bubbles: true }));
            """,
            control,
            value,
        )
        self.wait(f"return Number(document.getElementById('view').dataset.drawn) > {before}")

    def trouble(self) -> str:
        """Return what the page says that went wrong."""
        return str(
            self.run("const box = document.getElementById('trouble'); return box ? box.textContent : ''")
        )

    def messages(self) -> list[str]:
        """Return what the browser has complained about since the last call."""
        return [entry["message"] for entry in self._post("se/log", {"type": "browser"})]

    def requests(self) -> list[str]:
        """Return the addresses that were asked for since the last call."""
        entries = [json.loads(entry["message"]) for entry in self._post("se/log", {"type": "performance"})]
        sent = [entry["message"] for entry in entries]
        return [
            each["params"]["request"]["url"] for each in sent if each["method"] == "Network.requestWillBeSent"
        ]

    def picture(self, path: Path) -> None:
        """Write what is on the screen to a PNG file."""
        path.write_bytes(base64.b64decode(answer(f"{self.url}/screenshot")))


def answer(url: str, content: dict[str, Any] | None = None, method: str | None = None) -> Any:
    """Return what the driver answers to a request."""
    data = None if content is None else json.dumps(content).encode()
    request = urllib.request.Request(url, data, {"Content-Type": "application/json"}, method=method)
    opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))
    try:
        with opener.open(request, timeout=120) as reply:
            return json.load(reply)["value"]
    except urllib.error.HTTPError as error:
        with error:
            raise AssertionError(json.load(error)["value"]["message"]) from None


@contextmanager
def browser(folder: Path) -> Iterator[Browser]:
    """Start a browser with an empty profile in a folder."""
    assert DRIVER, MISSING
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    options = {
        "binary": CHROMIUM,
        "args": [*OPTIONS, f"--user-data-dir={folder / 'profile'}"],
    }
    wanted = {
        "browserName": "chrome",
        "goog:chromeOptions": options,
        "goog:loggingPrefs": {"browser": "ALL", "performance": "ALL"},
    }
    url = f"http://127.0.0.1:{port}"
    silent = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    with subprocess.Popen([DRIVER, f"--port={port}"], env=clean_environment(), **silent) as driver:
        try:
            wait_for(url)
            session = answer(f"{url}/session", {"capabilities": {"alwaysMatch": wanted}})
            yield Browser(f"{url}/session/{session['sessionId']}")
            answer(f"{url}/session/{session['sessionId']}", method="DELETE")
        finally:
            driver.terminate()


def wait_for(url: str, seconds: float = 30.0) -> None:
    """Wait until a driver answers."""
    end = time.monotonic() + seconds
    while True:
        try:
            answer(f"{url}/status")
            return
        except (urllib.error.URLError, ConnectionError):
            assert time.monotonic() < end, "chromedriver does not start"
            time.sleep(0.05)
