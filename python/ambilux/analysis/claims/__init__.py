"""Published claims beside what this program measures, by scripts/claims.sh (docs/claims.md)."""
