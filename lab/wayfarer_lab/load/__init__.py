"""`wayfarer load`: an open-loop load generator for streams.

It simulates clients in its own process: sessions of agents with a stream each, goals at a
fixed rate whatever the server does, readers that are too slow, clients that vanish. Lateness counts
from the scheduled display of a primitive, so a server that falls behind cannot hide it by slowing
its clients down (coordinated omission).
"""
