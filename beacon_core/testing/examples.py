"""One honest hint, used wherever an example or a measurement needs one."""

from __future__ import annotations

from beacon_core.hint import BeaconHint

__all__ = ["BENCH_HINT", "bench_hint"]


def bench_hint(number: int) -> BeaconHint:
    """A hint of a fleet's usual size: 430 bytes of compact JSON, unlike any other ``number``'s."""
    return BeaconHint(
        entity_id=f"engine_temp_{number:06d}",
        stable_id=f"stable-engine-temp-{number:06d}",
        display_name=f"Engine temperature {number:06d}",
        function_ids=("thermal", "monitoring"),
        depends_on=("can_bridge", "power_unit"),
        component_id="ecu_front",
        transport_type="shared_memory",
        negotiated_format="sensor_msgs/Temperature",
        process_id=4242 + number,
        process_name="engine_temp_node",
        hostname=f"robot-{number // 100:04d}",
        metadata={"firmware": "1.2.3", "vendor": "acme"},
    )


BENCH_HINT = bench_hint(42)
"""The hint that every measurement is made with."""
