"""meshcat's server, bound to one address: its own start listens on every address of the machine.

As a program, `python -m ngalpha_pin.viz.server ADDRESS`, it prints where it can be reached and serves until it ends.
"""

from __future__ import annotations

import atexit
import ipaddress
import subprocess
import sys
from functools import partial
from tempfile import TemporaryFile
from typing import Any

from ngalpha_pin.errors import NgalphaError, SceneError

LOCAL = "127.0.0.1"


def start_server(address: str = LOCAL) -> tuple[str, str]:
    """Start a server that ends with this process.

    Args:
        address: where browsers reach it; commands are taken from this machine alone.

    Returns:
        Where it takes commands, and the page that it serves.

    Raises:
        SceneError: that is no address of this machine. NgalphaError: the server does not start.
    """
    try:
        ipaddress.ip_address(address)
    except ValueError as error:
        raise SceneError(f"{address!r} is no IP address; 127.0.0.1 is this machine alone, 0.0.0.0 all of it") from error
    command = [sys.executable, "-m", __name__, address]
    with TemporaryFile("w+") as said:  # a pipe that nobody reads could fill up
        process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=said, text=True)
        atexit.register(process.kill)
        assert process.stdout is not None
        urls = process.stdout.readline().split()
        if len(urls) != 2:
            process.wait()
            said.seek(0)
            raise NgalphaError(
                f"the viewer cannot be served at {address}: {(said.read().strip() or '?').splitlines()[-1]}"
            )
    return urls[0], urls[1]


def what_is_open(page: str, address: str) -> str:
    """A sentence on who can see the page."""
    if ipaddress.ip_address(address).is_loopback:
        return f"the replay is at {page}, for this machine alone"
    return f"the replay is at {page}, open to everybody who can reach {address} of this machine, without a password"


def serve(address: str) -> None:
    """Serve until the process is ended."""
    from meshcat.servers.zmqserver import ZMQWebSocketBridge

    class Bridge(ZMQWebSocketBridge):  # type: ignore[misc]
        def make_app(self) -> Any:
            app = super().make_app()
            app.listen = partial(app.listen, address=address)
            return app

    bridge = Bridge()
    print(bridge.zmq_url, bridge.web_url.replace(bridge.host, LOCAL if address == "0.0.0.0" else address), flush=True)
    bridge.run()


if __name__ == "__main__":
    serve(sys.argv[1])
