"""What stands behind the figures of the documentation: how each table is measured, what was measured, and the pages (scripts/evidence.sh)."""
