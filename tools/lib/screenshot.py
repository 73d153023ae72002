"""A picture of a web page that stands still, as Debian's headless Chromium shows it: screenshot.py URL FILE.png.

Used by tools/doc-figures and the tests. WebGL is drawn in software, so no display and no graphics card are needed.
"""

import base64
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from websockets.sync.client import connect
from websockets.sync.connection import Connection

WIDTH, HEIGHT = 1600, 1000
CLOSE_NOTICES = "document.querySelectorAll('.mantine-Notification-closeButton').forEach((button) => button.click())"
"""Of the viewer: it warns of WebGL in software."""
LIMIT_S = 180.0
PERIOD_S = 2.0
LEAST_BYTES = 30_000
"""A picture that compresses to less is an empty page."""


def take_screenshot(url: str, path: Path) -> None:
    """Write what Chromium shows of a page as a PNG file of WIDTH x HEIGHT pixels, once it no longer changes.

    Raises:
        RuntimeError: there is no Chromium, it does not start, or the page stays empty or never stands still.
    """
    chromium = shutil.which("chromium")
    if chromium is None:
        raise RuntimeError("chromium is not installed (tools/packages/apt-test.txt)")
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        options = ["--headless=new", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
        options += [f"--window-size={WIDTH},{HEIGHT}", "--hide-scrollbars", "--no-first-run", "--disable-dev-shm-usage"]
        options += ["--remote-debugging-port=0", f"--user-data-dir={profile}", "--disable-background-networking"]
        if os.geteuid() == 0:
            options.append("--no-sandbox")  # which root does not have
        process = subprocess.Popen([chromium, *options, "about:blank"], stderr=subprocess.PIPE, text=True)
        try:
            with connect(_debugger(process), max_size=None) as wire:
                path.write_bytes(_shoot(wire, url))
        finally:
            process.kill()
            process.communicate()


def _debugger(process: "subprocess.Popen[str]") -> str:
    """The address of the debugger, which Chromium prints when it is ready."""
    assert process.stderr is not None
    deadline = time.monotonic() + LIMIT_S
    for line in process.stderr:
        found = re.search(r"DevTools listening on (ws://\S+)", line)
        if found:
            return found[1]
        if time.monotonic() > deadline:
            break
    raise RuntimeError("chromium did not start")


def _shoot(wire: Connection, url: str) -> bytes:
    number = 0

    def call(method: str, session: str | None = None, **parameters: Any) -> dict[str, Any]:
        nonlocal number
        number += 1
        request = {"id": number, "method": method, "params": parameters}
        wire.send(json.dumps(request if session is None else {**request, "sessionId": session}))
        while True:
            answer = json.loads(wire.recv(LIMIT_S))
            if answer.get("id") == number:
                if "error" in answer:
                    raise RuntimeError(f"chromium: {method}: {answer['error']['message']}")
                result: dict[str, Any] = answer["result"]
                return result

    target = call("Target.createTarget", url="about:blank")["targetId"]
    session = call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
    metrics = {"width": WIDTH, "height": HEIGHT, "deviceScaleFactor": 1, "mobile": False}
    call("Emulation.setDeviceMetricsOverride", session, **metrics)
    deadline = time.monotonic() + LIMIT_S
    while "errorText" in (answer := call("Page.navigate", session, url=url)):
        _wait(deadline, f"{url}: {answer['errorText']}")
    before, now = b"", b""
    while now != before or len(now) < LEAST_BYTES:
        _wait(deadline, f"{url}: the page is empty or does not stand still")
        call("Runtime.evaluate", session, expression=CLOSE_NOTICES)
        before, now = now, base64.b64decode(call("Page.captureScreenshot", session, format="png")["data"])
    return now


def _wait(deadline: float, complaint: str) -> None:
    if time.monotonic() > deadline:
        raise RuntimeError(complaint)
    time.sleep(PERIOD_S)


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit((__doc__ or "").splitlines()[0])
    take_screenshot(sys.argv[1], Path(sys.argv[2]))
