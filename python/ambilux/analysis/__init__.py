"""Figures, tables and a report from the folder that `ambilux experiment` writes.

It shows what the runner recorded and never recomputes it: every error figure comes from runs.csv.
"""
