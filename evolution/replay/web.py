"""A recording as a web page: a folder that any web server can publish.

The viewer is the one in rerun's wheel. It is served by rerun itself and not stored as
files, so the folder gets copies. The page keeps it from contacting other servers.
"""

import functools
import http.server
import socket
import subprocess
import time
import urllib.request
from pathlib import Path

from epuck_mj.errors import UserError
from epuck_mj.host import files
from evolution.replay.viewer import viewer_binary

LOOPBACK = "127.0.0.1"
PARTS = ("re_viewer.js", "re_viewer_bg.wasm")
"""Names of the viewer's files."""

PATIENCE = 20.0
"""How long rerun may take to serve the viewer's files [s]."""


def write_page(folder: Path) -> None:
    """Write viewer and page into a folder that has a replay.rrd.

    Raises:
        UserError: if that is not possible.
    """
    here = Path(__file__).parent
    with files.writing():
        for name, content in _viewer().items():
            files.write_bytes(folder / name, content)
        files.write_bytes(folder / "index.html", (here / "page.html").read_bytes())
        files.write_bytes(folder / "page.js", (here / "page.js").read_bytes())


def server(folder: Path) -> http.server.ThreadingHTTPServer:
    """A server of the folder for this machine only, on a free port."""
    handler = functools.partial(_Quiet, directory=str(folder))
    return http.server.ThreadingHTTPServer((LOOPBACK, 0), handler)


class _Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, format: str, *args: object) -> None:
        """Print no requests, to keep the terminal clear."""


def _viewer() -> dict[str, bytes]:
    """The viewer's files by name."""
    ports = free_ports(2)
    process = subprocess.Popen(
        [
            *(viewer_binary(), "--serve-web", "--bind", LOOPBACK),
            *("--web-viewer-port", str(ports[0]), "--port", str(ports[1])),
        ],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        address = f"http://{LOOPBACK}:{ports[0]}"
        until = time.monotonic() + PATIENCE
        return {name: _fetched(f"{address}/{name}", until) for name in PARTS}
    finally:
        # it only serves files
        process.kill()
        process.wait()


def free_ports(n: int) -> list[int]:
    """Free ports of this machine."""
    sockets = [socket.create_server((LOOPBACK, 0)) for _ in range(n)]
    ports = [listener.getsockname()[1] for listener in sockets]
    for listener in sockets:
        listener.close()
    return ports


def _fetched(address: str, until: float) -> bytes:
    """Content of an address, as soon as a server answers there."""
    opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))
    while True:
        try:
            with opener.open(address, timeout=PATIENCE) as response:
                return response.read()
        except OSError as error:
            if time.monotonic() > until:
                raise UserError(f"cannot read rerun's viewer: {error}") from None
            time.sleep(0.05)
