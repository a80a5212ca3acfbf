"""Manual commands: start, run, hold, shadow, rezero, roll back; authorised by the token."""

import json
import shlex
from pathlib import Path
from typing import Annotated, Literal

from fastapi import APIRouter, HTTPException, Request
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from thermocomp.core.exceptions import InputError
from thermocomp.core.shown import escape, shorten
from thermocomp.core.strictjson import parse_json
from thermocomp.live.loop import Service
from thermocomp.live.page.answers import DoneAnswer, describe
from thermocomp.live.page.doors import Json
from thermocomp.live.page.pages import Board
from thermocomp.runtime.state import NO_ZERO, UNKNOWN, Status


class PageOrder(BaseModel):
    """Request body of a command."""

    model_config = ConfigDict(extra="forbid", strict=True)
    target: Annotated[str, Field(max_length=200)]
    do: Literal["start", "run", "hold", "shadow", "rezero", "roll back"]


#: the body is read by hand: its size and its encoding are checked first
_BODY = {"required": True, "content": {"application/json": {"schema": PageOrder.model_json_schema()}}}


#: names of the buttons of orders that are asked for
_BUTTONS = {"start": "Start", "rezero": "Re-zero"}
#: why there is no way to give an order
NO_TOKEN = " (orders need a page with a token: set token_file in [page])"


def explain_way(target: str, order: str, url: str, token_file: Path) -> str:
    """Return how a person gives an order: the button of the page, or a command."""
    body, header = (
        json.dumps({"target": target, "do": order}),
        f"Authorization: Bearer $(cat {shlex.quote(str(token_file))})",
    )
    command = f'curl -H "{header}" -d {shlex.quote(body)} {url}/api/order'
    return f". On the page: enter the token of {token_file}, press {_BUTTONS[order]} at {target}; or run: {command}"


def make_router(board: Board) -> APIRouter:
    """Return the router of ``/api/order``."""
    router, service = APIRouter(), board.service

    @router.post(
        "/api/order",
        dependencies=board.orders_only(),
        responses=describe(401, 403, 404, 409, 413, 422, 429, answer=DoneAnswer),
        openapi_extra={"requestBody": _BODY},
    )
    async def order(request: Request) -> Json:
        wanted = read_order(await request.body())
        if wanted.target not in service.compensator.lines:
            known = ", ".join(service.compensator.lines)
            raise HTTPException(404, f"no target is named {shorten(wanted.target, 80)}; there are {known}")
        try:
            why = give(service, wanted)
        except InputError as e:  # not possible now, for example before the first reading
            why = str(e)
        if why:
            raise HTTPException(409, why)
        return Json({"done": wanted.do, "target": wanted.target})

    return router


def read_order(body: bytes) -> PageOrder:
    """Return the command in the body of a request."""
    try:
        content = parse_json(body)
    except ValueError as e:
        raise HTTPException(400, f"body: expected JSON in UTF-8: {escape(e, 200)}") from e
    try:
        return PageOrder.model_validate(content)
    except ValidationError as e:
        found = (f"{'.'.join(map(str, p['loc'])) or 'body'}: {p['msg']}" for p in e.errors(include_url=False))
        raise HTTPException(422, escape("; ".join(found), 400)) from e


def give(service: Service, wanted: PageOrder) -> str:
    """Carry out a command; return the reason if impossible, else an empty string."""
    target, waiting = wanted.target, service.state.orders.get(wanted.target)
    if wanted.do == "start":
        return service.start_from_zero(target)
    if waiting is not None and (waiting.word in UNKNOWN or (waiting.word == NO_ZERO and wanted.do != "rezero")):
        return f"{waiting.word}: {waiting.reason}"
    if wanted.do == "rezero":
        service.rezero(target, "by hand, on the page")
    elif wanted.do == "roll back":
        return service.roll_back(target)
    elif wanted.do == "run":
        if refused := service.compensator.shadow.get(target):
            return f"the target must not run: {refused.reason}"
        service.order(target, None)
    else:
        service.order(target, Status("holding" if wanted.do == "hold" else "shadow", "by hand, on the page"))
    return ""
