"""``beacon token``: a new secret for somebody, and what the gateway keeps of it."""

from __future__ import annotations

import argparse
import re
import sys

from beacon_gateway.access.api_tokens import ApiToken, Identity
from beacon_gateway.access.roles import Role
from beacon_gateway.access.secrets import hash_secret, hash_token, new_token
from beacon_gateway.console.exits import Exit
from beacon_gateway.console.terminal import write_json

__all__ = ["parser", "run"]


def parser() -> argparse.ArgumentParser:
    """The command's arguments."""
    made = argparse.ArgumentParser(
        description="Make an API token and its line for the tokens file; or, with --client, a "
        "secret and its entry for http.auth.clients. Neither can be shown again."
    )
    made.add_argument("name", type=_name, metavar="NAME", help="whose it is")
    made.add_argument("--role", choices=list(Role), default=Role.VIEWER, help="default: viewer")
    made.add_argument("--client", action="store_true", help="a client's secret instead")
    made.add_argument("--json", action="store_true", help="print one JSON document instead")
    return made


def run(arguments: argparse.Namespace) -> int:
    """Returns the exit code."""
    owner, secret = Identity(arguments.name, Role(arguments.role)), new_token()
    made = {"name": owner.name, "role": owner.role.value}
    if arguments.client:
        made |= {"secret": secret, "secret_hash": hash_secret(secret)}
        entry = f'{{id: {owner.name}, role: {owner.role}, secret_hash: "{made["secret_hash"]}"}}'
    else:
        entry = ApiToken(owner, hash_token(secret).encode()).line()
        made |= {"token": secret, "line": entry}
    if arguments.json:
        write_json(made)
        return Exit.OK
    what, where = ("secret", "http.auth.clients") if arguments.client else ("token", "tokens file")
    sys.stdout.write(f"{what}: {secret}\nfor the {where}: {entry}\n")
    return Exit.OK


def _name(text: str) -> str:
    if re.fullmatch(r"[A-Za-z0-9_.-]{1,64}", text):
        return text
    raise argparse.ArgumentTypeError(f"{text!r} is no name: 1 to 64 of A-Z a-z 0-9 _ . -")
