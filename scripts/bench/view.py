#!/usr/bin/env python3
"""Pictures of `ambilux view` as a client on the same machine gets them (docs/view.md): how many a second, how large, and how long after a camera move.

    scripts/bench/view.py PROGRAM SCENE... [--backend cuda] [--size 1920x1080] [--methods path "bdpt lvc"] [--formats jpeg rgb] [--json OUT.json]

Of each scene and method, in a table: pictures a second and kB a picture while the camera stands; pictures a second, and their size, while it is dragged with 60 moves
a second; milliseconds from a move to its picture, median and 95th percentile; and what these are made of, medians: the renderer's new start, the first sample, the
picture with its way to the host, and the JPEG. What is left of the latency is the render that was under way, the way through the socket and this client.
"""

import http.client
import json
import math
import pathlib
import random
import re
import signal
import statistics
import struct
import subprocess
import sys
import threading
import time

from scenes_and_methods import name_of, parser_for, settings_of

PARTS = ("restart", "first_sample", "picture", "jpeg")


class Viewer:
    """A process that serves a scene; two connections, as a page has them."""

    def __init__(self, program, scene, backend, size, more):
        command = [program, "view", scene, "--backend", backend, "--size", size, "--port", "0", *more]
        self.process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
        said = []
        for line in self.process.stderr:
            said.append(line.strip())
            if found := re.search(r"http://([\d.]+):(\d+)/", line):
                break
        else:
            raise SystemExit(f"{scene}: {' '.join(said) or 'it said nothing'}")
        threading.Thread(target=self.process.stderr.read, daemon=True).start()
        self.gets, self.posts = (http.client.HTTPConnection(found[1], int(found[2]), timeout=60) for _ in range(2))

    def post(self, path, value):
        """The number of what was asked for."""
        self.posts.request("POST", path, json.dumps(value).encode())
        answer = self.posts.getresponse()
        told = json.loads(answer.read())
        if answer.status != 200:
            raise SystemExit(f"{path} {value}: {told['error']}")
        return told["asked"]

    def get(self, path):
        self.gets.request("GET", path)
        return self.gets.getresponse().read()

    def frame(self, after, form):
        """Facts of the first frame after `after`, and its bytes with all that came."""
        while not (body := self.get(f"/frame?after={after}{'&as=jpeg' if form == 'jpeg' else ''}")):
            pass
        length, = struct.unpack_from("<I", body)
        facts = json.loads(body[4:4 + length])
        if facts["problem"]:
            raise SystemExit(facts["problem"])
        return facts, len(body)

    def close(self):
        self.process.send_signal(signal.SIGINT)
        self.process.wait(timeout=60)


def turned(camera, degrees):
    """The camera, turned around its target and its up."""
    arm = [o - t for o, t in zip(camera["origin"], camera["target"])]
    axis, c, s = camera["up"], math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    along = sum(a * b for a, b in zip(axis, arm))
    cross = [axis[1] * arm[2] - axis[2] * arm[1], axis[2] * arm[0] - axis[0] * arm[2], axis[0] * arm[1] - axis[1] * arm[0]]
    arm = [c * a + s * x + (1 - c) * along * u for a, x, u in zip(arm, cross, axis)]
    return {**camera, "origin": [t + a for t, a in zip(camera["target"], arm)]}


def still(viewer, form, seconds):
    """Pictures a second and bytes a picture."""
    after, count, size, start = viewer.frame(0, form)[0]["frame"], 0, 0, time.perf_counter()
    while (now := time.perf_counter()) - start < seconds:
        facts, got = viewer.frame(after, form)
        after, count, size = facts["frame"], count + 1, size + got
    return count / (now - start), size / max(1, count)


def dragged(viewer, form, seconds, camera):
    """Pictures a second and the width of the last one, while the camera moves 60 times a second."""
    ends = time.perf_counter() + seconds

    def drag():
        for k in range(1 << 30):
            if time.perf_counter() > ends:
                break
            viewer.post("/camera", {**turned(camera, 10 * math.sin(k / 20)), "moving": True})
            time.sleep(1 / 60)

    thread = threading.Thread(target=drag)
    thread.start()
    after, count, asked, width = viewer.frame(0, form)[0]["frame"], 0, 0, 0
    while time.perf_counter() < ends:
        facts, _ = viewer.frame(after, form)
        after, width = facts["frame"], facts["width"]
        count += facts["asked"] > asked  # each shows a camera that none before did
        asked = facts["asked"]
    thread.join()
    return count / seconds, width


def latencies(viewer, form, moves, camera):
    """Seconds from each move to its picture, and the medians of their parts."""
    found, parts, after = [], [], 0
    for k in range(moves):
        time.sleep(random.uniform(0.05, 0.1))
        start = time.perf_counter()
        asked = viewer.post("/camera", {**turned(camera, 10 * math.sin(k / 5)), "moving": True})
        while (facts := viewer.frame(after, form)[0])["asked"] < asked:
            after = facts["frame"]
        after = facts["frame"]
        found.append(time.perf_counter() - start)
        parts.append(facts["picture_seconds"])
    return sorted(found), {p: statistics.median(x.get(p, 0) for x in parts) for p in PARTS}


def measure(viewer, method, form, a):
    camera = json.loads(viewer.get("/scene"))["camera"]
    viewer.post("/method", settings_of(method))
    asked = viewer.post("/camera", {"reset": True})
    start, after = time.perf_counter(), 0
    while (facts := viewer.frame(after, form)[0])["asked"] < asked or facts["samples"] < 2:
        after = facts["frame"]
    first = time.perf_counter() - start
    rate, size = still(viewer, form, a.seconds)
    # A first move finds out how large pictures of a moving camera may be.
    viewer.post("/camera", {**turned(camera, 1), "moving": True})
    drag_rate, width = dragged(viewer, form, a.seconds, camera)
    times, parts = latencies(viewer, form, a.moves, camera)
    late = times[min(len(times) - 1, math.ceil(0.95 * len(times)) - 1)]
    return {"method": method, "format": form, "first_seconds": first, "pictures_per_second": rate, "bytes": size, "dragged_pictures_per_second": drag_rate,
            "dragged_width": width, "latency_median": statistics.median(times), "latency_95": late, "parts": parts}


def main():
    parser = parser_for(__doc__, methods=True)
    parser.add_argument("--formats", nargs="+", default=["jpeg"], choices=["jpeg", "rgb"])
    parser.add_argument("--seconds", type=float, default=3, help="of each of the two rates")
    parser.add_argument("--moves", type=int, default=40, help="of the latency")
    parser.add_argument("--json", help="write all figures to this file")
    parser.add_argument("--max-depth", default="8")
    a = parser.parse_args()
    print(f"| scene, {a.size} | method | format | pictures/s | kB | dragged/s, width | ms to a picture, 95 % | " + " + ".join(PARTS) + " ms |\n" + "| --- " * 8 + "|")
    rows = []
    for scene in a.scenes:
        viewer = Viewer(a.program, scene, a.backend, a.size, ["--max-depth", a.max_depth])
        for method in a.methods:
            for form in a.formats:
                m = {"scene": name_of(scene), **measure(viewer, method, form, a)}
                rows.append(m)
                print(f"| {m['scene']} | {method} | {form} | {m['pictures_per_second']:.1f} | {m['bytes'] / 1000:.0f} | "
                      f"{m['dragged_pictures_per_second']:.1f}, {m['dragged_width']} | {1000 * m['latency_median']:.0f}, {1000 * m['latency_95']:.0f} | "
                      + " + ".join(f"{1000 * m['parts'][p]:.1f}" for p in PARTS) + " |", flush=True)
        viewer.close()
    if a.json:
        pathlib.Path(a.json).write_text(json.dumps(rows, indent=1) + "\n")


if __name__ == "__main__":
    sys.exit(main())
