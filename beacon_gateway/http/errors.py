"""Error answers: the codes, texts and parameters that clients of ros2_medkit know.

Three validators answer for an id in a path, and clients' tests tell them apart: most routes name
the id in ``parameters``; lists of what belongs to an entity name its kind too; the vendor endpoints
have no parameters, and other texts.
"""

from __future__ import annotations

from collections.abc import Mapping

import attrs

from beacon_core.validator import is_valid_id
from beacon_gateway.tree.entities import Kind

__all__ = [
    "ApiError",
    "beacon_not_found",
    "check_id",
    "check_owner_id",
    "check_vendor_id",
    "entity_not_found",
    "internal_error",
    "invalid_parameter",
    "invalid_request",
    "no_such_resource",
    "owner_not_found",
    "resource_not_found",
    "unavailable",
    "vendor_entity_missing",
    "wrong_type",
]

_MAX_ID_CHARS = 256
_VENDOR_PREFIX = "x-medkit-"


@attrs.frozen
class ApiError(Exception):
    """An answer that is not the one asked for."""

    status: int
    code: str
    message: str
    parameters: Mapping[str, object] = attrs.field(factory=dict)

    def body(self) -> dict[str, object]:
        """The error as clients get it; ``parameters`` only if there are any."""
        body: dict[str, object] = {"error_code": self.code, "message": self.message}
        if self.code.startswith(_VENDOR_PREFIX):
            body["error_code"] = "vendor-error"
            body["vendor_code"] = self.code
        if self.parameters:
            body["parameters"] = dict(self.parameters)
        return body


def resource_not_found() -> ApiError:
    """An unknown path, or an unsupported method on a known one."""
    return ApiError(404, "resource-not-found", "Resource not found", {"status": 404})


def internal_error(error: Exception) -> ApiError:
    """A defect of the gateway."""
    details = f"{type(error).__name__}: {error}"
    return ApiError(500, "internal-error", "Internal server error", {"details": details})


def check_id(entity_id: str) -> None:
    """Raises ``ApiError`` for what can be no id, as the detail routes say it."""
    if not is_valid_id(entity_id):
        raise ApiError(
            400,
            "invalid-parameter",
            "Invalid entity ID",
            {"details": _id_fault(entity_id), "entity_id": entity_id},
        )


def entity_not_found(entity_id: str) -> ApiError:
    """Nothing is known under this id, as the detail routes say it."""
    return ApiError(404, "entity-not-found", "Entity not found", {"entity_id": entity_id})


def wrong_type(entity_id: str, expected: Kind, actual: Kind) -> ApiError:
    """The id stands for something else, as the detail routes say it."""
    return ApiError(
        400,
        "invalid-parameter",
        f"Invalid entity type for route: expected {expected.value}, got {actual.value}",
        {"entity_id": entity_id, "expected_type": expected.value, "actual_type": actual.value},
    )


def check_owner_id(entity_id: str, kind: Kind) -> None:
    """Raises ``ApiError`` for what can be no id, as lists of what belongs to an entity say it."""
    if not is_valid_id(entity_id):
        raise ApiError(
            400,
            "invalid-parameter",
            f"Invalid {kind.value.lower()} ID",
            {"details": _id_fault(entity_id), _id_key(kind): entity_id},
        )


def owner_not_found(entity_id: str, kind: Kind) -> ApiError:
    """There is none of this kind, as lists of what belongs to an entity say it."""
    return ApiError(404, "entity-not-found", f"{kind.value} not found", {_id_key(kind): entity_id})


def check_vendor_id(entity_id: str) -> None:
    """Raises ``ApiError`` for what can be no id, as the vendor endpoint says it."""
    if not is_valid_id(entity_id):
        raise ApiError(400, "invalid-parameter", _id_fault(entity_id))


def vendor_entity_missing(entity_id: str, expected: Kind, actual: Kind | None) -> ApiError:
    """The id is unknown or stands for something else, as the vendor endpoint says it."""
    if actual is None:
        return ApiError(404, "entity-not-found", f"{expected.value} not found: {entity_id}")
    return ApiError(
        400,
        "invalid-parameter",
        f"Entity '{entity_id}' is a {actual.value}, not a {expected.value}",
    )


def beacon_not_found(parameters: Mapping[str, object] | None = None) -> ApiError:
    """The entity is there, its beacon is not (any more)."""
    return ApiError(404, "x-medkit-beacon-not-found", "No beacon data for entity", parameters or {})


def invalid_parameter(message: str, **parameters: object) -> ApiError:
    """Something that is given cannot be."""
    return ApiError(400, "invalid-parameter", message, parameters)


def invalid_request(message: str, **parameters: object) -> ApiError:
    """The body of a request cannot be understood."""
    return ApiError(400, "invalid-request", message, parameters)


def no_such_resource(message: str, **parameters: object) -> ApiError:
    """The entity is there, what is asked of it is not."""
    return ApiError(404, "resource-not-found", message, parameters)


def unavailable(message: str, **parameters: object) -> ApiError:
    """As many as can be served are served already."""
    return ApiError(503, "service-unavailable", message, parameters)


def _id_key(kind: Kind) -> str:
    return f"{kind.value.lower()}_id"


def _id_fault(entity_id: str) -> str:
    """What is wrong with an id, in the words of ros2_medkit."""
    if len(entity_id.encode(errors="replace")) > _MAX_ID_CHARS:
        return f"Entity ID too long (max {_MAX_ID_CHARS} characters)"
    # Bytes, as there: of a character that takes several the first one is shown.
    bad = next(byte for byte in entity_id.encode(errors="replace") if not is_valid_id(chr(byte)))
    char = chr(bad) if 0x20 <= bad < 0x7F else f"0x{bad:02x}"
    return (
        f"Entity ID contains invalid character: '{char}'. "
        "Only alphanumeric, underscore and hyphen are allowed"
    )
