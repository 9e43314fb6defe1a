"""Packs Mitsuba and LuxCore for a machine without network: wheels of another Python, less what rendering does not need, as .tar.xz.

    scripts/peers/peers_pack.py FOLDER [--python 3.12] [--most-mb 60] [PACKAGE ...]        mitsuba and pyluxcore, or one of them

On the other machine, which has NumPy:
    mkdir site; tar -xf mitsuba.tar.xz -C site; tar -xf pyluxcore.tar.xz -C site
    PYTHONPATH=$PWD/site AMBILUX_PEERS_PYTHON=python3 ambilux experiment experiments/peers_device.toml -o out/peers
"""

import argparse
import io
import re
import subprocess
import sys
import tarfile
import tempfile
import zipfile
import zlib
from pathlib import Path

PACKAGES = {"mitsuba": ("mitsuba", "drjit"), "pyluxcore": ("pyluxcore",)}
VARIANTS = ("scalar_rgb", "llvm_ad_rgb", "cuda_ad_rgb")
PLATFORMS = ("manylinux_2_28_x86_64", "manylinux_2_27_x86_64", "manylinux2014_x86_64", "any")
PAGE = 4096
RANDOM = 0.85  # of a page that zlib cannot make smaller than this


def is_needed(name):
    """Kernels of other variants, test scenes and headers are not."""
    if name.startswith(("pyluxcoretest/", "mitsuba/include/", "drjit/include/")) or "/tests/" in name:
        return False
    module = re.match(r"mitsuba/(\w+)\.cpython-", name)
    return not module or module[1] in VARIANTS or not re.match(r"(scalar|llvm|cuda)_", module[1])


def without_weights(data):
    """A denoiser that is linked and never run: pages of its networks' weights, the only ones that do not compress, become zeros."""
    pages = [data[i:i + PAGE] for i in range(0, len(data), PAGE)]
    return b"".join(bytes(len(p)) if len(zlib.compress(p, 1)) > RANDOM * len(p) else p for p in pages)


def download(names, python, folder):
    platforms = [word for p in PLATFORMS for word in ("--platform", p)]
    subprocess.run([sys.executable, "-m", "pip", "download", "--quiet", "--disable-pip-version-check", "--no-deps", "--only-binary=:all:", "--python-version", python,
                    "--implementation", "cp", *platforms, "-d", str(folder), *names], check=True)
    return sorted(Path(folder).glob("*.whl"))


def pack(wheels, path):
    with tarfile.open(path, "w:xz", preset=6) as archive:
        for wheel in wheels:
            with zipfile.ZipFile(wheel) as content:
                for entry in content.infolist():
                    if entry.is_dir() or not is_needed(entry.filename):
                        continue
                    data = content.read(entry)
                    if "OpenImageDenoise_core" in entry.filename:
                        data = without_weights(data)
                    info = tarfile.TarInfo(entry.filename)
                    info.size, info.mode = len(data), 0o755 if ".so" in entry.filename else 0o644
                    archive.addfile(info, io.BytesIO(data))


def main():
    parser = argparse.ArgumentParser(description="Packs other renderers for a machine without network.")
    parser.add_argument("folder", type=Path)
    parser.add_argument("packages", nargs="*", choices=[*PACKAGES, []], default=[])
    parser.add_argument("--python", default="3.12", help="version of the other machine's Python")
    parser.add_argument("--most-mb", type=float, default=60)
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    for name in options.packages or PACKAGES:
        path = options.folder / f"{name}.tar.xz"
        with tempfile.TemporaryDirectory() as folder:
            pack(download(PACKAGES[name], options.python, folder), path)
        size = path.stat().st_size / 1e6
        print(f"{path}: {size:.1f} MB")
        if size > options.most_mb:
            print(f"peers_pack: that is more than {options.most_mb:g} MB", file=sys.stderr)
            return 3
    return 0


if __name__ == "__main__":
    sys.exit(main())
