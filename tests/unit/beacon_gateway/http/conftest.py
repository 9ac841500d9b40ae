"""Trees to ask about: written down, only heard, and both."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from tests.unit.beacon_gateway.conftest import Plant, PlantMaker

MANIFEST = """\
manifest_version: "1.0"
areas:
  - id: cell
    name: Cell
    namespace: /cell
    description: Where it is built
    tags: [west]
    subareas:
      - {id: gate, name: Gate}
  - {id: yard}
components:
  - id: ecu
    name: ECU
    type: controller
    area: cell
    namespace: /cell
    variant: B
    description: The front controller
    tags: [ip67]
    depends_on: [power, ghost_ecu]
    identity: {manufacturer: Acme}
  - {id: board, area: gate, parent_component_id: ecu, external: true}
  - {id: power}
apps:
  - id: planner
    name: Planner
    is_located_on: ecu
    depends_on: [camera, ghost, power]
    description: Plans
    tags: [core]
    translation_id: t.planner
  - {id: camera, is_located_on: board}
  - {id: floater, is_located_on: power}
functions:
  - id: drive
    name: Drive
    hosted_by: [planner, ecu]
    depends_on: [see]
    description: Moves
    translation_id: t.drive
  - {id: see, hosted_by: [camera]}
"""


@pytest.fixture
def manifest(tmp_path: Path) -> str:
    """The path of a manifest with every relation in it."""
    path = tmp_path / "manifest.yaml"
    path.write_text(MANIFEST)
    return str(path)


@pytest.fixture
def written(make_plant: PlantMaker, manifest: str) -> Plant:
    """Everything is written down, and nothing was heard."""
    return make_plant(manifest=manifest, default_component={"id": "here"})


@pytest.fixture
def heard(make_plant: PlantMaker) -> Plant:
    """Nothing is written down."""
    plant = make_plant(default_component={"id": "here"})
    plant.announce("lidar", display_name="Lidar", component_id="mast", depends_on=("camera",))
    plant.announce("camera", metadata={"lens": "wide"}, process_id=7, hostname="h")
    return plant


@pytest.fixture
def mixed(make_plant: PlantMaker, manifest: str) -> Plant:
    """Some are written down and heard, some only the one or the other."""
    plant = make_plant(manifest=manifest, default_component={"id": "here"})
    plant.announce("planner", hostname="h", process_id=7)
    plant.announce("ecu", metadata={"firmware": "1.2"})
    plant.announce("lidar", component_id="mast", function_ids=("see",), depends_on=("camera",))
    plant.announce("gone").close()
    plant.settle()
    return plant
