"""A token issuer for tests."""

import json
import time
from typing import Any

import jwt
from cryptography.hazmat.primitives.asymmetric import ec, rsa

ISSUER = "https://issuer.example"
AUDIENCE = "wayfarer"


class Issuer:
    """Signs tokens with an elliptic-curve key and an RSA key."""

    def __init__(self, *names: str) -> None:
        self.keys: dict[str, Any] = {
            name: ec.generate_private_key(ec.SECP256R1()) for name in names or ("one",)
        }

    def add_rsa(self, name: str) -> None:
        self.keys[name] = rsa.generate_private_key(65537, 2048)

    def document(self) -> dict[str, Any]:
        """The JWKS."""
        found = []
        for name, key in self.keys.items():
            kind = jwt.algorithms.RSAAlgorithm if _is_rsa(key) else jwt.algorithms.ECAlgorithm
            found.append({**json.loads(kind.to_jwk(key.public_key())), "kid": name, "use": "sig"})
        return {"keys": found}

    def token(self, kid: str = "one", /, *, without: tuple[str, ...] = (), **claims: Any) -> str:
        now = time.time()
        whole = {
            "iss": ISSUER,
            "aud": AUDIENCE,
            "sub": "ada",
            "iat": now,
            "exp": now + 60,
            "scope": "read control openid",
            **claims,
        }
        kept = {name: value for name, value in whole.items() if name not in without}
        key = self.keys[kid]
        algorithm = "RS256" if _is_rsa(key) else "ES256"
        return jwt.encode(kept, key, algorithm=algorithm, headers={"kid": kid})


def _is_rsa(key: Any) -> bool:
    return isinstance(key, rsa.RSAPrivateKey)
