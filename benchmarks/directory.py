"""Durations of a renewal and of a claim in the cluster's directory, with pickling: many nodes full
of sessions.

python -m benchmarks.directory --nodes 140 --sessions 700
"""

import argparse
import pickle
import random
import time
from typing import Any

from wayfarer.cluster.directory import Directory, LeaseRules, share_of
from wayfarer.cluster.messages import Answer, LeaseRenewal, NodeInfo

RENEWALS_PER_S = 4
"""Renewals per second of each node."""


CLAIMS = 2000


def asked(directory: Directory, verb: str, *request: object) -> Any:
    """The answer, both ways as Ray carries it."""
    answer = getattr(directory, verb)(*pickle.loads(pickle.dumps(request)))
    return pickle.loads(pickle.dumps(answer))


def main() -> None:
    """Prints it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--nodes", type=int, default=140)
    parser.add_argument("--sessions", type=int, default=400, help="of each node")
    parser.add_argument("--rounds", type=int, default=5)
    args = parser.parse_args()
    directory = Directory(LeaseRules(600.0, nodes=args.nodes), 1)
    groups = [random.Random(n).randbytes(6).hex() for n in range(args.nodes * args.sessions)]
    began = time.process_time()
    for number in range(args.nodes):
        node = NodeInfo(
            name=f"node{number}", number=number, host="10.0.0.1", grpc_port=1, http_port=2,
            fingerprint="a", capacity=1024,
        )  # fmt: skip
        held = dict.fromkeys(groups[number :: args.nodes], 1)
        renewal = LeaseRenewal(name=node.name, count=1, node=node, held=held, leased=True)
        asked(directory, "renew", renewal)
    entered = (time.process_time() - began) / args.nodes
    seen = dict.fromkeys(range(args.nodes), (0, 0))
    began = time.process_time()
    for count in range(args.rounds):
        if count == 1:  # the first brings the whole view
            began = time.process_time()
        for number in range(args.nodes):
            renewal = LeaseRenewal(
                name=f"node{number}",
                count=count + 2,
                held=dict.fromkeys(share_of(groups[number :: args.nodes], count + 2), 1),
                seen=seen[number],
            )
            answer: Answer = asked(directory, "renew", renewal)
            if answer.changes:
                seen[number] = (answer.changes.generation, answer.changes.version)
    renewed = (time.process_time() - began) / (args.rounds - 1) / args.nodes
    moved = groups[:CLAIMS]
    began = time.process_time()
    for number, group in enumerate(moved):  # each to the next node
        owner, to = f"node{number % args.nodes}", f"node{(number + 1) % args.nodes}"
        asked(directory, "claim", group, owner, 1, to)
    claimed = (time.process_time() - began) / len(moved)
    share = renewed * RENEWALS_PER_S * args.nodes
    print(f"first renewal {1e3 * entered:.2f} ms, renewal {1e3 * renewed:.3f} ms")
    print(f"claim {1e3 * claimed:.3f} ms: {1 / claimed:.0f} a second take a core")
    print(f"{RENEWALS_PER_S * args.nodes} renewals a second: {100 * share:.0f} % of a core")


if __name__ == "__main__":
    main()
