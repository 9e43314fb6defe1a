"""Images in a compact form that a page can show at any exposure: half floats, in byte planes, deflated, in base64."""

import base64
import zlib

import numpy as np

LARGEST_WIDTH = 1280  # pixels of an embedded image; wider ones are averaged over blocks
LARGEST_PAGE = 10e6   # pixels of all images of a page together: about 60 MB of HTML, which browsers open at once


def shrink(image, factor):
    """Means over blocks of factor x factor pixels; what is left at the edges is cut off. Means of radiance are right, of errors they are not:
    maps of a shrunk image are of the shrunk image."""
    if factor == 1:
        return image
    height, width = (n // factor * factor for n in image.shape[:2])
    return image[:height, :width].reshape(height // factor, factor, width // factor, factor, -1).mean(axis=(1, 3)).astype(np.float32)


def factor_for(width, height=1, count=1):
    """Side of the blocks over which an image is averaged, if the page holds `count` images as large."""
    factor = max(1, -(-width // LARGEST_WIDTH))
    while count * (width // factor) * (height // factor) > LARGEST_PAGE and factor < min(width, height):
        factor += 1
    return factor


def deflate(raw):
    return base64.b64encode(zlib.compress(raw, 9)).decode()


def encode(image):
    """Half floats (IEEE 754 binary16) of an image of shape (height, width, 3), as base64 of zlib of two planes: all low bytes, then all high bytes, channels
    one after the other. Values above the largest half are cut to it; NaN stays NaN. A relative error of 2^-11 at most, below what 8 bits show.
    """
    half = np.clip(image, -65504, 65504).astype("<f2")  # clip keeps NaN
    data = np.ascontiguousarray(half.transpose(2, 0, 1)).view(np.uint8).reshape(-1, 2)
    return deflate(data.T.tobytes())


def decode(text, height, width):
    """What the page does, for tests. Shape (height, width, 3), float32."""
    planes = np.frombuffer(zlib.decompress(base64.b64decode(text)), dtype=np.uint8).reshape(2, -1)
    return np.ascontiguousarray(planes.T).view("<f2").reshape(3, height, width).transpose(1, 2, 0).astype(np.float32)
