"""Images as numbers and as pictures: reading, tone mapping, maps of their error. No figure of the table is computed here."""

import base64
import io

import numpy as np
import OpenEXR
from matplotlib import colormaps
from PIL import Image

from ambilux.analysis.experiment import InputError
from ambilux.analysis.style import ERROR_COLOURS


def read_exr(path):
    """R, G, B of an OpenEXR file as float32, shape (height, width, 3). Linear Rec.709. Throws InputError."""
    try:
        channels = OpenEXR.File(str(path), separate_channels=True).channels()
    except Exception as e:  # the binding throws plain RuntimeError and others, by version
        raise InputError(f"{path}: cannot be read as OpenEXR, it may be half-written: {e}") from None
    missing = [c for c in "RGB" if c not in channels]
    if missing:
        raise InputError(f"{path}: lacks the channel{'s' if len(missing) > 1 else ''} {', '.join(missing)}")
    return np.stack([np.asarray(channels[c].pixels, dtype=np.float32) for c in "RGB"], axis=-1)


def read_like(path, reference):
    """read_exr of an image that must have the reference's size."""
    image = read_exr(path)
    if image.shape != reference.shape:
        raise InputError(f"{path}: is {image.shape[1]}x{image.shape[0]}, its reference {reference.shape[1]}x{reference.shape[0]}")
    return image


BLACK = 1.3e-7


def is_black(image):
    """Whether no luminance is above BLACK."""
    return not (np.nan_to_num(image, posinf=0.0) @ np.array([0.2126, 0.7152, 0.0722])).max() > BLACK


def exposure(reference):
    """Factor that puts the 95th percentile of the reference's luminance (Rec.709 weights) at 0.8; 1 for a black image."""
    level = float(np.percentile(reference @ np.array([0.2126, 0.7152, 0.0722]), 95))
    return 0.8 / level if level > 0 else 1.0


def tone_map(image, factor):
    """8-bit sRGB (IEC 61966-2-1) of `factor` times a linear image; what is above 1 is cut, NaN is magenta."""
    x = np.clip(np.nan_to_num(image * factor), 0, 1)
    encoded = np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)
    encoded[~np.isfinite(image).all(axis=2)] = (1, 0, 1)
    return (encoded * 255 + 0.5).astype(np.uint8)


def relative_error(image, reference):
    """|x - r| / (|r| + 0.01), the summand of MAPE (film/metrics.h), averaged over the channels. Shape (height, width)."""
    return (np.abs(image - reference) / (np.abs(reference) + 0.01)).mean(axis=2)


def signed_error(image, reference):
    """(x - r) / (|r| + 0.01), averaged over the channels: positive where the image is too bright. Shape (height, width)."""
    return ((image - reference) / (np.abs(reference) + 0.01)).mean(axis=2)


def block_means(values, block):
    """Means over blocks of block x block of a map, shape (ceil(height / block), ceil(width / block)); those at the edge are of what is there."""
    rows, columns = (np.arange(0, n, block) for n in values.shape)
    sums = np.add.reduceat(np.add.reduceat(values, rows, axis=0), columns, axis=1)
    return sums / np.add.reduceat(np.add.reduceat(np.ones_like(values), rows, axis=0), columns, axis=1)


def highest_of(maps, percentile=99):
    """End of a colour scale common to several maps: the brightest part is cut, so that single pixels do not darken all others."""
    finite = np.concatenate([m[np.isfinite(m)].ravel() for m in maps])
    return max(1e-6, float(np.percentile(finite, percentile))) if len(finite) else 1.0


def colour_map(values, highest):
    """8-bit colours of values in [0, highest]; above it, and NaN, as the last colour."""
    return (colormaps[ERROR_COLOURS](np.nan_to_num(values / highest, nan=1.0, posinf=1.0).clip(0, 1))[..., :3] * 255 + 0.5).astype(np.uint8)


def png_uri(pixels):
    """data: URI of 8-bit RGB pixels as PNG."""
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, "PNG", optimize=True)
    return "data:image/png;base64," + base64.b64encode(buffer.getvalue()).decode()
