#!/usr/bin/env python3
"""What one render over many devices would take, on machines that are not here (docs/scaling.md).

Simulates the first rank and its devices event by event, with the rule by which ranges are dealt out
(experiments/parallel/ranges.cpp) and with costs that were measured where they can be.
"""

import argparse
import heapq
import random

NODE_SECONDS = 2.0


def simulate(devices, ranges, per_range, film_seconds, handle_seconds, latency, remote, rng, spread):
    """Seconds until all films are added up; the seconds of the first rank that were spent on films.

    per_range: seconds of a device for a range; film_seconds: that it waits for its film; handle_seconds: of the first
    rank for a film that arrives; latency: from a film to the next order; spread: relative deviation of device speeds.
    """
    speeds = [per_range * (1 + spread * rng.uniform(-1, 1)) for _ in range(devices)]
    rate = sum(1 / (s + film_seconds) for s in speeds)
    node_seconds = max(NODE_SECONDS, 2 * devices * handle_seconds)
    at, free_at, busy = 0, 0.0, 0.0

    def deal(worker, known):
        nonlocal at
        if at >= ranges:
            return 0
        seconds = speeds[worker] + film_seconds
        wanted = min(node_seconds / seconds, 0.5 * (ranges - at) / rate / seconds) if known else 1
        most = int(min(max(wanted, 1), ranges - at))
        length = 1 << (most.bit_length() - 1)
        if at:
            length = min(length, at & -at)
        at += length
        return length

    events = []
    for worker in range(devices):
        if length := deal(worker, False):
            heapq.heappush(events, (latency + length * (speeds[worker] + film_seconds), worker))
    end = 0.0
    while events:
        time, worker = heapq.heappop(events)
        begin = max(time, free_at)  # the first rank handles one film after the other
        free_at = begin + handle_seconds
        busy += handle_seconds
        end = max(end, free_at)
        if length := deal(worker, True):
            wait = latency if remote else 0
            heapq.heappush(events, (free_at + wait + length * (speeds[worker] + film_seconds), worker))
    return end, busy


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--pixels", type=int, default=1920 * 1080)
    parser.add_argument("--render-seconds", type=float, default=600, help="of the whole render on one device")
    parser.add_argument("--ranges", type=int, default=128)
    parser.add_argument("--download", type=float, default=5e9, help="bytes/s of a film from a device")
    parser.add_argument("--merge", type=float, default=3e9, help="bytes/s of adding a film up (measured: merge_seconds)")
    parser.add_argument("--network", type=float, default=10e9, help="bytes/s into the first rank (measured: receive_seconds)")
    parser.add_argument("--latency", type=float, default=4e-3, help="seconds from a film to the next order")
    parser.add_argument("--spread", type=float, default=0.02, help="relative deviation of the speeds of devices")
    parser.add_argument("--devices", type=int, nargs="*", default=[1, 2, 4, 8, 16, 64, 128, 512])
    a = parser.parse_args()
    film = 48 * a.pixels
    rng = random.Random(1)
    print(f"film {film / 1e6:.0f} MB, {a.ranges} ranges of {a.render_seconds / a.ranges:.2f} s")
    print("| devices | seconds | efficiency | first rank busy |\n| --- | --- | --- | --- |")
    for devices in a.devices:
        remote = devices > 8
        handle = film / a.merge + (film / a.network if remote else 0)
        runs = [simulate(devices, a.ranges, a.render_seconds / a.ranges, film / a.download, handle, a.latency, remote, rng, a.spread)
                for _ in range(20)]
        seconds = sum(r[0] for r in runs) / len(runs)
        busy = sum(r[1] / r[0] for r in runs) / len(runs)
        print(f"| {devices} | {seconds:.1f} | {a.render_seconds / devices / seconds:.3f} | {busy:.0%} |")


if __name__ == "__main__":
    main()
