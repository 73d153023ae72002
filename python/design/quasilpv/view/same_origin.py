"""Only pages of this machine may talk to the view.

A server on the loopback interface is within reach of every page that a browser on the same machine shows. Such a page
gives itself away: requests carry the name under which the server was addressed (``Host``), and those of a page of
another origin that origin (``Origin``). Names other than those of the loopback interface are those of a page whose
domain was made to point here (DNS rebinding).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http import HTTPStatus
from typing import Any, TypeAlias

import websockets.asyncio.server
from websockets.asyncio.server import ServerConnection
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

_HOST = re.compile(r"(127\.0\.0\.1|localhost|\[::1\])(:[0-9]{1,5})?", re.IGNORECASE)

Answer: TypeAlias = Callable[[ServerConnection, Request], Response | None]


def refusal(headers: Headers) -> str | None:
    """Why a request is not one of a page of this machine; None if it may be.

    Args:
        headers: of the request. Programs that are no browsers state no origin; they may.
    """
    hosts, origins = headers.get_all("Host"), headers.get_all("Origin")
    if len(hosts) != 1 or not _HOST.fullmatch(hosts[0]):
        return "Host is not this machine"
    if origins and [origin.lower() for origin in origins] != [f"http://{hosts[0].lower()}"]:
        return "Origin is another page"
    return None


@contextmanager
def same_origin_only() -> Iterator[None]:
    """Servers of websockets that are made inside refuse every other request, those that open a websocket too."""
    plain: Any = websockets.asyncio.server.serve

    def guarded(*arguments: Any, process_request: Answer | None = None, **options: Any) -> Any:
        def answer(connection: ServerConnection, request: Request) -> Response | None:
            reason = refusal(request.headers)
            if reason is not None:
                return connection.respond(HTTPStatus.FORBIDDEN, f"{reason}\n")
            return None if process_request is None else process_request(connection, request)

        return plain(*arguments, process_request=answer, **options)

    websockets.asyncio.server.serve = guarded  # type: ignore[assignment, misc]
    try:
        yield
    finally:
        websockets.asyncio.server.serve = plain  # type: ignore[misc]
