"""Runs a program that builds kernels, with its log, a word for who waits, and a limit of time.

LuxCore holds Python's lock while it compiles: no thread of the same process could stop it, or say anything.
"""

import collections
import os
import selectors
import signal
import subprocess
import sys
import time

from peer_protocol import Refused, progress

LAST_LINES = 3


def log_line(begin, text):
    print(f"[{time.monotonic() - begin:7.1f} s] {text}", file=sys.stderr, flush=True)


def run(command, limit, what, every=10.0):
    """Seconds until the end of `command`. Refused, with its last lines, if it fails or is not done after `limit` seconds."""
    begin = time.monotonic()
    lines = collections.deque(maxlen=LAST_LINES)

    def refused(why):
        return Refused(f"{what}: {why}; the last lines of its log: {' | '.join(lines)}")

    def take(texts):
        for line in (text.decode(errors="replace").strip() for text in texts):
            if line:
                log_line(begin, line)
                lines.append(line)

    child = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    pending, told, open_ = b"", begin, True
    try:
        with selectors.DefaultSelector() as ready:
            ready.register(child.stdout, selectors.EVENT_READ)
            while open_:
                now = time.monotonic()
                if now - begin > limit:
                    raise refused(f"not done after {limit:g} s")
                if now - told >= every:
                    told = now
                    progress(f"{what}, {now - begin:.0f} s of at most {limit:g} s")
                if ready.select(min(1.0, every)):
                    text = os.read(child.stdout.fileno(), 65536)
                    open_ = bool(text)
                    *whole, pending = (pending + text).split(b"\n")
                    take(whole if open_ else [*whole, pending])
        status = child.wait(timeout=max(1.0, begin + limit - time.monotonic()))
    except subprocess.TimeoutExpired:
        raise refused(f"not done after {limit:g} s") from None
    finally:
        child.kill()
        child.wait()
        child.stdout.close()
    if status != 0:
        raise refused(f"ended with signal {signal.Signals(-status).name}" if status < 0 else f"ended with status {status}")
    return time.monotonic() - begin
