"""Where the time goes, and what single steps cost: `python -m benchmarks.profile [--chain] [--prices]`.

Run it alone on the machine. The chain is measured on one rank and on two, each in processes of its own.
"""

from __future__ import annotations

import argparse

from benchmarks.plan import Run
from benchmarks.prices import coarse_prices, subdomain_prices
from benchmarks.report import phases_table
from benchmarks.row import Summaries
from benchmarks.running import measure
from benchmarks.summary import summarise


def chain_profile(repeats: int = 3) -> str:
    """Return a table of the seconds by phase of the paper's chain on one rank and on two."""
    runs = (Run("chain-1-rank", "chain", 1), Run("chain", "chain", 2))
    summaries = Summaries({r.name: summarise(r.name, [measure(r) for _ in range(repeats)]) for r in runs})
    return phases_table(summaries)


def main() -> None:
    """Print the tables that the command line asks for, all by default."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.profile", description=__doc__)
    parser.add_argument("--chain", action="store_true", help="the paper's chain by phase on 1 and 2 ranks")
    parser.add_argument("--prices", action="store_true", help="what a subdomain and the coarse problem cost")
    settings = parser.parse_args()
    everything = settings.chain == settings.prices
    if settings.chain or everything:
        print(f"\nThe paper's chain\n\n{chain_profile()}", flush=True)
    if settings.prices or everything:
        print(f"\nOne subdomain on one core\n\n{subdomain_prices()}", flush=True)
        print(f"\nCoarse problem on one core\n\n{coarse_prices()}", flush=True)


if __name__ == "__main__":
    main()
