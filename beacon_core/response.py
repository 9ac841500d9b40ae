"""The body of the vendor endpoint: one entity's hint, in full."""

from __future__ import annotations

from beacon_core.stored import StoredHint

__all__ = ["build_response"]


def build_response(stored: StoredHint, now_ns: int) -> dict[str, object]:
    """The 14 keys clients rely on, each always present, fit for JSON.

    ``now_ns`` is the monotonic clock the hint's times are on. ``status`` is ``active`` or
    ``stale``; also ``left``, which a client of ros2_medkit has not met, for who said goodbye.
    """
    hint = stored.hint
    return {
        "entity_id": hint.entity_id,
        "status": stored.status.value,
        "age_sec": stored.age_ns(now_ns) / 1e9,
        "stable_id": hint.stable_id,
        "display_name": hint.display_name,
        "transport_type": hint.transport_type,
        "negotiated_format": hint.negotiated_format,
        "process_id": hint.process_id,
        "process_name": hint.process_name,
        "hostname": hint.hostname,
        "component_id": hint.component_id,
        "function_ids": list(hint.function_ids),
        "depends_on": list(hint.depends_on),
        "metadata": dict(hint.metadata),
    }
