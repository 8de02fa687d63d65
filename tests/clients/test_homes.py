"""Routes of the Python client: the cases of every client."""

import json
from pathlib import Path

import pytest

from wayfarer_client.homes import Homes, place_of

DOCUMENT = json.loads((Path(__file__).parents[1] / "golden" / "homes.json").read_text())


@pytest.mark.parametrize("case", DOCUMENT["cases"], ids=lambda case: case["name"])
def test_a_call_goes_where_the_rule_says(case):
    homes = Homes(case["entry"])
    for call in case["calls"]:
        route = homes.route(call["about"])
        for k, (address, answer) in enumerate(zip(call["called"], call["answers"], strict=True)):
            assert route.address == address
            last = k == len(call["called"]) - 1
            if "answered" in answer:
                assert last and not call["fails"]
                route.answered(answer["answered"])
            elif "unavailable" in answer:
                assert route.unavailable() == (not last)
            else:
                assert route.misdirected(*answer["misdirected"]) == (not last)
    assert homes.home(case["about"]) == case["home"]


def test_a_streams_close_reason_names_the_node():
    for reason, host, port in DOCUMENT["reasons"]:
        assert place_of(reason) == (host, port), reason
