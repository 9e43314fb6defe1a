#!/usr/bin/env python3
"""What one render over many devices would take, on machines that are not here (docs/scaling.md).

Simulates the first rank and its devices event by event, with the rule by which ranges are dealt out
(session/parallel/ranges.cpp), the blocks whose films other ranks add up (session/parallel/collector.cpp), and with costs that were
measured where they can be.
"""

import argparse
import heapq
import math
import random

NODE_SECONDS = 2.0


class Rank:
    def __init__(self, speeds):
        self.speeds = speeds
        self.thread = 0.0  # when its thread has added up the films that it has
        self.merged = [[0.0, 0.0] for _ in speeds]  # the last two films of each device
        self.idle = list(range(len(speeds)))
        self.queue = []  # nodes with ranges that no device has begun
        self.mean = sum(speeds) / len(speeds)


class Block:
    def __init__(self, at, length, ranks):
        self.end, self.missing = at + length, length
        self.collector = ranks[1 + at // length % (len(ranks) - 1)] if len(ranks) > 1 else None


class Simulation:
    """ranks: how many devices each has; seconds: of a device for a range with its film; merge: of a thread that adds a film up; network: of a film from
    another rank; latency: of a message and its answer; spread: relative deviation of the speeds of devices; nodes: in a block."""

    def __init__(self, ranks, ranges, seconds, merge, network, latency, spread, nodes, rng):
        self.ranks = [Rank([seconds * (1 + spread * rng.uniform(-1, 1)) for _ in range(n)]) for n in ranks]
        self.ranges, self.merge, self.network, self.latency = ranges, merge, network, latency
        self.rate = sum(1 / s for r in self.ranks for s in r.speeds)
        self.nodes = nodes
        self.node_seconds = max(NODE_SECONDS, 2 * len(ranks) / nodes * (merge + network))
        self.block = None
        self.at, self.end, self.busy = 0, 0.0, 0.0
        self.events, self.order = [], 0

    def push(self, time, what, *arguments):
        self.order += 1
        heapq.heappush(self.events, (time, self.order, what, arguments))

    def run(self):
        for rank in self.ranks:
            self.push(0.0, self.ask, rank, False)
        while self.events:
            time, _, what, arguments = heapq.heappop(self.events)
            what(time, *arguments)
        return self.end, self.busy

    def on_first(self, time, seconds):
        first = self.ranks[0]
        first.thread = max(time, first.thread) + seconds
        self.busy += seconds
        self.end = max(self.end, first.thread)
        return first.thread

    def ask(self, time, rank, known):
        """A rank whose devices have nothing gets nodes for them."""
        time = self.on_first(time, 0.0)
        wanted, devices = len(rank.idle), len(rank.speeds)
        while wanted > 0 and self.at < self.ranges:
            left = self.ranges - self.at
            size = min(devices * self.node_seconds / rank.mean, 0.5 * devices * left / self.rate / rank.mean) if known else devices
            if not self.block or self.at == self.block.end:
                self.block = Block(self.at, self.cut(size * self.nodes, left), self.ranks)
            length = self.cut(size, self.block.end - self.at)
            if length == self.block.missing and self.at + length == self.block.end:
                self.block.collector = None
            self.at += length
            wanted -= length
            rank.queue.append([length, length, length, self.block])  # not begun, not finished, all
        idle, rank.idle = rank.idle, []
        for device in idle:
            self.begin(time + (self.latency if rank is not self.ranks[0] else 0), rank, device)

    def cut(self, size, left):
        most = int(min(max(size, 1), left))
        length = 1 << (most.bit_length() - 1)
        return min(length, self.at & -self.at) if self.at else length

    def begin(self, time, rank, device):
        if not rank.queue:
            rank.idle.append(device)
            return False
        node = rank.queue[0]
        node[0] -= 1
        if node[0] == 0:
            rank.queue.pop(0)
        self.push(time + rank.speeds[device], self.finish, rank, device, node)
        return True

    def finish(self, time, rank, device, node):
        time = max(time, rank.merged[device][0])  # it waits while two of its films are not added up
        rank.thread = max(time, rank.thread) + self.merge
        if rank is self.ranks[0]:
            self.busy += self.merge
        rank.merged[device] = [rank.merged[device][1], rank.thread]
        node[1] -= 1
        if node[1] == 0:
            self.push(rank.thread, self.arrive, rank, node)
        if not self.begin(time, rank, device) and self.at < self.ranges:
            self.push(time, self.ask, rank, True)

    def arrive(self, time, rank, node):
        """A film of a node: to the rank that collects its block, else to the first one."""
        block, collector = node[3], node[3].collector
        if collector is None:
            self.on_first(time, self.merge + (self.network if rank is not self.ranks[0] else 0))
            return
        received = max(time, collector.thread) + self.network
        rank.thread = max(rank.thread, received)
        collector.thread = received + self.merge
        block.missing -= node[2]
        if block.missing == 0:
            self.push(collector.thread, self.collected, collector)

    def collected(self, time, collector):
        collector.thread = max(collector.thread, self.on_first(time, self.network + self.merge) - self.merge)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--pixels", type=int, default=1920 * 1080)
    parser.add_argument("--render-seconds", type=float, default=600, help="of the whole render on one device")
    parser.add_argument("--ranges", type=int, default=128)
    parser.add_argument("--download", type=float, default=5e9, help="bytes/s of a film from a device")
    parser.add_argument("--merge", type=float, default=3e9, help="bytes/s of adding a film up (measured: merge_seconds)")
    parser.add_argument("--network", type=float, default=10e9, help="bytes/s into the first rank (measured: receive_seconds)")
    parser.add_argument("--latency", type=float, default=4e-3, help="seconds from a wish to the order")
    parser.add_argument("--spread", type=float, default=0.02, help="relative deviation of the speeds of devices")
    parser.add_argument("--per-rank", type=int, default=8, help="devices of a rank")
    parser.add_argument("--block-films", type=int, default=0, help="films that a rank adds up for the first one; 1: none; default: as the program")
    parser.add_argument("--devices", type=int, nargs="*", default=[1, 2, 4, 8, 16, 64, 128, 512])
    a = parser.parse_args()
    film = 48 * a.pixels
    rng = random.Random(1)
    print(f"film {film / 1e6:.0f} MB, {a.ranges} ranges of {a.render_seconds / a.ranges:.2f} s, {a.per_rank} devices a rank")
    print("| devices | seconds | efficiency | first rank busy |\n| --- | --- | --- | --- |")
    for devices in a.devices:
        ranks = [min(a.per_rank, devices - d) for d in range(0, devices, a.per_rank)]
        nodes = a.block_films or (1 if len(ranks) < 16 else 1 << (math.isqrt(len(ranks)).bit_length() - 1))
        runs = [
            Simulation(ranks, a.ranges, a.render_seconds / a.ranges + film / a.download, film / a.merge, film / a.network, a.latency, a.spread, nodes, rng).run()
            for _ in range(5)
        ]
        seconds = sum(r[0] for r in runs) / len(runs)
        busy = sum(r[1] / r[0] for r in runs) / len(runs)
        print(f"| {devices} | {seconds:.1f} | {a.render_seconds / devices / seconds:.3f} | {busy:.0%} |")


if __name__ == "__main__":
    main()
