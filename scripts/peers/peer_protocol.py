"""How an experiment talks to a peer: one JSON object a line on standard input and output, images in a file.

A script calls serve(start). start(job) loads the scene and returns (what it is, render); render(seed, samples) returns an image of
height x width x 3 floats, the seconds that rendering took and, if they are others than asked for, the samples; then True, if the image is a difference
of sums, which may be negative. What the peer itself prints goes to standard error. While start works it may say how far it is by progress(text).
"""

import json
import os
import sys
import time


class Missing(Exception):
    """The peer is not installed."""


class Refused(Exception):
    """What the peer cannot do, by name."""


_answers = None


def answer(**what):
    _answers.write(json.dumps(what) + "\n")
    _answers.flush()


def progress(text):
    """A line for who waits; also in the peer's log."""
    print(text, file=sys.stderr, flush=True)
    if _answers:
        answer(progress=clean(text))


def clean(error):
    return " ".join(str(error).split()) or type(error).__name__


def serve(start, whole=False):
    """whole: render takes the request as it is, with the number of its first sample."""
    # Libraries print to descriptor 1: the lines of the protocol get another one.
    global _answers
    _answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    with open(sys.argv[1], encoding="utf-8") as file:
        job = json.load(file)
    begin = time.perf_counter()
    try:
        ready, render = start(job)
    except Missing as error:
        return answer(missing=clean(error))
    except Exception as error:  # whatever the library throws is why it does not take part
        return answer(refused=clean(error))
    ready["load_seconds"] = time.perf_counter() - begin - ready["compile_seconds"]
    answer(ready=ready)
    for line in sys.stdin:
        request = json.loads(line)
        try:
            image, seconds, *rest = render(request) if whole else render(request["seed"], request["samples"])
        except Exception as error:
            answer(refused=clean(error))
            continue
        with open(os.path.join(job["folder"], "pass.f32"), "wb") as file:
            file.write(image.astype("<f4", copy=False).tobytes())
        answer(seconds=seconds, samples=rest[0] if rest else request["samples"], signed=bool(rest[1:] and rest[1]))
