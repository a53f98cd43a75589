"""The server of the page: each address, and what it answers."""

from __future__ import annotations

from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import numpy as np
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

from vermilion.app.sketch.desk import Desk
from vermilion.app.sketch.refusal import RefusedRequest, field, read_object
from vermilion.storage.errors import VermilionError

STATIC = Path(__file__).parent / "static"
_TYPES = {
    ".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".txt": "text/plain",
    ".svg": "image/svg+xml",
}  # fmt: skip
_BYTES = "application/octet-stream"

Answer = Callable[[Request], Awaitable[Response]]


def application(desk: Desk) -> Starlette:
    """The page's addresses, without the gate in front of them."""
    pages = _Pages(desk)
    routes = [
        Route("/", pages.static),
        Route("/static/{name:path}", pages.static),
        Route("/api/take", pages.take),
        Route("/api/topology", pages.topology),
        Route("/api/status", pages.status),
        Route("/api/image/{camera}/{frame:int}", pages.image),
        Route("/api/mesh/{layer}/{camera}/{frame:int}", pages.mesh),
        Route("/api/curve/{name}/{camera}/{frame:int}", pages.curve),
        Route("/api/sketch/{camera}/{frame:int}", pages.sketch),
        Route("/api/sketch/{camera}/{frame:int}", pages.save, methods=["PUT"]),
        Route("/api/magnet/{camera}/{frame:int}", pages.magnet, methods=["POST"]),
        Route("/api/solve/{frame:int}", pages.solve, methods=["POST"]),
        Route("/api/jobs", pages.jobs, methods=["POST"]),
        Route("/api/propagate", pages.propagate, methods=["POST"]),
        Route("/api/cancel", pages.cancel, methods=["POST"]),
        Route("/api/log", pages.log),
    ]

    @asynccontextmanager
    async def lifespan(_: Starlette) -> AsyncIterator[None]:
        yield
        desk.run.close()

    problems: dict[Any, Any] = {
        RefusedRequest: _refused, VermilionError: _failed, HTTPException: _unknown,
        Exception: _broken,
    }  # fmt: skip
    return Starlette(routes=routes, exception_handlers=problems, lifespan=lifespan)


class _Pages:
    """Answers; what takes time runs in a thread."""

    def __init__(self, desk: Desk):
        self._desk = desk
        # Names that may be asked for: nothing else is read, whatever a path says.
        self._static = {
            str(path.relative_to(STATIC)): path for path in STATIC.rglob("*") if path.is_file()
        }

    async def static(self, request: Request) -> Response:
        name = request.path_params.get("name", "index.html")
        path = self._static.get(name)
        if path is None or path.suffix not in _TYPES:
            raise RefusedRequest(404, f"The page has no file {name:.60}.")
        return Response(path.read_bytes(), media_type=_TYPES[path.suffix])

    async def take(self, _: Request) -> Response:
        return JSONResponse(self._desk.description())

    async def topology(self, _: Request) -> Response:
        return Response(await run_in_threadpool(self._desk.views.topology), media_type=_BYTES)

    async def status(self, _: Request) -> Response:
        found = await run_in_threadpool(self._desk.status.report)
        return JSONResponse({**found, "run": self._desk.run.report()})

    async def image(self, request: Request) -> Response:
        data = await run_in_threadpool(self._desk.data.jpeg, *_place(request))
        return Response(data, media_type="image/jpeg")

    async def mesh(self, request: Request) -> Response:
        layer = request.path_params["layer"]
        data = await run_in_threadpool(self._desk.mesh, layer, *_place(request))
        return Response(data, media_type=_BYTES)

    async def curve(self, request: Request) -> Response:
        name = request.path_params["name"]
        points = await run_in_threadpool(self._desk.curve, name, *_place(request))
        return JSONResponse({"points": np.round(points, 3).tolist()})

    async def sketch(self, request: Request) -> Response:
        return JSONResponse(await run_in_threadpool(self._desk.sketch, *_place(request)))

    async def save(self, request: Request) -> Response:
        content = await read_object(request)
        revision = field(content, "revision", str, "the revision that the page saw")
        if "sketch" not in content:
            raise RefusedRequest(400, "The request has no sketch; null removes it.")
        place = _place(request)
        new = await run_in_threadpool(self._desk.store.write, *place, content["sketch"], revision)
        return JSONResponse({"revision": new})

    async def magnet(self, request: Request) -> Response:
        content = await read_object(request)
        points = await run_in_threadpool(self._desk.snapped, *_place(request), content)
        return JSONResponse({"points": np.round(points, 3).tolist()})

    async def solve(self, request: Request) -> Response:
        await read_object(request)
        frame = request.path_params["frame"]
        return JSONResponse(await run_in_threadpool(self._desk.solver.solve, frame))

    async def jobs(self, request: Request) -> Response:
        await read_object(request)
        return JSONResponse({"jobs": await run_in_threadpool(self._desk.jobs)})

    async def propagate(self, request: Request) -> Response:
        await read_object(request)
        self._desk.need_sketches()
        self._desk.run.start()
        return JSONResponse(self._desk.run.report())

    async def cancel(self, request: Request) -> Response:
        await read_object(request)
        self._desk.run.cancel()
        return JSONResponse(self._desk.run.report())

    async def log(self, _: Request) -> Response:
        return JSONResponse({"log": await run_in_threadpool(self._desk.run.log)})


def _place(request: Request) -> tuple[str, int]:
    return request.path_params["camera"], request.path_params["frame"]


async def _refused(_: Request, error: Exception) -> Response:
    assert isinstance(error, RefusedRequest)
    return JSONResponse({"error": error.sentence}, error.status)


async def _failed(_: Request, error: Exception) -> Response:
    return JSONResponse({"error": str(error)}, 422)


async def _unknown(request: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException)
    sentence = f"The page has no address {request.url.path:.80} for {request.method}."
    return JSONResponse({"error": sentence}, error.status_code)


async def _broken(_: Request, error: Exception) -> Response:
    sentence = f"The server failed ({type(error).__name__}: {error}); the terminal says more."
    return JSONResponse({"error": sentence[:600]}, 500)
