"""Access to the whole application: who may ask what, from where, and how much."""

from __future__ import annotations

import asyncio
import base64
import re
import threading
import time
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import attrs
import httpx
import jwt
import pytest
from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric import rsa
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import HTMLResponse, PlainTextResponse
from starlette.routing import Mount, Route
from starlette.types import Message, Receive, Scope, Send

from beacon_core.errors import ConfigError
from beacon_gateway.access import middleware
from beacon_gateway.access.access import Access
from beacon_gateway.access.api_tokens import ApiToken, Identity
from beacon_gateway.access.asked import network_of
from beacon_gateway.access.middleware import AccessControl
from beacon_gateway.access.roles import Role, may
from beacon_gateway.access.secrets import (
    hash_secret,
    hash_token,
    is_secret_hash,
    new_token,
    secret_matches,
)
from beacon_gateway.config import HttpConfig, parse_config
from beacon_gateway.http import create_app

if TYPE_CHECKING:
    from tests.unit.beacon_gateway.conftest import Contract, Plant, PlantMaker

APPS = "/api/v1/apps"
SECRET = "s3cret"  # noqa: S105 - of a client in a test
SECRET_HASH = hash_secret(SECRET)
KEY = b"0123456789abcdef0123456789abcdef"


@attrs.frozen
class Doorman:
    """A gateway's application, asked with whatever headers."""

    plant: Plant
    app: Starlette

    def ask(self, path: str = APPS, method: str = "GET", **more: Any) -> httpx.Response:
        async def send() -> httpx.Response:
            transport = httpx.ASGITransport(self.app, raise_app_exceptions=False)
            async with httpx.AsyncClient(transport=transport, base_url="http://gateway") as client:
                return await client.request(method, path, **more)

        return asyncio.run(send())

    def bearer(self, token: str, path: str = APPS, method: str = "GET") -> httpx.Response:
        return self.ask(path, method, headers={"authorization": f"Bearer {token}"})

    def authorize(self, **given: str) -> httpx.Response:
        form = {"grant_type": "client_credentials", "client_id": "hmi", "client_secret": SECRET}
        return self.ask("/api/v1/auth/authorize", "POST", data={**form, **given})


@pytest.fixture
def doorman(make_plant: PlantMaker) -> Callable[..., Doorman]:
    def make(**http: Any) -> Doorman:
        plant = make_plant(http=http)
        return Doorman(plant, create_app(plant.gateway))

    return make


@pytest.fixture
def tokens(tmp_path: Path) -> tuple[Path, dict[Role, str]]:
    """A tokens file with one token per role."""
    given = {role: new_token() for role in Role}
    path = tmp_path / "tokens.txt"
    lines = [
        ApiToken(Identity(f"the-{role}", role), hash_token(token).encode()).line()
        for role, token in given.items()
    ]
    path.write_text("# who may\n\n" + "\n".join(lines) + "  # the last\n")
    return path, given


@pytest.fixture
def key_file(tmp_path: Path) -> Path:
    path = tmp_path / "jwt.secret"
    path.write_bytes(KEY + b"\n")
    return path


def clients(role: str = "viewer") -> list[dict[str, str]]:
    return [{"id": "hmi", "role": role, "secret_hash": SECRET_HASH}]


# what every answer has


def test_without_configuration_everybody_may_read_and_no_answer_has_cors_or_limits(
    doorman: Callable[..., Doorman],
) -> None:
    answer = doorman().ask(headers={"origin": "https://elsewhere.example"})
    assert answer.status_code == 200
    assert answer.headers["x-content-type-options"] == "nosniff"
    assert not [name for name in answer.headers if "access-control" in name or "rate" in name]


def test_what_is_html_may_load_nothing_from_elsewhere_and_run_nothing_inline() -> None:
    def page(_: Request) -> HTMLResponse:
        return HTMLResponse("<h1>hello</h1>")

    def own(_: Request) -> HTMLResponse:
        return HTMLResponse("", headers={"content-security-policy": "default-src 'none'"})

    async def get(path: str) -> httpx.Response:
        inner = Starlette(routes=[Route("/", page), Route("/own", own)])
        app = AccessControl(inner, Access(HttpConfig()))
        async with httpx.AsyncClient(
            transport=httpx.ASGITransport(app), base_url="http://gateway"
        ) as client:
            return await client.get(path)

    headers = asyncio.run(get("/")).headers
    policy = headers["content-security-policy"]
    assert "default-src 'none'" in policy
    assert "unsafe" not in policy
    assert "frame-ancestors 'none'" in policy
    assert headers["x-frame-options"] == "DENY"
    assert asyncio.run(get("/own")).headers.get_list("content-security-policy") == [
        "default-src 'none'"
    ]


def test_what_is_no_http_passes() -> None:
    seen: list[str] = []

    async def app(scope: Scope, _: Receive, __: Send) -> None:
        seen.append(scope["type"])

    async def nothing(*_: Message) -> Any:
        return None

    asyncio.run(AccessControl(app, Access(HttpConfig()))({"type": "lifespan"}, nothing, nothing))
    assert seen == ["lifespan"]


# CORS


ORIGIN = "https://hmi.example:8443"


def test_an_allowed_origin_is_echoed_and_told_what_it_may(
    doorman: Callable[..., Doorman],
) -> None:
    door = doorman(cors={"allowed_origins": [ORIGIN]})
    headers = door.ask(headers={"origin": ORIGIN}).headers
    assert headers["access-control-allow-origin"] == ORIGIN
    assert headers["access-control-allow-methods"] == "GET, PUT, POST, DELETE, OPTIONS"
    assert headers["access-control-allow-headers"] == "Content-Type, Accept, Authorization"
    assert headers["access-control-expose-headers"] == (
        "Content-Disposition, Content-Length, X-RateLimit-Limit, X-RateLimit-Remaining, "
        "X-RateLimit-Reset, Retry-After"
    )
    assert "access-control-allow-credentials" not in headers
    assert headers["vary"] == "Origin"


@pytest.mark.parametrize("origin", ["https://evil.example", "", ORIGIN.upper(), f"{ORIGIN}/"])
def test_another_origin_is_answered_without_cors(
    doorman: Callable[..., Doorman], origin: str
) -> None:
    door = doorman(cors={"allowed_origins": [ORIGIN]})
    answer = door.ask(headers={"origin": origin})
    assert answer.status_code == 200
    assert not [name for name in answer.headers if name.startswith("access-control")]
    preflight = door.ask(method="OPTIONS", headers={"origin": origin})
    assert preflight.status_code == 403
    assert not [name for name in preflight.headers if name.startswith("access-control")]


def test_a_preflight_of_an_allowed_origin_is_204_also_where_a_token_is_needed(
    doorman: Callable[..., Doorman],
) -> None:
    door = doorman(cors={"allowed_origins": ["*"], "max_age_s": 60}, auth={})
    answer = door.ask(method="OPTIONS", headers={"origin": ORIGIN})
    assert (answer.status_code, answer.content) == (204, b"")
    assert answer.headers["access-control-max-age"] == "60"
    assert answer.headers["access-control-allow-origin"] == ORIGIN
    refused = door.ask(headers={"origin": ORIGIN})
    assert refused.status_code == 401
    assert refused.headers["access-control-allow-origin"] == ORIGIN


def test_without_cors_a_preflight_is_an_unknown_method(doorman: Callable[..., Doorman]) -> None:
    assert doorman().ask(method="OPTIONS", headers={"origin": ORIGIN}).status_code == 404


def test_credentials_are_for_named_origins_only(doorman: Callable[..., Doorman]) -> None:
    door = doorman(cors={"allowed_origins": [ORIGIN], "allow_credentials": True})
    answer = door.ask(headers={"origin": ORIGIN})
    assert answer.headers["access-control-allow-credentials"] == "true"
    with pytest.raises(ConfigError, match=r"^\$.http.cors.allow_credentials: not together with"):
        parse_config({"http": {"cors": {"allowed_origins": ["*"], "allow_credentials": True}}})


# API tokens and roles


def test_without_a_token_nothing_is_told_but_that_one_is_needed(
    doorman: Callable[..., Doorman], tokens: tuple[Path, dict[Role, str]]
) -> None:
    door = doorman(auth={"tokens_file": str(tokens[0])})
    for path in (APPS, "/api/v1/health", "/metrics", "/nowhere"):
        answer = door.ask(path)
        assert answer.status_code == 401
        assert answer.json() == {"error_code": "unauthorized", "message": "Token required"}
        assert answer.headers["www-authenticate"] == (
            'Bearer realm="beacon", error="invalid_token"'
        )


def test_what_was_just_answered_to_one_is_not_given_to_who_may_not_have_it(
    doorman: Callable[..., Doorman], tokens: tuple[Path, dict[Role, str]]
) -> None:
    door = doorman(auth={"tokens_file": str(tokens[0])})
    assert door.bearer(tokens[1][Role.VIEWER]).status_code == 200
    assert door.bearer(tokens[1][Role.VIEWER]).headers["x-content-type-options"] == "nosniff"
    assert door.ask().status_code == 401


def test_supervisors_need_no_token(doorman: Callable[..., Doorman]) -> None:
    door = doorman(auth={}, rate_limit={"enabled": True, "client_rpm": 1})
    for _ in range(3):
        assert door.ask("/livez").status_code == 200
        assert door.ask("/readyz").status_code == 200


def test_a_viewer_may_read_everything_the_beacons_too(
    doorman: Callable[..., Doorman], tokens: tuple[Path, dict[Role, str]]
) -> None:
    path, given = tokens
    door = doorman(auth={"tokens_file": str(path)})
    door.plant.announce("lidar")
    for where in (APPS, f"{APPS}/lidar/x-medkit-beacon", "/metrics", "/api/v1/health"):
        assert door.bearer(given[Role.VIEWER], where).status_code == 200


@pytest.mark.parametrize(
    "header",
    ["Bearer wrong", "Bearer ", "Bearer", "", "Token x", "Basic !!", "Basic eA==", "Basic /w=="],
)
def test_anything_else_is_no_token(
    doorman: Callable[..., Doorman], tokens: tuple[Path, dict[Role, str]], header: str
) -> None:
    door = doorman(auth={"tokens_file": str(tokens[0])})
    answer = door.ask(headers={"authorization": header} if header else {})
    assert answer.status_code == 401


def test_a_token_may_be_given_as_a_password_for_reading_only(
    doorman: Callable[..., Doorman], tokens: tuple[Path, dict[Role, str]]
) -> None:
    path, given = tokens
    door = doorman(auth={"tokens_file": str(path)})
    password = base64.b64encode(f"me:{given[Role.ADMIN]}".encode()).decode()
    headers = {"authorization": f"Basic {password}"}
    assert door.ask(headers=headers).status_code == 200
    assert door.ask(method="POST", headers=headers).status_code == 401


def test_the_page_is_open_to_all_and_no_browser_asks_for_a_password_by_itself(
    doorman: Callable[..., Doorman], tokens: tuple[Path, dict[Role, str]]
) -> None:
    door = doorman(auth={"tokens_file": str(tokens[0])})
    assert door.ask("/").status_code == 200
    for path in re.findall(r'"(page/[^"]+)"', door.ask("/").text):
        assert door.ask(f"/{path}").status_code == 200
    for path in (APPS, "/metrics", "/pages", "/page", "/api/v1/x-medkit-beacon/stream"):
        answer = door.ask(path)
        assert (path, answer.status_code) == (path, 401)
        assert answer.headers["www-authenticate"].startswith("Bearer ")
    assert door.ask("/", "POST").status_code == 404


SUBSCRIPTIONS = f"{APPS}/a/cyclic-subscriptions"


@pytest.mark.parametrize(
    ("role", "method", "path", "allowed"),
    [
        (Role.VIEWER, "GET", APPS, True),
        (Role.VIEWER, "HEAD", "/", True),
        (Role.VIEWER, "POST", SUBSCRIPTIONS, False),
        (Role.OPERATOR, "POST", SUBSCRIPTIONS, True),
        (Role.OPERATOR, "POST", SUBSCRIPTIONS + "/", True),
        (Role.OPERATOR, "DELETE", f"{SUBSCRIPTIONS}/sub_001", True),
        (Role.OPERATOR, "PUT", f"{APPS}/a/configurations/x", False),
        (Role.OPERATOR, "GET", f"{APPS}/a/x-medkit-beacon", True),
        (Role.CONFIGURATOR, "PUT", f"{APPS}/a/configurations/x", True),
        (Role.CONFIGURATOR, "POST", SUBSCRIPTIONS, True),
        (Role.CONFIGURATOR, "DELETE", f"{APPS}/a", False),
        (Role.ADMIN, "DELETE", f"{APPS}/a", True),
        (Role.ADMIN, "BREW", APPS, False),
        (Role.OPERATOR, "POST", f"{APPS}/a/b/cyclic-subscriptions", False),
        (Role.OPERATOR, "POST", f"{APPS}/a\n/cyclic-subscriptionsX", False),
    ],
)
def test_a_role_may_what_the_table_says(
    role: Role, method: str, path: str, *, allowed: bool
) -> None:
    assert may(role, method, path) is allowed


def test_who_is_known_but_may_not_is_told_so(
    doorman: Callable[..., Doorman], tokens: tuple[Path, dict[Role, str]]
) -> None:
    path, given = tokens
    answer = doorman(auth={"tokens_file": str(path)}).bearer(
        given[Role.VIEWER], SUBSCRIPTIONS, "POST"
    )
    assert answer.status_code == 403
    assert answer.json() == {
        "error_code": "forbidden",
        "message": "Insufficient permissions",
        "parameters": {"role": "viewer", "method": "POST", "path": SUBSCRIPTIONS},
    }


@pytest.mark.parametrize(
    ("level", "read", "write"), [("none", 200, 404), ("write", 200, 401), ("all", 401, 401)]
)
def test_the_level_says_what_needs_a_token(
    doorman: Callable[..., Doorman], level: str, read: int, write: int
) -> None:
    door = doorman(auth={"require_auth_for": level})
    assert door.ask().status_code == read
    assert door.ask(method="POST").status_code == write


def test_it_holds_also_where_it_is_mounted(
    doorman: Callable[..., Doorman], tokens: tuple[Path, dict[Role, str]]
) -> None:
    path, given = tokens
    door = doorman(auth={"tokens_file": str(path)})
    mounted = Doorman(door.plant, Starlette(routes=[Mount("/robots", door.app)]))
    assert mounted.ask("/robots/livez").status_code == 200
    assert mounted.ask("/robots/api/v1/apps").status_code == 401
    assert mounted.bearer(given[Role.VIEWER], "/robots/api/v1/apps").status_code == 200


def test_every_line_of_a_tokens_file_that_is_none_is_named(
    doorman: Callable[..., Doorman], tmp_path: Path
) -> None:
    path = tmp_path / "tokens.txt"
    path.write_text(f"a:viewer:{hash_token('x')}\nb:boss:{hash_token('y')}\n\nc:viewer:plain\n")
    with pytest.raises(ConfigError) as caught:
        doorman(auth={"tokens_file": str(path)})
    assert "tokens.txt: line 2: no token" in str(caught.value)
    assert "tokens.txt: line 4: no token" in str(caught.value)
    assert "line 1:" not in str(caught.value)
    with pytest.raises(ConfigError, match=r"^\$.http.auth: .*nowhere: No such file"):
        doorman(auth={"tokens_file": str(tmp_path / "nowhere")})


def test_more_tokens_than_can_be_compared_are_refused(
    doorman: Callable[..., Doorman], tmp_path: Path
) -> None:
    path = tmp_path / "tokens.txt"
    path.write_text(f"a:viewer:{hash_token('x')}\n" * 1001)
    with pytest.raises(ConfigError, match="1001 tokens: give at most 1000"):
        doorman(auth={"tokens_file": str(path)})


# bearer tokens


@pytest.fixture
def issuing(doorman: Callable[..., Doorman], key_file: Path) -> Doorman:
    return doorman(auth={"secret_file": str(key_file), "clients": clients("operator")})


def test_a_client_gets_tokens_for_its_secret_and_they_open(issuing: Doorman) -> None:
    answer = issuing.authorize()
    assert answer.status_code == 200
    assert answer.headers["cache-control"] == "no-store"
    told = answer.json()
    assert set(told) == {"access_token", "token_type", "expires_in", "scope", "refresh_token"}
    assert (told["token_type"], told["expires_in"], told["scope"]) == ("Bearer", 3600, "operator")
    assert issuing.bearer(told["access_token"]).status_code == 200
    claims = jwt.decode(told["access_token"], KEY, ["HS256"], issuer="beacon")
    assert set(claims) == {"iss", "sub", "iat", "exp", "jti", "role", "refresh_token_id"}
    assert (claims["sub"], claims["role"]) == ("hmi", "operator")


def test_the_document_promises_what_is_answered_about_tokens(
    doorman: Callable[..., Doorman],
    key_file: Path,
    contract_of: Callable[[Starlette], Contract],
) -> None:
    auth = {"secret_file": str(key_file), "clients": clients()}
    door = doorman(auth=auth, rate_limit={"enabled": True, "client_rpm": 1})
    contract = contract_of(door.app)
    told = door.authorize()
    tokens = told.json()
    refresh = {"grant_type": "refresh_token", "refresh_token": tokens["refresh_token"]}
    answers = [
        told,
        door.authorize(client_id="nobody"),
        door.ask("/api/v1/auth/token", "POST", json=refresh),
        door.ask("/api/v1/auth/token", "POST", json={}),
        door.ask("/api/v1/auth/revoke", "POST", json={"token": tokens["refresh_token"]}),
        door.ask(APPS),
        door.ask(APPS),
    ]
    for answer in answers:
        contract.check(answer)
    assert [answer.status_code for answer in answers] == [200, 401, 200, 400, 200, 401, 429]


def test_without_clients_nothing_is_promised_about_tokens(
    doorman: Callable[..., Doorman],
) -> None:
    answer = doorman().ask("/api/v1/docs")
    assert "/auth/token" not in answer.json()["paths"]


def test_json_is_taken_as_well_as_a_form(issuing: Doorman) -> None:
    given = {"grant_type": "client_credentials", "client_id": "hmi", "client_secret": SECRET}
    answer = issuing.ask("/api/v1/auth/authorize", "POST", json=given)
    assert answer.status_code == 200


@pytest.mark.parametrize(
    ("given", "status", "error"),
    [
        ({"client_secret": "wrong"}, 401, "invalid_client"),
        ({"client_secret": "x" * 2000}, 401, "invalid_client"),
        ({"client_id": "nobody"}, 401, "invalid_client"),
        ({"client_id": ""}, 400, "invalid_request"),
        ({"grant_type": "password"}, 400, "unsupported_grant_type"),
    ],
)
def test_anything_else_gets_none_in_oauth_s_form(
    issuing: Doorman, given: dict[str, str], status: int, error: str
) -> None:
    answer = issuing.authorize(**given)
    assert answer.status_code == status
    assert set(answer.json()) == {"error", "error_description"}
    assert answer.json()["error"] == error


@pytest.mark.parametrize("body", [b"", b"[]", b"\xff", b"[" * 100_000, b"{"])
def test_a_body_that_is_none_is_an_invalid_request(issuing: Doorman, body: bytes) -> None:
    body = body[:60_000]
    answer = issuing.ask("/api/v1/auth/authorize", "POST", content=body)
    assert (answer.status_code, answer.json()["error"]) == (400, "invalid_request")


def test_a_refresh_token_gets_another_access_token_and_opens_nothing_itself(
    issuing: Doorman,
) -> None:
    refresh = issuing.authorize().json()["refresh_token"]
    assert issuing.bearer(refresh).status_code == 401
    given = {"grant_type": "refresh_token", "refresh_token": refresh}
    told = issuing.ask("/api/v1/auth/token", "POST", json=given).json()
    assert issuing.bearer(told["access_token"]).status_code == 200
    wrong = {"grant_type": "refresh_token", "refresh_token": told["access_token"]}
    answer = issuing.ask("/api/v1/auth/token", "POST", json=wrong)
    assert (answer.status_code, answer.json()["error"]) == (401, "invalid_grant")


def test_revoking_a_refresh_token_ends_its_access_tokens_too(issuing: Doorman) -> None:
    told, other = issuing.authorize().json(), issuing.authorize().json()
    body = {"token": told["refresh_token"]}
    answer = issuing.ask("/api/v1/auth/revoke", "POST", json=body)
    assert (answer.status_code, answer.json()) == (200, {"status": "revoked"})
    assert issuing.bearer(told["access_token"]).status_code == 401
    assert issuing.bearer(other["access_token"]).status_code == 200
    nonsense = issuing.ask("/api/v1/auth/revoke", "POST", json={"token": "never was one"})
    assert nonsense.status_code == 200


def signed(key: Any = KEY, algorithm: str = "HS256", **changed: Any) -> str:
    claims = {
        "iss": "beacon",
        "sub": "hmi",
        "iat": 1,
        "exp": 4_000_000_000,
        "jti": "1",
        "role": "viewer",
        **changed,
    }
    given = {name: value for name, value in claims.items() if value is not None}
    return jwt.encode(given, key, algorithm)


def unsigned() -> str:
    head, body, _ = signed().split(".")
    none = base64.urlsafe_b64encode(b'{"alg":"none","typ":"JWT"}').rstrip(b"=").decode()
    assert head
    return f"{none}.{body}."


@pytest.mark.parametrize(
    "token",
    [
        signed(exp=1),
        signed(iss="somebody"),
        signed(role="boss"),
        signed(role=None),
        signed(role=["viewer"]),
        signed(exp=None),
        signed(jti=None),
        signed(refresh_token_id=["x"], role="nobody"),
        signed(b"another key of at least 32 bytes"),
        signed(KEY * 2, "HS512"),
        signed(nbf=3_999_999_999),
        unsigned(),
        signed()[:-4],
        "a.b.c",
    ],
)
def test_a_token_that_says_something_else_does_not_count(issuing: Doorman, token: str) -> None:
    assert issuing.bearer(signed()).status_code == 200
    assert issuing.bearer(token).status_code == 401


def test_guessing_secrets_is_slow_whatever_the_limits_are(issuing: Doorman) -> None:
    began, guesses = time.monotonic(), 0
    while (status := issuing.authorize(grant_type="x").status_code) == 400:
        guesses += 1
    assert status == 429
    # One more for each second that it took.
    assert 60 <= guesses <= 61 + (time.monotonic() - began)
    assert issuing.bearer(signed()).headers.get("x-ratelimit-limit") is None


def test_without_clients_there_are_no_tokens_to_get(doorman: Callable[..., Doorman]) -> None:
    for door in (doorman(), doorman(auth={})):
        answer = door.authorize()
        assert (answer.status_code, answer.json()["error"]) == (503, "temporarily_unavailable")


@pytest.fixture(scope="module")
def rsa_files(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    key = rsa.generate_private_key(65537, 2048)
    folder = tmp_path_factory.mktemp("rsa")
    private, public = folder / "private.pem", folder / "public.pem"
    private.write_bytes(
        key.private_bytes(
            serialization.Encoding.PEM,
            serialization.PrivateFormat.PKCS8,
            serialization.NoEncryption(),
        )
    )
    public.write_bytes(
        key.public_key().public_bytes(
            serialization.Encoding.PEM, serialization.PublicFormat.SubjectPublicKeyInfo
        )
    )
    return private, public


def test_rs256_signs_with_one_key_and_checks_with_the_other(
    doorman: Callable[..., Doorman], rsa_files: tuple[Path, Path]
) -> None:
    private, public = map(str, rsa_files)
    makes = doorman(auth={"algorithm": "RS256", "private_key": private, "clients": clients()})
    checks = doorman(auth={"algorithm": "RS256", "public_key": public})
    token = makes.authorize().json()["access_token"]
    assert makes.bearer(token).status_code == 200
    assert checks.bearer(token).status_code == 200
    assert checks.authorize().status_code == 503


def test_the_public_key_is_no_secret_to_sign_with(
    doorman: Callable[..., Doorman], rsa_files: tuple[Path, Path]
) -> None:
    checks = doorman(auth={"algorithm": "RS256", "public_key": str(rsa_files[1])})
    head = base64.urlsafe_b64encode(b'{"alg":"HS256","typ":"JWT"}').rstrip(b"=")
    body = signed().split(".")[1].encode()
    mac = jwt.get_algorithm_by_name("HS256").sign(head + b"." + body, rsa_files[1].read_bytes())
    forged = b".".join([head, body, base64.urlsafe_b64encode(mac).rstrip(b"=")]).decode()
    assert checks.bearer(forged).status_code == 401


def test_a_key_that_is_none_or_too_short_is_said_at_the_start(
    doorman: Callable[..., Doorman], tmp_path: Path
) -> None:
    path = tmp_path / "short"
    path.write_text("secret")
    with pytest.raises(ConfigError, match=r"^\$.http.auth: .*short: a secret of 6 bytes is too"):
        doorman(auth={"secret_file": str(path)})
    with pytest.raises(ConfigError, match="no RSA key in PEM form"):
        doorman(auth={"algorithm": "RS256", "public_key": str(path)})
    with pytest.raises(ConfigError, match="No such file"):
        doorman(auth={"secret_file": str(tmp_path / "nowhere")})


@pytest.mark.parametrize(
    ("auth", "said"),
    [
        ({"clients": clients()}, "$.http.auth.clients: their tokens need a key to be signed with"),
        (
            {"clients": [{"id": "a", "secret_hash": "plain"}]},
            "$.http.auth.clients[0].secret_hash: found no hash of a secret",
        ),
    ],
)
def test_clients_that_cannot_work_are_refused(auth: dict[str, Any], said: str) -> None:
    with pytest.raises(ConfigError) as caught:
        parse_config({"http": {"auth": auth}})
    assert str(caught.value).startswith(said)


def test_a_secret_is_kept_as_a_slow_hash_that_is_another_each_time() -> None:
    one, other = hash_secret("a"), hash_secret("a")
    assert one != other
    assert is_secret_hash(one)
    assert secret_matches("a", one)
    assert secret_matches("a", other)
    assert not secret_matches("b", one)
    assert not secret_matches("a", "scrypt:x:y")


def test_what_is_put_in_force_keeps_what_was_revoked(issuing: Doorman, key_file: Path) -> None:
    auth = {"secret_file": str(key_file), "clients": clients()}
    config = parse_config({"http": {"auth": auth}}).config.http
    access = Access(config)
    app = create_app(issuing.plant.gateway, access)
    door = Doorman(issuing.plant, app)
    token = door.authorize().json()["access_token"]
    door.ask("/api/v1/auth/revoke", "POST", json={"token": token})
    access.put(access.prepared(config), config)
    assert door.bearer(token).status_code == 401
    key_file.write_bytes(b"short")
    with pytest.raises(ConfigError):
        access.prepared(config)
    assert door.bearer(door.authorize().json()["access_token"]).status_code == 200


# bodies and headers


def test_an_answer_that_has_begun_is_not_answered_again() -> None:
    async def hasty(_: Scope, receive: Receive, send: Send) -> None:
        await send({"type": "http.response.start", "status": 200, "headers": []})
        while True:
            await receive()

    async def too_much() -> AsyncIterator[bytes]:
        for _ in range(100):
            yield b"x" * 100

    async def pour() -> None:
        app = AccessControl(hasty, Access(HttpConfig(max_body_bytes=1024)))
        async with httpx.AsyncClient(
            transport=httpx.ASGITransport(app), base_url="http://gateway"
        ) as client:
            await client.post("/", content=too_much())

    with pytest.raises(Exception, match="Request body too large"):
        asyncio.run(pour())


@pytest.mark.parametrize("chunked", [False, True])
def test_a_body_that_is_too_large_is_refused_unread(
    doorman: Callable[..., Doorman],
    key_file: Path,
    chunked: bool,  # noqa: FBT001
) -> None:
    door = doorman(auth={"secret_file": str(key_file), "clients": clients()}, max_body_bytes=1024)

    async def pieces() -> AsyncIterator[bytes]:
        for _ in range(20):
            yield b"x" * 100

    body: Any = pieces() if chunked else b"x" * 2000
    answer = door.ask("/api/v1/auth/authorize", "POST", content=body)
    assert answer.status_code == 413
    assert answer.json() == {
        "error_code": "invalid-request",
        "message": "Request body too large",
        "parameters": {"max_bytes": 1024},
    }


def test_a_body_that_does_not_arrive_is_not_waited_for_for_ever(
    doorman: Callable[..., Doorman], key_file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(middleware, "_BODY_WITHIN_S", 0.05)
    door = doorman(auth={"secret_file": str(key_file), "clients": clients()})

    async def stuck() -> AsyncIterator[bytes]:
        yield b"{"
        await asyncio.sleep(30)

    answer = door.ask("/api/v1/auth/authorize", "POST", content=stuck())
    assert answer.status_code == 408


def test_a_body_of_the_right_size_arrives_whole() -> None:
    async def echo(request: Request) -> PlainTextResponse:
        body = await request.body()
        assert not await request.is_disconnected()
        return PlainTextResponse(body.decode())

    async def post() -> httpx.Response:
        app = AccessControl(
            Starlette(routes=[Route("/", echo, methods=["POST"])]), Access(HttpConfig())
        )
        async with httpx.AsyncClient(
            transport=httpx.ASGITransport(app), base_url="http://gateway"
        ) as client:
            return await client.post("/", content=b"y" * 65_536)

    assert asyncio.run(post()).text == "y" * 65_536


@pytest.mark.parametrize("where", ["headers", "query", "path"])
def test_more_head_than_any_client_needs_is_refused(
    doorman: Callable[..., Doorman], where: str
) -> None:
    much = "x" * 17_000
    ways: dict[str, dict[str, Any]] = {
        "headers": {"path": APPS, "headers": {"x": much}},
        "query": {"path": f"{APPS}?{much}"},
        "path": {"path": f"{APPS}/{much}"},
    }
    answer = doorman().ask(**ways[where])
    assert answer.status_code == 431
    assert answer.json()["error_code"] == "invalid-request"


@pytest.mark.parametrize(
    ("host", "network"),
    [
        ("192.0.2.7", "192.0.2.7"),
        ("::ffff:192.0.2.7", "192.0.2.7"),
        ("2001:db8::1", "2001:db8::/64"),
        ("2001:db8::ffff:1", "2001:db8::/64"),
        ("testclient", "testclient"),
    ],
)
def test_a_client_is_an_address_or_a_network_of_its_own(host: str, network: str) -> None:
    assert network_of(host) == network


def test_the_overview_says_what_is_required(
    doorman: Callable[..., Doorman], tokens: tuple[Path, dict[Role, str]]
) -> None:
    path, given = tokens
    door = doorman(auth={"tokens_file": str(path)})
    body = door.bearer(given[Role.VIEWER], "/api/v1/").json()
    assert body["capabilities"]["authentication"] is True
    assert body["auth"] == {"enabled": True, "algorithm": "HS256", "require_auth_for": "all"}
    assert "auth" not in doorman().ask("/api/v1/").json()


def test_tokens_are_compared_from_many_threads(
    doorman: Callable[..., Doorman], tokens: tuple[Path, dict[Role, str]]
) -> None:
    path, given = tokens
    door = doorman(auth={"tokens_file": str(path)})
    seen: list[int] = []
    threads = [
        threading.Thread(target=lambda: seen.append(door.bearer(given[Role.VIEWER]).status_code))
        for _ in range(8)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert seen == [200] * 8
