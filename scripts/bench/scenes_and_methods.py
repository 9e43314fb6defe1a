"""What the scripts here that take a program and scenes have in common."""

import argparse
import pathlib


def parser_for(description, methods=False, scenes=None):
    """PROGRAM SCENE... --backend --size, and --methods where there are any. `scenes`: instead of none."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("scenes", nargs="*" if scenes else "+", default=scenes)
    parser.add_argument("--backend", default="cuda")
    parser.add_argument("--size", default="1920x1080")
    if methods:
        parser.add_argument("--methods", nargs="+", default=["path", "bdpt lvc connections=1"])
    return parser


def name_of(scene):
    """Of a file, or of its folder where the file is called scene."""
    path = pathlib.Path(scene)
    return path.parent.name if path.stem == "scene" else path.stem


def settings_of(method):
    """Of "bdpt lvc connections=1": [("integrator", "bdpt"), ("variant", "lvc"), ("connections", "1")]."""
    integrator, *more = method.split()
    return [("integrator", integrator)] + [tuple(word.split("=", 1)) if "=" in word else ("variant", word) for word in more]
