import pytest

from tests.transport.auth.issuer import AUDIENCE, ISSUER, Issuer
from tests.transport.auth.test_keys import FILE, STUDIO
from wayfarer.errors import Unauthenticated
from wayfarer.transport.auth import Authenticator, Credentials
from wayfarer.transport.auth.keys import KeyFile
from wayfarer.transport.auth.tokens import IssuerKeys, TokenCheck
from wayfarer.transport.edge.caller import LOCAL, Scope

READ = frozenset({Scope.READ})


@pytest.fixture
def keys(tmp_path):
    path = tmp_path / "keys.toml"
    path.write_text(FILE)
    return KeyFile(path)


@pytest.fixture
def issuer():
    return Issuer()


@pytest.fixture
def tokens(issuer):
    return TokenCheck(IssuerKeys(issuer.document), ISSUER, AUDIENCE, ("ES256",), 10)


async def test_without_any_way_everybody_is_local():
    assert await Authenticator().caller(Credentials(bearer="whatever")) is LOCAL


async def test_keys_and_tokens_side_by_side(keys, tokens, issuer):
    known = Authenticator(keys, tokens)
    assert (await known.caller(Credentials(bearer=STUDIO))).name == "key:studio"
    assert (await known.caller(Credentials(bearer=issuer.token()))).name == "jwt:ada"


@pytest.mark.parametrize("shown", [Credentials(), Credentials(certificate="ada")])
async def test_nothing_shown_says_what_is_accepted(keys, tokens, shown):
    with pytest.raises(Unauthenticated, match=r"missing; .*API key.*x-api-key.*JWT"):
        await Authenticator(keys, tokens).caller(shown)


async def test_a_token_where_only_keys_are_known(keys, issuer):
    token = issuer.token()
    with pytest.raises(Unauthenticated, match="unknown credentials") as caught:
        await Authenticator(keys).caller(Credentials(bearer=token))
    assert token not in str(caught.value)


async def test_an_endless_token_is_not_looked_at(keys, tokens):
    with pytest.raises(Unauthenticated, match="8192"):
        await Authenticator(keys, tokens).caller(Credentials(bearer="e" * 9000))


async def test_a_certificate_stands_for_its_name():
    known = Authenticator(certificate_scopes=READ)
    caller = await known.caller(Credentials(certificate="ada"))
    assert (caller.name, caller.scopes) == ("certificate:ada", READ)
    with pytest.raises(Unauthenticated, match="client certificate is required"):
        await known.caller(Credentials())


async def test_with_client_certificates_a_key_does_not_do_alone(keys):
    known = Authenticator(keys, certificate_scopes=READ)
    with pytest.raises(Unauthenticated, match="certificate"):
        await known.caller(Credentials(api_key=STUDIO))
    both = Credentials(api_key=STUDIO, certificate="ada")
    assert (await known.caller(both)).name == "key:studio"


async def test_certificates_may_be_no_credentials(keys):
    known = Authenticator(keys, certificate_scopes=frozenset())
    with pytest.raises(Unauthenticated, match="missing"):
        await known.caller(Credentials(certificate="ada"))


def test_what_is_shown_is_not_printed():
    assert "secret" not in repr(Credentials(bearer="secret-1", api_key="secret-2"))
