"""A headless Chromium for tests, driven over ChromeDriver's own HTTP protocol."""

import base64
import json
import shutil
import subprocess
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

MISSING = [name for name in ("chromium", "chromedriver") if not shutil.which(name)]
"""What is not installed here (Debian: chromium, chromium-driver)."""

ARGUMENTS = (
    "--headless",
    "--no-sandbox",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    # WebGL without a graphics card
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--window-size=1400,900",
    "--host-resolver-rules=MAP * ~NOTFOUND , EXCLUDE 127.0.0.1",
)


class Browser:
    """One window."""

    def __init__(self, session: str):
        self._session = session

    def _call(self, command: str, fields: dict | None = None) -> Any:
        data = None if fields is None else json.dumps(fields).encode()
        request = urllib.request.Request(f"{self._session}/{command}", data)
        with urllib.request.urlopen(request, timeout=60) as response:
            return json.load(response)["value"]

    def open(self, address: str) -> None:
        self._call("url", {"url": address})

    def run(self, script: str) -> Any:
        """What a script returns."""
        return self._call("execute/sync", {"script": script, "args": []})

    def screenshot(self) -> bytes:
        """PNG."""
        return base64.b64decode(self._call("screenshot"))

    def log(self, kind: str) -> list[dict]:
        """What has been logged since the last call."""
        return self._call("se/log", {"type": kind})

    def requests(self) -> list[str]:
        """Addresses that were asked for since the last call."""
        events = [json.loads(entry["message"]) for entry in self.log("performance")]
        return [
            event["message"]["params"]["request"]["url"]
            for event in events
            if event["message"]["method"] == "Network.requestWillBeSent"
        ]


@contextmanager
def browser(profile: Path) -> Iterator[Browser]:
    """A new browser with an empty profile."""
    with subprocess.Popen(
        ["chromedriver", "--port=0"], stdout=subprocess.PIPE, text=True
    ) as driver:
        assert driver.stdout is not None
        try:
            line = next(line for line in driver.stdout if "successfully" in line)
            port = line.rsplit(" ", 1)[1].strip(" .\n")
            root = f"http://127.0.0.1:{port}/session"
            options = {"args": [*ARGUMENTS, f"--user-data-dir={profile}"]}
            capabilities = {
                "browserName": "chrome",
                "goog:chromeOptions": options,
                "goog:loggingPrefs": {"performance": "ALL", "browser": "ALL"},
            }
            request = urllib.request.Request(
                root,
                json.dumps({"capabilities": {"alwaysMatch": capabilities}}).encode(),
            )
            with urllib.request.urlopen(request, timeout=60) as response:
                session = json.load(response)["value"]["sessionId"]
            try:
                yield Browser(f"{root}/{session}")
            finally:
                delete = urllib.request.Request(f"{root}/{session}", method="DELETE")
                urllib.request.urlopen(delete, timeout=60).close()
        finally:
            driver.terminate()


def until(condition, seconds: float) -> Any:
    """What a condition gives as soon as that is true."""
    end = time.monotonic() + seconds
    while not (value := condition()):
        assert time.monotonic() < end, "it did not happen in time"
        time.sleep(0.2)
    return value
