import asyncio

import pytest

from tests.world.fakes import ManualClock
from wayfarer.errors import ResourceExhausted
from wayfarer.transport.edge.call_rates import (
    FAILURE_BURST,
    REMEMBERED,
    Buckets,
    CallRates,
    count_call,
    count_with,
)
from wayfarer.transport.edge.caller import Caller, Quota

ADA = Caller("ada", frozenset())
BOB = Caller("bob", frozenset())


@pytest.fixture
def clock():
    return ManualClock(0.0)


@pytest.fixture
def rates(clock):
    return CallRates(10, clock)


def spent(rates: CallRates, caller: Caller) -> int:
    """Calls until the first that is refused."""
    for made in range(1000):
        try:
            rates.count(caller)
        except ResourceExhausted:
            return made
    raise AssertionError("never refused")


def test_a_burst_of_twice_the_rate_then_the_rate(rates, clock):
    assert spent(rates, ADA) == 20
    clock.now += 0.5
    assert spent(rates, ADA) == 5
    clock.now += 3600
    assert spent(rates, ADA) == 20


def test_callers_do_not_share(rates):
    spent(rates, ADA)
    assert spent(rates, BOB) == 20


def test_a_refusal_says_when_to_come_again(rates, clock):
    spent(rates, ADA)
    with pytest.raises(ResourceExhausted, match=r"'ada' may make 10 calls per second") as caught:
        rates.count(ADA)
    assert caught.value.retry_after == pytest.approx(0.1)
    clock.now += caught.value.retry_after
    rates.count(ADA)


def test_a_quota_of_its_own(rates):
    assert spent(rates, Caller("ada", frozenset(), Quota(calls_per_second=3))) == 6


def test_a_clock_that_steps_back_locks_nobody_out(rates, clock):
    clock.now = 1e6
    spent(rates, ADA)
    clock.now = 0.0
    assert spent(rates, ADA) == 0
    clock.now = 0.5
    assert spent(rates, ADA) == 5


def test_failures_of_an_address_are_bounded(rates, clock):
    for _ in range(FAILURE_BURST):
        rates.failed("10.0.0.1")
    with pytest.raises(ResourceExhausted, match="wrong credentials") as caught:
        rates.failed("10.0.0.1")
    rates.failed("10.0.0.2")
    clock.now += caught.value.retry_after
    rates.failed("10.0.0.1")


def test_memory_is_bounded_whoever_asks():
    buckets = Buckets()
    buckets.take("ada", 1, 2, 0.0)
    for number in range(3 * REMEMBERED):
        buckets.take(str(number), 1, 2, 0.0)
        buckets.take("ada", 1e-9, 1e9, 0.0)  # so ada is not forgotten
    assert len(buckets) == REMEMBERED


async def test_commands_of_a_stream_count_as_its_callers():
    counted = []

    async def stream(name: str) -> None:
        count_with(lambda: counted.append(name))
        await asyncio.sleep(0)
        count_call()

    await asyncio.gather(stream("ada"), stream("bob"))
    count_call()  # outside of any call: nothing to count
    assert sorted(counted) == ["ada", "bob"]
