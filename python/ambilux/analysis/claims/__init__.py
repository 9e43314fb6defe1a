"""Published claims beside what this program measures: python -m ambilux.analysis.claims run|page, by scripts/claims.sh (docs/experiments.md, "Claims")."""
