"""Certificates of two authorities, made by openssl."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import attrs
import pytest

from beacon_zenoh import TlsOptions

_NEW = "-newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -days 2"

_SCRIPT = f"""
for ca in ours theirs; do
  openssl req -x509 {_NEW} -subj "/CN=$ca" -keyout $ca.key -out $ca.pem
  for name in gateway robot; do
    openssl req -new -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -subj "/CN=$name" \
      -keyout $ca-$name.key -out $name.csr
    printf "subjectAltName=DNS:localhost,IP:127.0.0.1" > names
    openssl x509 -req -in $name.csr -CA $ca.pem -CAkey $ca.key -CAcreateserial -days 2 \
      -extfile names -out $ca-$name.pem
  done
done
"""


@attrs.frozen
class Papers:
    """A folder with ``ours.pem`` and ``theirs.pem``, and papers that each has signed."""

    folder: Path

    def of(self, name: str, *, signed: str = "ours", believes: str = "ours") -> TlsOptions:
        """A gateway's or a robot's."""
        return TlsOptions(
            ca=str(self.folder / f"{believes}.pem"),
            certificate=str(self.folder / f"{signed}-{name}.pem"),
            key=str(self.folder / f"{signed}-{name}.key"),
        )


@pytest.fixture(scope="session")
def papers(tmp_path_factory: pytest.TempPathFactory) -> Papers:
    """Papers of two authorities, ``ours`` and ``theirs``."""
    if shutil.which("openssl") is None:
        pytest.skip("needs the openssl command to make certificates")
    made = Papers(tmp_path_factory.mktemp("papers"))
    command = ["sh", "-ec", _SCRIPT]
    subprocess.run(command, cwd=made.folder, check=True, capture_output=True)
    return made
