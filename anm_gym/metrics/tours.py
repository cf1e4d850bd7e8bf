"""Tours of the oracle: sequences of poses for the rest of the budget, bettered by local search."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from anm_gym.metrics.ways import Place, Way, WayPlanner

Pose = tuple[int, int]
"""Position and heading index in the view table."""
Tour = tuple[Pose, ...]


@dataclass(frozen=True, eq=False)
class Prospect:
    """What a tour is predicted to do."""

    tour: Tour
    """The poses that are reached within the budget."""
    value: float
    """Area under the predicted curve of newly covered samples, see `TourSearch.prospect`."""
    left: NDArray[np.uint64]
    """(W,) uint64 packed samples that it leaves uncovered."""


class TourSearch:
    """Search tours from one place; made anew for each decision."""

    def __init__(
        self,
        ways: WayPlanner,
        bits: NDArray[np.uint64],
        known_ways: dict[tuple[Pose, Pose], Way],
        place: Place,
        missing: NDArray[np.uint64],
        is_open: NDArray[np.bool_],
        budget_steps: float,
    ) -> None:
        """Set the task.

        Args:
            ways: Plans single ways.
            bits: (P, K, W) uint64 samples that each pose covers.
            known_ways: Ways between poses, filled as they are asked for.
            place: Where the agent is.
            missing: (W,) uint64 packed samples that are not yet covered.
            is_open: (P, K) bool, which poses may be proposed.
            budget_steps: Steps that remain.
        """
        self._ways, self._bits, self._known_ways = ways, bits, known_ways
        self._place, self._missing, self._budget_steps = place, missing, budget_steps
        self._is_allowed = is_open & np.isfinite(ways.direct_costs(place))
        self._first_ways: dict[Pose, Way] = {}

    def prospect(self, tour: Tour) -> Prospect:
        """Predict the coverage of a tour.

        Its value is the area under the curve of newly covered samples over the remaining steps, plus half
        of what their final number would make: early and final coverage both count.

        Args:
            tour: Allowed poses in the order of their visit.
        """
        budget, spent, value, left = self._budget_steps, 0.0, 0.0, self._missing
        before: Pose | None = None
        for count, pose in enumerate(tour):
            way = self._way(before, pose)
            if spent + way.cost_steps > budget:
                return Prospect(tour[:count], value, left)
            gain = float(np.bitwise_count(way.bits & left).sum())
            value += gain * (1.5 * budget - spent - 0.5 * way.cost_steps)
            spent, left, before = spent + way.cost_steps, left & ~way.bits, pose
        return Prospect(tour, value, left)

    def allowed(self, tour: Tour) -> Tour:
        """Drop the poses that may not be proposed."""
        return tuple(pose for pose in tour if self._is_allowed[pose])

    def improved(self, best: Prospect, num_trials: int, rng: np.random.Generator) -> Prospect:
        """Better a tour by inserting, moving, reversing, replacing and dropping poses.

        Args:
            best: The tour to begin with.
            num_trials: Number of changes tried.
            rng: Chooses the changes.

        Returns:
            The best tour found, never worse than `best`.
        """
        weights = self._insertion_weights(best)
        for _ in range(num_trials):
            tour = self._changed(best.tour, weights, rng)
            found = self.prospect(tour)
            if found.value > best.value:
                best, weights = found, self._insertion_weights(found)
        return best

    def _changed(self, tour: Tour, weights: NDArray[np.float64], rng: np.random.Generator) -> Tour:
        first, second = (int(index) for index in np.sort(rng.integers(0, len(tour) + 1, 2)))
        kind = rng.integers(6) if tour else 0
        if kind <= 1:
            return self._with_best_insertion(tour, weights, rng)
        if kind == 2:  # drop
            return tour[:first] + tour[first + 1 :]
        if kind == 3:  # reverse
            return tour[:first] + tour[first:second][::-1] + tour[second:]
        if kind == 4:  # move
            rest = tour[:first] + tour[first + 1 :]
            target = int(rng.integers(0, len(rest) + 1))
            return rest[:target] + tour[first : first + 1] + rest[target:]
        dropped = tour[:first] + tour[first + 1 :]
        return self._with_best_insertion(dropped, weights, rng)

    def _with_best_insertion(
        self, tour: Tour, weights: NDArray[np.float64], rng: np.random.Generator
    ) -> Tour:
        """Insert a pose, likely one that covers what the tour leaves, where it is worth the most."""
        if weights[-1] <= 0.0:
            return tour
        flat = int(np.searchsorted(weights, rng.random() * weights[-1], side="right"))
        pose = divmod(flat, self._is_allowed.shape[1])
        options = [(*tour[:index], pose, *tour[index:]) for index in range(len(tour) + 1)]
        return max(options, key=lambda option: self.prospect(option).value)

    def _insertion_weights(self, prospect: Prospect) -> NDArray[np.float64]:
        """Cumulated squared gains of all poses, after a tour."""
        gains = np.bitwise_count(self._bits & prospect.left).sum(axis=-1, dtype=np.float64)
        return np.asarray(np.cumsum((gains * self._is_allowed) ** 2))

    def _way(self, before: Pose | None, pose: Pose) -> Way:
        if before is None:
            if pose not in self._first_ways:
                self._first_ways[pose] = self._ways.way(self._place, pose, self._bits)
            return self._first_ways[pose]
        if (before, pose) not in self._known_ways:
            self._known_ways[before, pose] = self._ways.way(self._ways.place_at(before), pose, self._bits)
        return self._known_ways[before, pose]
