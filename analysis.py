"""Where the analysis went: `python -m analysis`, as it was called, says so."""
import sys

print("the analysis is now a part of the package ambilux: python -m ambilux.analysis", file=sys.stderr)
sys.exit(2)
