"""What can be configured of the polling."""

from __future__ import annotations

import attrs

__all__ = ["RosParamOptions"]


@attrs.frozen
class RosParamOptions:
    """``adapter: ros_param`` in a configuration, of a source or of an announcer."""
