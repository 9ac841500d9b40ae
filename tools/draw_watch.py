"""Draw what ``beacon watch`` shows of a running gateway, for docs/images/watch.svg.

beacon demo & python tools/draw_watch.py http://127.0.0.1:8080 docs/images/watch.svg
"""

from __future__ import annotations

import io
import re
import sys
from pathlib import Path

from rich.console import Console
from rich.terminal_theme import MONOKAI

from beacon_gateway.console.client import GatewayClient
from beacon_gateway.console.table import by_attention, entity_table, summary

WIDTH = 118


def main(url: str, path: str) -> None:
    """Write the picture of the gateway at ``url`` to ``path``."""
    with GatewayClient(url) as client:
        items = by_attention(client.entities())
    console = Console(record=True, width=WIDTH, file=io.StringIO(), force_terminal=True)
    console.print(f"[bold]{url}")
    console.print(summary(items))
    console.print()
    console.print(entity_table(items, width=WIDTH))
    drawn = console.export_svg(title="beacon watch", theme=MONOKAI)
    # A picture asks nobody for fonts.
    drawn = re.sub(r"@font-face \{.*?\}\s*|<!-- Generated.*?-->\s*", "", drawn, flags=re.DOTALL)
    drawn = drawn.replace("Fira Code", "DejaVu Sans Mono")
    Path(path).parent.mkdir(parents=True, exist_ok=True)
    Path(path).write_text(drawn)


if __name__ == "__main__":
    main(*sys.argv[1:3])
