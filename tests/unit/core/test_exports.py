"""What a module offers: `__all__` is all of it, it is there, and each of it is explained."""

from __future__ import annotations

import ast
import importlib
import importlib.util
import pkgutil
from collections.abc import Iterator
from pathlib import Path

import pytest

PACKAGES = ["beacon_core", "beacon_gateway", "beacon_fake", "beacon_zenoh"]


def modules(package: str) -> Iterator[str]:
    spec = importlib.util.find_spec(package)
    assert spec is not None
    yield package
    for found in pkgutil.walk_packages(spec.submodule_search_locations, f"{package}."):
        # Importing a __main__ runs it.
        if not found.name.endswith(".__main__"):
            yield found.name


MODULES = [module for package in PACKAGES for module in modules(package)]
every_module = pytest.mark.parametrize("name", MODULES)


@every_module
def test_all_is_what_the_module_defines_in_public(name: str) -> None:
    exported, defined = set(exports(name)), {one for one, _ in public(tree(name))}
    if is_package(name):
        # A package collects from its modules, so it may export more than it defines.
        assert exported >= defined
    else:
        assert exported == defined


@every_module
def test_all_is_there(name: str) -> None:
    module = importlib.import_module(name)
    assert [one for one in exports(name) if not hasattr(module, one)] == []


@every_module
def test_every_exported_name_is_explained_where_it_is_defined(name: str) -> None:
    exported = exports(name)
    assert [one for one, explained in public(tree(name)) if one in exported and not explained] == []


@every_module
def test_every_module_says_what_it_is_for(name: str) -> None:
    module = tree(name)
    assert not module.body or ast.get_docstring(module)


def exports(name: str) -> list[str]:
    found: list[str] = getattr(importlib.import_module(name), "__all__", [])
    return found


def tree(name: str) -> ast.Module:
    return ast.parse(path(name).read_text(encoding="utf-8"))


def is_package(name: str) -> bool:
    return path(name).name == "__init__.py"


def path(name: str) -> Path:
    spec = importlib.util.find_spec(name)
    assert spec is not None
    assert spec.origin is not None
    return Path(spec.origin)


def public(module: ast.Module) -> Iterator[tuple[str, bool]]:
    """Each public name defined at the top of a module, and whether a docstring goes with it."""
    for index, node in enumerate(module.body):
        following = module.body[index + 1] if index + 1 < len(module.body) else None
        match node:
            case (
                ast.FunctionDef(name=name)
                | ast.AsyncFunctionDef(name=name)
                | ast.ClassDef(name=name)
            ):
                names, explained = [name], ast.get_docstring(node) is not None
            case ast.Assign(targets=targets):
                names = [
                    part.id
                    for target in targets
                    for part in ast.walk(target)
                    if isinstance(part, ast.Name) and isinstance(part.ctx, ast.Store)
                ]
                explained = is_string(following)
            case ast.AnnAssign(target=ast.Name(id=name)):
                names, explained = [name], is_string(following)
            case _:
                continue
        yield from ((name, explained) for name in names if not name.startswith("_"))


def is_string(node: ast.stmt | None) -> bool:
    return (
        isinstance(node, ast.Expr)
        and isinstance(node.value, ast.Constant)
        and isinstance(node.value.value, str)
    )
