"""Open the page on which an artist draws the lips of a take.

python -m vermilion.app.sketch config/yours.yaml subject/take
"""

from __future__ import annotations

import argparse
import os
import socket
import sys
import threading
import webbrowser

import uvicorn

from vermilion.app.sketch.desk import Desk
from vermilion.app.sketch.security import Gate
from vermilion.app.sketch.server import application
from vermilion.app.sketch.take_files import TakeFiles
from vermilion.storage.errors import VermilionError

HOST = "127.0.0.1"


def arguments() -> argparse.ArgumentParser:
    """What the command takes."""
    parser = argparse.ArgumentParser(
        prog="python -m vermilion.app.sketch", description="Draw the lips of a take in a browser."
    )
    parser.add_argument("configuration", help="a configuration whose guided.takes names the take")
    parser.add_argument("take", help="subject/take")
    parser.add_argument("--port", type=int, default=0, help="of the server; 0: any that is free")
    parser.add_argument("--cores", default="", help="of a propagation; the profile's by default")
    parser.add_argument("--no-browser", action="store_true", help="only print the address")
    return parser


def has_display() -> bool:
    """Whether a browser window can be opened."""
    return sys.platform in ("darwin", "win32") or any(
        os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY")
    )


def main(words: list[str] | None = None) -> int:
    """Serve the page until it is interrupted; 1 with a sentence where the take cannot be shown."""
    options = arguments().parse_args(words)
    try:
        files = TakeFiles.of(options.configuration, options.take)
        desk = Desk(files, ["--cores", options.cores] if options.cores else [])
    except VermilionError as error:
        print(error, file=sys.stderr)
        return 1
    with socket.socket() as listener:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            listener.bind((HOST, options.port))
            # From here on a browser may come: it waits until the server answers.
            listener.listen()
        except OSError as error:
            print(f"Port {options.port} cannot be used ({error}); say --port 0.", file=sys.stderr)
            return 1
        port = listener.getsockname()[1]
        gate = Gate(application(desk), port)
        address = f"http://{HOST}:{port}/?token={gate.token}"
        print(f"{files.take.name}: {address}\nCtrl-C ends the server.", flush=True)
        # The first solve should not wait for the factorisation.
        threading.Thread(target=desk.solver.prepare, daemon=True).start()
        if has_display() and not options.no_browser:
            webbrowser.open(address)
        settings = uvicorn.Config(
            gate, log_level="warning", access_log=False, server_header=False, ws="none"
        )
        uvicorn.Server(settings).run(sockets=[listener])
    return 0


if __name__ == "__main__":
    sys.exit(main())
