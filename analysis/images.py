"""Pictures for people: tone mapping of recorded images and maps of their error. No figure of the table is computed here."""

import base64
import io

import numpy as np
import OpenEXR
from matplotlib import colormaps
from PIL import Image

ERROR_COLOURS = "magma"
LARGEST_WIDTH = 800  # of an embedded picture, pixels


def read_exr(path):
    """R, G, B of an OpenEXR file as float32, shape (height, width, 3). Linear Rec.709."""
    channels = OpenEXR.File(str(path), separate_channels=True).channels()
    return np.stack([np.asarray(channels[c].pixels, dtype=np.float32) for c in "RGB"], axis=-1)


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
    """|x - r| / (|r| + 0.01), the summand of MAPE (design.md, section 5), averaged over the channels. Shape (height, width)."""
    return (np.abs(image - reference) / (np.abs(reference) + 0.01)).mean(axis=2)


def colour_map(values, highest):
    """8-bit colours of values in [0, highest]; above it, and NaN, as the last colour."""
    return (colormaps[ERROR_COLOURS](np.nan_to_num(values / highest, nan=1.0, posinf=1.0).clip(0, 1))[..., :3] * 255 + 0.5).astype(np.uint8)


def colour_bar_css():
    """CSS gradient of the error map's colours, from 0 at the left."""
    stops = [tuple(int(255 * c + 0.5) for c in colormaps[ERROR_COLOURS](t)[:3]) for t in np.linspace(0, 1, 9)]
    return "linear-gradient(to right, " + ", ".join(f"rgb{s}" for s in stops) + ")"


def png_uri(pixels):
    """data: URI of 8-bit RGB pixels as PNG, made smaller where wider than LARGEST_WIDTH."""
    picture = Image.fromarray(pixels)
    if picture.width > LARGEST_WIDTH:
        picture = picture.resize((LARGEST_WIDTH, max(1, round(picture.height * LARGEST_WIDTH / picture.width))), Image.Resampling.BOX)
    buffer = io.BytesIO()
    picture.save(buffer, "PNG", optimize=True)
    return "data:image/png;base64," + base64.b64encode(buffer.getvalue()).decode()
