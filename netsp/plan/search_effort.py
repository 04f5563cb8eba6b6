"""Number of rounds of local search before a proof, by the size of the problem."""

from __future__ import annotations

from dataclasses import dataclass

from netsp.base.number_ranges import check_not_negative


@dataclass(frozen=True)
class SearchEffort:
    """Number of rounds of ruin and recreate in one search of `auto`.

    A proof of a small problem takes little time and finds short tours by itself, so a long search
    before it does not pay. The number of rounds depends on the problem alone, not on time or on
    compiled code, so that a seed always gives the same result.

    Parameters
    ----------
    max_proven_goals : int
        Maximum number of goals of a small problem, whose proof takes little time.
    proven_rounds_per_goal : int
        Rounds for each goal of a small problem. With 8, a search of up to 20 goals nearly always
        finds the shortest tour; the proof corrects the others.
    min_rounds : int
        Minimum number of rounds for any other problem.
    rounds_per_goal : int
        Rounds for each goal of any other problem. With 500 goals, 100 rounds give tours about 1 %
        shorter than 40, but another search among the classes near the tour gains more.
    rounds_per_pair : float
        Rounds for each pair of goals; the larger of this and `rounds_per_goal` counts.
    max_rounds_per_goal : int
        Maximum of the rounds for pairs, for each goal.
    """

    max_proven_goals: int = 24
    proven_rounds_per_goal: int = 8
    min_rounds: int = 500
    rounds_per_goal: int = 40
    rounds_per_pair: float = 1.0
    max_rounds_per_goal: int = 100

    def __post_init__(self) -> None:
        check_not_negative(self)

    def rounds(self, goals: int) -> int:
        """Return the number of rounds of one search.

        Parameters
        ----------
        goals : int
            Number of goals.
        """
        if goals <= self.max_proven_goals:
            return self.proven_rounds_per_goal * goals
        pairs = int(self.rounds_per_pair * goals * (goals - 1) / 2)
        return max(
            self.min_rounds,
            self.rounds_per_goal * goals,
            min(pairs, self.max_rounds_per_goal * goals),
        )
