"""Requests that are refused, each with a status and a sentence; and the JSON that is accepted."""

from __future__ import annotations

import json
from typing import Any

from starlette.requests import Request

#: Longest body of a request.
MOST_BYTES = 1_000_000


class RefusedRequest(Exception):
    """A request that is not carried out; `sentence` tells the person why."""

    def __init__(self, status: int, sentence: str):
        self.status, self.sentence = status, sentence
        super().__init__(sentence)


async def read_object(request: Request) -> dict[str, Any]:
    """The JSON object of a request's body.

    Raises:
        RefusedRequest: 413, 415 or 400, with a sentence.
    """
    kind = request.headers.get("content-type", "").split(";")[0].strip().lower()
    if kind != "application/json":
        raise RefusedRequest(415, f"The request is of type {kind!r}; expected application/json.")
    declared = request.headers.get("content-length", "0")
    if not declared.isdigit() or int(declared) > MOST_BYTES:
        raise RefusedRequest(
            413, f"The request says it has {declared:.20} bytes; at most 1 MB is read."
        )
    body = bytearray()
    async for part in request.stream():
        body += part
        if len(body) > MOST_BYTES:
            raise RefusedRequest(413, "The request is longer than 1 MB; nothing was changed.")
    return parse_object(bytes(body))


def parse_object(body: bytes) -> dict[str, Any]:
    """A JSON object of finite numbers. Raises RefusedRequest (400)."""
    try:
        content = json.loads(body.decode("utf-8"), parse_constant=_no_constant)
    except (ValueError, RecursionError) as error:
        raise RefusedRequest(400, f"The request is not JSON: {error}.") from None
    if not isinstance(content, dict):
        raise RefusedRequest(400, "The request is not a JSON object.")
    return content


def field(content: dict[str, Any], name: str, kind: type, what: str) -> Any:
    """A field of a request, of a type. Raises RefusedRequest (400)."""
    value = content.get(name)
    if not isinstance(value, kind) or (kind is not bool and isinstance(value, bool)):
        raise RefusedRequest(400, f"The request's {name!r} is {value!r:.40}; expected {what}.")
    return value


def _no_constant(name: str) -> None:
    raise ValueError(f"the number {name} is not finite")
