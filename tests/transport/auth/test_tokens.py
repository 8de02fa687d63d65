import asyncio
import base64
import hmac
import json
import threading
import time

import jwt
import pytest

from tests.transport.auth.issuer import AUDIENCE, ISSUER, Issuer
from tests.world.fakes import ManualClock
from wayfarer.errors import InvalidArgument, Unauthenticated, Unavailable
from wayfarer.transport.auth.tokens import FRESH_S, PAUSE_S, IssuerKeys, TokenCheck
from wayfarer.transport.edge.caller import Scope


class Source:
    """Counts how often the keys are fetched."""

    def __init__(self, issuer: Issuer) -> None:
        self.issuer = issuer
        self.fetched = 0
        self.fails = False

    def __call__(self) -> dict:
        self.fetched += 1
        if self.fails:
            raise OSError("no route to host")
        return self.issuer.document()


@pytest.fixture
def issuer():
    return Issuer()


@pytest.fixture
def source(issuer):
    return Source(issuer)


@pytest.fixture
def clock():
    return ManualClock()


@pytest.fixture
def check(source, clock):
    return checking(source, clock)


def checking(source, clock=time.monotonic, algorithms=("ES256",)) -> TokenCheck:
    return TokenCheck(IssuerKeys(source, clock), ISSUER, AUDIENCE, algorithms, leeway_s=10)


async def test_a_token_stands_for_its_subject(check, issuer):
    caller = await check.caller(issuer.token())
    assert caller.name == "jwt:ada"
    assert caller.scopes == {Scope.READ, Scope.CONTROL}  # openid is another service's


@pytest.mark.parametrize(
    ("claims", "scopes"),
    [
        ({"scope": "admin"}, {Scope.ADMIN}),
        ({"scope": ["read"]}, {Scope.READ}),
        ({"scope": 3}, set()),
    ],
)
async def test_scopes(check, issuer, claims, scopes):
    assert (await check.caller(issuer.token(**claims))).scopes == scopes


async def test_scp_of_some_issuers(check, issuer):
    token = issuer.token(without=("scope",), scp=["control"])
    assert (await check.caller(token)).scopes == {Scope.CONTROL}


@pytest.mark.parametrize(
    ("claims", "why"),
    [
        ({"exp": time.time() - 60}, "has expired"),
        ({"nbf": time.time() + 86_400}, "not valid yet"),
        ({"aud": "another"}, "another audience"),
        ({"iss": "https://evil.example"}, "another issuer"),
        ({"sub": ""}, "not a name"),
        ({"sub": "a\nb"}, "not a name"),
        ({"sub": "a" * 200}, "not a name"),
        ({"sub": 7}, "malformed"),
    ],
)
async def test_claims_that_do_not_hold(check, issuer, claims, why):
    with pytest.raises(Unauthenticated, match=why):
        await check.caller(issuer.token(**claims))


@pytest.mark.parametrize("claim", ["exp", "iss", "aud", "sub"])
async def test_claims_that_must_be_there(check, issuer, claim):
    with pytest.raises(Unauthenticated, match="lacks one of"):
        await check.caller(issuer.token(without=(claim,)))


async def test_clocks_may_differ_a_little(check, issuer):
    assert await check.caller(issuer.token(exp=time.time() - 5))


async def test_a_signature_of_somebody_else(check):
    with pytest.raises(Unauthenticated, match="signature"):
        await check.caller(Issuer().token())


async def test_a_changed_token(check, issuer):
    head, body, signature = issuer.token().split(".")
    claims = json.loads(base64.urlsafe_b64decode(body + "=="))
    more = base64.urlsafe_b64encode(json.dumps({**claims, "scope": "admin"}).encode()).decode()
    with pytest.raises(Unauthenticated, match="signature"):
        await check.caller(f"{head}.{more.rstrip('=')}.{signature}")


async def test_no_signature_is_none(check):
    unsigned = jwt.encode({"sub": "ada"}, None, algorithm="none", headers={"kid": "one"})
    with pytest.raises(Unauthenticated, match="not allowed"):
        await check.caller(unsigned)


async def test_the_public_key_is_no_shared_secret(check, issuer):
    """The attack on libraries that take an HMAC key where they expect a public one."""
    public = json.dumps(issuer.document()["keys"][0]).encode()
    parts = [json.dumps(part).encode() for part in ({"alg": "HS256", "kid": "one"}, {"sub": "ada"})]
    signed = b".".join(base64.urlsafe_b64encode(part).rstrip(b"=") for part in parts)
    mark = base64.urlsafe_b64encode(hmac.digest(public, signed, "sha256")).rstrip(b"=")
    forged = f"{signed.decode()}.{mark.decode()}"
    with pytest.raises(Unauthenticated, match="not allowed"):
        await check.caller(forged)


async def test_shared_secrets_among_the_keys_are_left_out(source, issuer):
    secret = base64.urlsafe_b64encode(b"s" * 32).decode().rstrip("=")
    document = issuer.document()
    document["keys"].append({"kty": "oct", "k": secret, "kid": "hmac", "alg": "HS256"})
    check = checking(lambda: document, algorithms=("ES256", "HS256"))
    forged = jwt.encode({"sub": "a"}, "s" * 32, algorithm="HS256", headers={"kid": "hmac"})
    with pytest.raises(Unauthenticated, match="a key that its issuer does not have"):
        await check.caller(forged)


async def test_algorithms_that_are_not_listed(issuer):
    issuer.add_rsa("two")
    with pytest.raises(Unauthenticated, match="algorithm"):
        await checking(Source(issuer)).caller(issuer.token("two"))
    assert await checking(Source(issuer), algorithms=("RS256",)).caller(issuer.token("two"))


@pytest.mark.parametrize(
    "token", ["", "x", "a.b.c", "eyJhbGciOiJFUzI1NiJ9.e30.x", "é.é.é", "." * 9]
)
async def test_what_is_no_token(check, token):
    with pytest.raises(Unauthenticated, match=r"malformed|names no key") as caught:
        await check.caller(token)
    assert len(token) < 3 or token not in str(caught.value)


async def test_keys_are_fetched_once_and_again_when_stale(check, issuer, source, clock):
    for _ in range(5):
        await check.caller(issuer.token())
    assert source.fetched == 1
    clock.now += FRESH_S + 1
    await check.caller(issuer.token())  # with the old keys; the new ones come meanwhile
    await asyncio.sleep(0.05)
    assert source.fetched == 2


async def test_a_new_key_is_found_and_strange_ones_fetch_no_storm(check, issuer, source, clock):
    await check.caller(issuer.token())
    clock.now += PAUSE_S
    issuer.keys["two"] = Issuer().keys["one"]
    assert await check.caller(issuer.token("two"))
    for _ in range(20):
        with pytest.raises(Unauthenticated, match="does not have"):
            await check.caller(Issuer("strange").token("strange"))
    assert source.fetched == 2


async def test_an_issuer_that_is_away(check, issuer, source, clock):
    source.fails = True
    with pytest.raises(Unavailable, match="cannot be had"):
        await check.caller(issuer.token())
    source.fails = False
    clock.now += PAUSE_S
    assert await check.caller(issuer.token())
    source.fails = True
    clock.now += FRESH_S + 1
    assert await check.caller(issuer.token())  # the keys of before stay good


async def test_many_callers_wait_for_one_fetch_that_does_not_block_the_loop(issuer):
    let_go = threading.Event()
    fetched = []

    def slow() -> dict:
        fetched.append(1)
        assert let_go.wait(5)
        return issuer.document()

    check = checking(slow)
    waiting = [asyncio.create_task(check.caller(issuer.token())) for _ in range(10)]
    await asyncio.sleep(0.05)
    assert not any(task.done() for task in waiting)
    let_go.set()
    assert len(await asyncio.gather(*waiting)) == 10
    assert len(fetched) == 1


async def test_a_caller_who_leaves_does_not_take_the_fetch_with_it(issuer):
    let_go = threading.Event()
    check = checking(lambda: let_go.wait(5) and issuer.document())
    leaving = asyncio.create_task(check.caller(issuer.token()))
    staying = asyncio.create_task(check.caller(issuer.token()))
    await asyncio.sleep(0.02)
    leaving.cancel()
    let_go.set()
    assert (await staying).name == "jwt:ada"


async def test_keys_from_a_file(tmp_path, issuer):
    path = tmp_path / "jwks.json"
    path.write_text(json.dumps(issuer.document()))
    check = TokenCheck(IssuerKeys.of(str(path)), ISSUER, AUDIENCE, ("ES256",), 10)
    assert await check.caller(issuer.token())


@pytest.mark.parametrize("text", ["", "[]", '{"keys": []}', '{"keys": [{"kty": "oct"}]}'])
def test_a_file_without_public_keys(tmp_path, text):
    path = tmp_path / "jwks.json"
    path.write_text(text)
    with pytest.raises(InvalidArgument, match=r"auth.jwt_keys: .*jwks\.json"):
        IssuerKeys.of(str(path))
