import asyncio
from contextlib import aclosing

import pytest

from wayfarer.transport.streams.merge import merged


async def numbers(most: int, pulled: list[int], pause: float = 0.0):
    for number in range(most):
        pulled.append(number)
        await asyncio.sleep(pause)
        yield number


async def test_both_are_read_and_neither_ahead():
    main, side = [], []
    async with aclosing(merged(numbers(1000, main), numbers(1000, side))) as both:
        got = [await anext(both) for _ in range(10)]
    assert sorted(got) == sorted([*range(5), *range(5)])  # neither starves the other
    assert max(main[-1], side[-1]) <= 6


async def test_it_ends_with_the_main_one_only():
    assert sorted([n async for n in merged(numbers(4, [], 0.001), numbers(2, []))]) == [
        *(0, 0, 1, 1, 2, 3)
    ]
    endless = numbers(10**9, [])
    assert [n async for n in merged(numbers(0, []), endless)] in ([], [0])


async def test_an_error_of_either_ends_both():
    closed = []

    async def broken():
        yield 1
        raise ValueError("side")

    async def watched():
        try:
            while True:
                await asyncio.sleep(10)
                yield 0
        finally:
            closed.append(True)

    with pytest.raises(ValueError, match="side"):
        async for _ in merged(watched(), broken()):
            pass
    assert closed == [True]
