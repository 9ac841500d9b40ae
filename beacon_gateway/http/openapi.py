"""The OpenAPI document: what is served, told from the same values that serve it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from beacon_gateway.http.models.server import GenericError
from beacon_gateway.http.operations import Operation
from beacon_gateway.http.schemas import Schemas

__all__ = ["SOVD_VERSION", "document", "scoped"]

SOVD_VERSION = "1.0.0"
"""Of the standard whose paths and collections these are."""

_AT_ROOT = (
    "/metrics, /livez and /readyz are served at the server's root too, where monitoring and "
    "supervisors look for them."
)
"""Told in words, because generated clients look for every path below the first server's address."""

_JSON = "application/json"
_ALWAYS = (400, 401, 403, 404, 408, 413, 429, 431, 500)
"""401 and 403 only where tokens are asked for, 429 only where there are limits; 408 and 413 of a
body, and 431 of a head, whatever the operation."""


def document(
    operations: Iterable[Operation], *, title: str, version: str, url: str
) -> dict[str, Any]:
    """OpenAPI 3.1 for these operations, whose paths begin with ``url``."""
    schemas = Schemas()
    error = schemas.reference(GenericError)
    paths: dict[str, dict[str, Any]] = {}
    for operation in operations:
        item = paths.setdefault(operation.path, {})
        item[operation.method.lower()] = _operation(operation, schemas)
    return {
        "openapi": "3.1.0",
        "info": {
            "title": title,
            "version": version,
            "description": _AT_ROOT,
            "x-sovd-version": SOVD_VERSION,
        },
        "servers": [{"url": url}],
        "tags": [{"name": tag} for tag in _tags(paths)],
        "paths": paths,
        "components": {
            "schemas": dict(sorted(schemas.by_name.items())),
            "responses": {
                "GenericError": {
                    "description": "Refused, with the reason",
                    "content": {_JSON: {"schema": error}},
                }
            },
        },
    }


def scoped(whole: Mapping[str, Any], path: str) -> dict[str, Any] | None:
    """The part of the document at and below a path; ``None`` if nothing is served there.

    What the path fills in is no parameter any more.
    """
    wanted = [segment for segment in path.split("/") if segment]
    paths = {
        "/" + "/".join(wanted + segments[len(wanted) :]): _filled(item, segments[: len(wanted)])
        for template, item in whole["paths"].items()
        if _begins(segments := template.strip("/").split("/"), wanted)
    }
    return {**whole, "paths": paths} if paths else None


def _operation(operation: Operation, schemas: Schemas) -> dict[str, Any]:
    made: dict[str, Any] = {
        "operationId": operation.id,
        "tags": [operation.tag],
        "summary": operation.summary,
        "parameters": _parameters(operation),
        "responses": _responses(operation, schemas),
    }
    if operation.request is not None:
        content = {_JSON: {"schema": schemas.reference(operation.request)}}
        made["requestBody"] = {"required": True, "content": content}
    return made


def _parameters(operation: Operation) -> list[dict[str, Any]]:
    asked: list[dict[str, Any]] = []
    for one in operation.parameters:
        schema: dict[str, Any] = {"type": "string"}
        if set(one.choices) == {"true", "false"}:
            schema = {"type": "boolean"}
        elif one.choices:
            schema["enum"] = list(one.choices)
        asked.append({"name": one.name, "in": "query", "required": False, "schema": schema})
    return asked + [
        {"name": slot, "in": "path", "required": True, "schema": {"type": "string"}}
        for slot in operation.slots
    ]


def _responses(operation: Operation, schemas: Schemas) -> dict[str, Any]:
    good: dict[str, Any] = {"description": operation.summary}
    if operation.body is not None:
        good["content"] = {_JSON: {"schema": schemas.reference(operation.body)}}
    elif operation.media:
        good["content"] = {media: {"schema": {"type": "string"}} for media in operation.media}
    refused = {"$ref": "#/components/responses/GenericError"}
    bad: dict[int, dict[str, Any]] = dict.fromkeys([*_ALWAYS, *operation.refusals], refused)
    for status, body in operation.errors.items():
        content = {_JSON: {"schema": schemas.reference(body)}}
        bad[status] = {"description": "Refused, with the reason", "content": content}
    return {str(operation.status): good, **{str(status): bad[status] for status in sorted(bad)}}


def _tags(paths: Mapping[str, Mapping[str, Any]]) -> list[str]:
    used = (tag for item in paths.values() for one in item.values() for tag in one["tags"])
    return list(dict.fromkeys(used))


def _begins(template: list[str], wanted: list[str]) -> bool:
    return len(template) >= len(wanted) and all(
        ours == theirs or ours.startswith("{")
        for ours, theirs in zip(template, wanted, strict=False)
    )


def _filled(item: Mapping[str, Any], segments: Iterable[str]) -> dict[str, Any]:
    filled = {segment.strip("{}") for segment in segments if segment.startswith("{")}
    return {
        method: {
            **operation,
            "parameters": [one for one in operation["parameters"] if one["name"] not in filled],
        }
        for method, operation in item.items()
    }
