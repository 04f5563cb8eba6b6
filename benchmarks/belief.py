"""How much a guard believes in the class that the tether is truly in, with noise and drift.

    python benchmarks/belief.py [--times 4] [--jobs 2] [--keep]

The recorded flights in `tests/data/ardusub` and random pilots' drives, with white noise of 0.3 m
and a drift of 0.5 m put on them. Every second the share of the true class is asked: that of the
letters which the true path has written, moved straight to where the guard believes the robot to
be.
"""

from __future__ import annotations

import argparse
from concurrent.futures import ProcessPoolExecutor

import numpy as np
from guard_tracks import DRIFT, DT, NOISE, SPEED, drifted, track_of
from table import head, heading, row

from netsp.online.guard.telemetry import Fix
from netsp.online.guard.tether_guard import Guard, GuardOptions

NAMES = ("wharf", "pool", "oc4-jacket", "random-11", "harbour-31")
LITTLE = 0.05
LEAST = 1e-3


def shares_of_truth(kind: str, seed: int, noise_seed: int) -> np.ndarray:
    """(n,) the share of the true class, once a second."""
    problem, true = track_of(kind, seed)
    rng = np.random.default_rng([seed, len(kind), noise_seed])
    told = drifted(true, rng, rng.normal(0.0, DRIFT, 2) * 0.3)
    guard = Guard(problem, GuardOptions(NOISE, DRIFT, SPEED))
    letters, word, out = guard.site.letters, (), []
    for k in range(len(true)):
        if k:
            (step,) = letters.words_of_steps(true[k - 1][None], true[k][None])
            word = letters.join(word, step or ())
        guard.update(Fix(k * DT, tuple(told[k]), estimate=True))
        if k % round(1.0 / DT) or not guard.strands.all:
            continue
        share = 0.0
        for strand in guard.strands.all:
            (way,) = letters.words_of_steps(true[k][None], strand.tether.robot[None])
            share += strand.likely * (letters.join(word, way or ()) == strand.word)
        out.append(share)
    return np.array(out)


def job(task: tuple[str, int, int]) -> np.ndarray:
    return shares_of_truth(*task)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--times", type=int, default=4)
    parser.add_argument("--jobs", type=int, default=2)
    args = parser.parse_args()
    heading("What a guard believes")
    head("track", "times", "share of the true class, mean",
         "likelier than all others, % of the time",
         "below 5 %, % of the time", "mean −log share", "below 5 % at the end",
         name="guard-belief")  # fmt: skip
    tracks = [("recorded", seed, name) for seed, name in enumerate(NAMES)]
    tracks += [("pilot", seed, f"a pilot, {seed}") for seed in range(4)]
    tasks = [(kind, seed, n) for kind, seed, _ in tracks for n in range(args.times)]
    with ProcessPoolExecutor(args.jobs) as pool:
        found = dict(zip(tasks, pool.map(job, tasks), strict=True))
    for kind, seed, name in tracks:
        runs = [found[kind, seed, n] for n in range(args.times)]
        every = np.concatenate(runs)
        row(name, str(len(runs)), f"{every.mean():.2f}", f"{100 * (every > 0.5).mean():.0f}",
            f"{100 * (every < LITTLE).mean():.1f}",
            f"{abs(np.log(np.clip(every, LEAST, 1.0)).mean()):.2f}",
            f"{sum(r[-1] < LITTLE for r in runs)} of {len(runs)}")  # fmt: skip
    print()


if __name__ == "__main__":
    main()
