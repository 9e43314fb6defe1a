"""python -m ambilux.analysis pack RESULTS -o FILE.zip: one file with all from which the figures can be made again."""

import argparse
import hashlib
import json
import sys
import zipfile
from pathlib import Path

from ambilux.analysis import experiment

DATE = (1980, 1, 1, 0, 0, 0)  # of every entry: the same results give the same bytes
LARGE = (".exr", ".png")
LEFT_OUT = {".lock"}


def sha256(path):
    digest = hashlib.sha256()
    with open(path, "rb") as file:
        for block in iter(lambda: file.read(1 << 20), b""):
            digest.update(block)
    return digest.hexdigest()


def members(data, images):
    """(name in the archive, path) of what is packed: results and references, also those that lie elsewhere. Figures are left out: they are made again."""
    folder = data.folder
    names = ["config.resolved.toml", "manifest.json", "runs.csv", "batches.csv", "peers.json"]
    found = [(name, folder / name) for name in names if (folder / name).is_file()]
    for place in ("stats", "images", "techniques", "references"):
        found += [(p.relative_to(folder).as_posix(), p) for p in sorted((folder / place).rglob("*")) if p.is_file() and p.name not in LEFT_OUT]
    packed = {path for _, path in found}
    elsewhere = {path for scene in data.scenes if (path := data.reference(scene)) is not None and path not in packed}
    found += [(f"references/{path.name}", path) for path in sorted(elsewhere)]
    return [(name, path) for name, path in found if images or path.suffix not in LARGE]


def references(data):
    """{scene: file and hash} of the references, packed or not."""
    return {scene: {"file": str((data.scene_entry(scene).get("reference") or {}).get("file")), "sha256": sha256(path)}
            for scene in data.scenes if (path := data.reference(scene)) is not None}


def commands(data):
    """What was run, as the manifest recorded it, and what makes every figure again."""
    recorded = data.manifest.get("commands") or []
    return [*recorded, "python -m ambilux.analysis FOLDER -o FOLDER/figures   # FOLDER: where this archive was unpacked"]


def pack(results, out, images=True):
    """Writes the archive and returns its list of contents."""
    data = experiment.load(results)
    files = members(data, images)
    contents = {"experiment": data.name, "format": data.manifest.get("format", 1), "revision": (data.manifest.get("versions") or {}).get("git_revision"),
                "images": images, "commands": commands(data), "references": references(data), "files": {name: sha256(path) for name, path in files}}
    temporary = out.with_name(out.name + ".part")
    with zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED) as archive:
        def add(name, content):
            archive.writestr(zipfile.ZipInfo(name, DATE), content, compress_type=zipfile.ZIP_DEFLATED)
        add("contents.json", json.dumps(contents, indent=2, ensure_ascii=False) + "\n")
        for name, path in files:
            add(name, path.read_bytes())
    temporary.replace(out)
    return contents


def main(arguments):
    parser = argparse.ArgumentParser(prog="python -m ambilux.analysis pack", description="One file with configuration, manifest, results, hashes of references and commands.")
    parser.add_argument("results", type=Path, help="folder that `ambilux experiment` wrote")
    parser.add_argument("-o", "--output", type=Path, required=True, help="archive to write (.zip)")
    parser.add_argument("--no-images", action="store_true", help="leave images out; figures that show them cannot be made again then")
    options = parser.parse_args(arguments)
    if options.output.is_dir():
        parser.error(f"{options.output} is a folder; name the archive")
    try:
        contents = pack(options.results, options.output, not options.no_images)
    except experiment.InputError as e:
        print(f"error: {e}", file=sys.stderr)
        return 3
    except OSError as e:
        print(f"error: {e.filename or options.output}: {e.strerror}", file=sys.stderr)
        return 4
    print(f"{len(contents['files'])} files of {contents['experiment']} in {options.output}")
    return 0
