"""Benchmarks: what the solver costs, beside what a user would write instead. See README.md."""
