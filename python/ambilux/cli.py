"""The program `ambilux`, from the module."""

import sys

from ambilux import _core


def main() -> int:
    return _core.main(["ambilux", *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
