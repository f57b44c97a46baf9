#!/usr/bin/env python3
"""Estimates what limits a run over MPI: a model of one round, not a measurement.

    benches/exchange.py                                CartPole: 200 steps of 4 observations and 1 action
    benches/exchange.py --alone                        as before ranks measured and recorded their own agents
    benches/exchange.py --sharing all
    benches/exchange.py --observations 17 --actions 6 --steps 1000 --learning 0.6
    benches/exchange.py --lockstep 1                   a learner that gets transitions after each step

Each row is a team of K agents on K / 100 ranks (`--agents-per-rank`), one core each. A round has these parts:

    play      every agent of a rank plays an episode, which the rank measures and records
    learn     every agent of a rank learns from its own episode and from those that are shared with it
    exchange  a rank receives episodes: all of them, or those that its agents learn from
    in a row  each rank adds the visits of its agents to the sums that it gets from the one before it
    rank 0    receives the rows of all agents, writes tables, and appends what others have encoded; they wait meanwhile

Times are seconds. Received bytes divided by the bandwidth, and by the speed at which they are unpacked, plus the latency of the messages:
log2(ranks) for an exchange with all, one message for each other rank otherwise. A rank needs about K (1 - (1 - n/K)^k) different episodes of
others, if each of its k agents samples n of K.
"""

import argparse
import math

NUMBER = 4  # bytes


def parse():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--observations", type=int, default=4, help="numbers per observation (default: %(default)s)")
    parser.add_argument("--actions", type=int, default=1, help="numbers per action (default: %(default)s)")
    parser.add_argument("--steps", type=int, default=200, help="steps of an episode (default: %(default)s)")
    parser.add_argument("--sharing", default="16", help="`all`, or the number of episodes that each agent samples (default: %(default)s)")
    parser.add_argument("--lockstep", type=int, default=0, help="exchange transitions after this number of steps; 0: episodes (default: %(default)s)")
    parser.add_argument("--minibatch", type=int, default=32, help="transitions that an agent learns from after each exchange of a lockstep run (default: %(default)s)")
    parser.add_argument("--agents-per-rank", type=int, default=100, help="default: %(default)s")
    parser.add_argument("--playing", type=float, default=2.7, help="microseconds of playing a step (default: %(default)s)")
    parser.add_argument("--learning", type=float, default=0.36, help="microseconds of learning from a step, one pass (default: %(default)s)")
    parser.add_argument("--passes", type=int, default=4, help="passes of learning (default: %(default)s)")
    parser.add_argument("--measuring", type=float, default=0.65, help="microseconds of measuring a step (default: %(default)s)")
    parser.add_argument("--recording", type=float, default=1.2, help="the same for recording; 0 with --no-recording (default: %(default)s)")
    parser.add_argument("--rows", type=float, default=18.5, help="microseconds of rank 0 per agent and round, with a recording (default: %(default)s)")
    parser.add_argument("--cells", type=int, default=2400, help="cells of visited states: 400 for each pair of observations (default: %(default)s)")
    parser.add_argument("--adding", type=float, default=0.8, help="nanoseconds of adding the visits of a cell, to all and to recent ones (default: %(default)s)")
    parser.add_argument("--alone", action="store_true", help="rank 0 receives, measures and records all episodes, as before ranks shared this work")
    parser.add_argument("--unpacking", type=float, default=0.6, help="GB/s (default: %(default)s)")
    parser.add_argument("--bandwidth", type=float, default=1.0, help="GB/s that a rank receives (default: %(default)s)")
    parser.add_argument("--latency", type=float, default=5.0, help="microseconds of a message (default: %(default)s)")
    return parser.parse_args()


def receive(bytes_received, messages, arguments):
    """Seconds to receive and unpack."""
    per_byte = 1e-9 / arguments.bandwidth + 1e-9 / arguments.unpacking
    return bytes_received * per_byte + messages * arguments.latency * 1e-6


def round_of(agents, arguments):
    """Seconds of the parts of a round."""
    ranks = max(1, agents // arguments.agents_per_rank)
    local = agents / ranks
    steps = arguments.steps
    step_bytes = NUMBER * (arguments.observations + 2 * arguments.actions + 1)
    others, team_mates = agents - local, agents - 1
    shared = team_mates if arguments.sharing == "all" else min(team_mates, int(arguments.sharing))
    if arguments.sharing == "all" or arguments.lockstep:
        needed, messages = others, math.ceil(math.log2(ranks)) if ranks > 1 else 0
    else:
        needed, messages = others * (1 - (1 - shared / team_mates) ** local), ranks - 1
    exchanges = math.ceil(steps / arguments.lockstep) if arguments.lockstep else 1
    learned = exchanges * arguments.minibatch if arguments.lockstep else steps * (1 + shared) * arguments.passes
    recorded = steps * (arguments.measuring + arguments.recording) * 1e-6
    at_rank_0 = agents * arguments.rows * 1e-6
    in_a_row = agents * arguments.cells * arguments.adding * 1e-9 + ranks * arguments.latency * 1e-6
    if arguments.alone:
        at_rank_0 += agents * recorded + in_a_row
        if not (arguments.sharing == "all" or arguments.lockstep):
            at_rank_0 += receive(others * steps * step_bytes, 0, arguments)
        recorded = in_a_row = 0
    return {
        "play": local * (steps * arguments.playing * 1e-6 + recorded),
        "learn": local * learned * arguments.learning * 1e-6,
        "exchange": receive(needed * steps * step_bytes, messages * exchanges, arguments) if ranks > 1 else 0,
        "in a row": in_a_row,
        "rank 0": at_rank_0,
    }, needed * steps * step_bytes, ranks


def main():
    arguments = parse()
    print("      K  ranks  received     play    learn  exchange  in a row   rank 0  longest   ranks busy")
    for agents in [100, 1000, 3000, 10_000, 30_000, 100_000]:
        parts, received, ranks = round_of(agents, arguments)
        longest = max(parts, key=parts.get)
        busy = (parts["play"] + parts["learn"]) / sum(parts.values())
        print(
            f"{agents:7} {ranks:6} {received / 1e6:7.1f} MB {parts['play']:8.3f} {parts['learn']:8.3f} {parts['exchange']:9.4f}"
            f" {parts['in a row']:9.4f} {parts['rank 0']:8.3f}  {longest:8} {100 * busy:8.0f} %"
        )


if __name__ == "__main__":
    main()
