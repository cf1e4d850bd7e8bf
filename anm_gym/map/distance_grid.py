"""Signed distances at the corners of a sparse voxel grid, each with the evidence behind it.

Between corners the distance is interpolated, so it is linear in the corners' values, and observations can
move them without gradient descent: each corner takes the mean residual around it, divided by the
evidence that it has gathered. The same evidence tells how well the corner is known: it is the precision of
a diagonal approximation to the posterior, exact for observations that lie on corners, too sure for corners
that were seen from one side of their cells alone. Benchmarks measure how good it is (ours).
"""

from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor, nn

from anm_gym.map.settings import GridSettings

Prior = Callable[[Tensor], Tensor]
"""Predicts (N, 3) points, (N,) metres, where the grid knows nothing."""

_SHIFT = 3
BLOCK = 1 << _SHIFT
"""Corners along an edge of a block, the unit in which memory is given out."""
_BLOCK_SIZE = BLOCK**3
_GROWTH_BLOCKS = 4
_GROWTH_SHARE = 0.5
_OUTSIDE = -(1 << 40)


@dataclass(frozen=True)
class Corners:
    """The eight corners around each of N points."""

    index: Tensor
    """(N, 8) int64 positions in the grid's memory; those below `BLOCK` ** 3 stand for corners without."""
    weights: Tensor
    """(N, 8) float32 trilinear weights, which sum to 1; differentiable in the points."""


class DistanceGrid(nn.Module):
    """One resolution of the grid.

    Args:
        settings: Spacing of the corners and how much is expected of them.
    """

    values: Tensor
    evidence: Tensor
    change: Tensor
    table: Tensor
    table_size: Tensor
    table_strides: Tensor
    low_block: Tensor
    blocks: Tensor

    def __init__(self, settings: GridSettings) -> None:
        super().__init__()
        self.settings = settings
        self.prior_evidence = (settings.noise_m / settings.prior_std_m) ** 2
        for name in ("values", "evidence", "change"):  # the first block is nobody's
            self.register_buffer(name, torch.zeros(_BLOCK_SIZE))
        self.register_buffer("blocks", torch.zeros((1, 3), dtype=torch.int64))
        self.register_buffer("table", torch.zeros((1, 1, 1), dtype=torch.int64))
        self.register_buffer("low_block", torch.zeros(3, dtype=torch.int64))
        for name in ("table_size", "table_strides"):  # of the table, kept beside it on its device
            self.register_buffer(name, torch.ones(3, dtype=torch.int64), persistent=False)
        self._touched: list[Tensor] = []
        self._sums = torch.zeros(0)

    @property
    def num_weights(self) -> int:
        """Corners that have memory."""
        return (len(self.blocks) - 1) * _BLOCK_SIZE

    def corners(self, points: Tensor) -> Corners:
        """Find the corners around (N, 3) points, metres, world frame."""
        low, weights = self._cells(points)
        pair = torch.stack([low, low + 1], dim=2)
        # The first entry of the table is at its rim, which never gets memory.
        return Corners(self._index(pair, self._entries(pair).clamp(min=0)), weights)

    def known_share(self, corners: Corners) -> Tensor:
        """How much of the prediction comes from the corners, (N,) from 0 (all prior) to 1."""
        return (corners.weights * self._known(corners)).sum(dim=1)

    def refine(self, corners: Corners, prior: Tensor) -> Tensor:
        """Interpolate the posterior means of the corners.

        Args:
            corners: Corners around N points.
            prior: (N,) float32 distances that are believed where there is no evidence, metres.

        Returns:
            (N,) float32 metres.
        """
        share = corners.weights * self._known(corners)
        return prior + (share * (self.values[corners.index] - prior[:, None])).sum(dim=1)

    def variance(self, corners: Corners) -> Tensor:
        """Interpolate the approximate posterior variances of the corners; (N,) float32 square metres."""
        precision = self.evidence[corners.index] + self.prior_evidence
        return (corners.weights / precision).sum(dim=1) * self.settings.noise_m**2

    def perturbed_variance(self, corners: Corners, std: Tensor) -> Tensor:
        """Variance of the prediction when each corner's value moves on its own.

        Args:
            corners: Corners around N points.
            std: Standard deviation of each, (N, 8) or a scalar, metres.

        Returns:
            (N,) float32 square metres.
        """
        moved = (corners.weights * self._known(corners) * std).square()
        return moved.sum(dim=1)

    def begin_update(self) -> None:
        """Let `change` count from here."""
        for index in self._touched:
            self.change[index] = 0.0
        self._touched = []

    @torch.no_grad()
    def observe(self, points: Tensor, distances: Tensor, weights: Tensor, prior: Prior) -> None:
        """Move the corners towards the least squares fit of a batch, by as much as their evidence leaves.

        Args:
            points: (N, 3) float32, metres, world frame.
            distances: (N,) float32 observed signed distances, metres.
            weights: (N,) float32 evidence of each observation.
            prior: New corners start from its prediction.

        Source:
            Simultaneous iterative reconstruction (Gilbert, 1972): as the weights around a point sum to 1,
            the sum over the points around a corner bounds its curvature, and dividing by it converges.
            Here the sum runs over all batches so far, so that corners average over batches, up to a limit
            that lets them follow changes (ours).
        """
        if len(points) == 0:
            return
        corners = self._allocated_corners(points)
        index, shares = corners.index.reshape(-1), corners.weights * weights[:, None]
        self._start_from(prior, index)
        residual = distances - (corners.weights * self.values[corners.index]).sum(dim=1)
        gained = self._sums_at(index, shares.reshape(-1))
        step = self._sums_at(index, (shares * residual[:, None]).reshape(-1))
        evidence = self.evidence[index] + gained
        step = step / evidence.clamp(min=1e-6)
        self.change[index] = self.change[index] + step
        self._touched.append(index)
        self.values[index] = self.values[index] + step
        self.evidence[index] = evidence.clamp(max=self.settings.max_evidence)

    def _known(self, corners: Corners) -> Tensor:
        evidence = self.evidence[corners.index]
        return evidence / (evidence + self.prior_evidence)

    def _sums_at(self, index: Tensor, addends: Tensor) -> Tensor:
        """For each entry, the sum of the addends of all entries with the same index."""
        if len(self._sums) != len(self.values):
            self._sums = torch.zeros_like(self.values)
        result = self._sums.index_add_(0, index, addends)[index]
        self._sums[index] = 0.0  # all zeros again, without a pass over all memory
        return result

    def _start_from(self, prior: Prior, index: Tensor) -> None:
        fresh = index[self.evidence[index] == 0.0].unique()
        if len(fresh):
            self.values[fresh] = prior(self._positions(fresh))

    def _positions(self, index: Tensor) -> Tensor:
        """(N, 3) where corners lie, metres, world frame."""
        local = index % _BLOCK_SIZE
        within = torch.stack([local >> 2 * _SHIFT, local >> _SHIFT & BLOCK - 1, local & BLOCK - 1], dim=1)
        return (self.blocks[index // _BLOCK_SIZE] * BLOCK + within) * self.settings.voxel_m

    def _cells(self, points: Tensor) -> tuple[Tensor, Tensor]:
        """(N, 3) int64 lowest corner around each point and (N, 8) trilinear weights."""
        scaled = points / self.settings.voxel_m
        low = scaled.detach().floor()
        share = scaled - low
        weights = torch.stack([1.0 - share, share], dim=2)
        x, y, z = weights[:, 0, :, None, None], weights[:, 1, None, :, None], weights[:, 2, None, None, :]
        return low.long(), (x * y * z).reshape(-1, 8)

    def _index(self, pair: Tensor, entries: Tensor) -> Tensor:
        """(N, 8) memory of the corners with (N, 3, 2) lattice coordinates and (N, 8) entries of the table."""
        local = pair & BLOCK - 1
        x = local[:, 0, :, None, None] << 2 * _SHIFT
        within = x + (local[:, 1, None, :, None] << _SHIFT) + local[:, 2, None, None, :]
        return self.table.reshape(-1)[entries] * _BLOCK_SIZE + within.reshape(-1, 8)

    def _entries(self, pair: Tensor) -> Tensor:
        """(N, 8) entries of the table for (N, 3, 2) lattice coordinates, negative outside of it."""
        block = (pair >> _SHIFT) - self.low_block[:, None]
        is_inside = (block >= 0) & (block < self.table_size[:, None])
        entry = torch.where(is_inside, block * self.table_strides[:, None], _OUTSIDE)
        x, y, z = entry[:, 0, :, None, None], entry[:, 1, None, :, None], entry[:, 2, None, None, :]
        return (x + y + z).reshape(-1, 8)

    def _allocated_corners(self, points: Tensor) -> Corners:
        """Find the corners around points and give memory to those that have none."""
        low, weights = self._cells(points)
        self._cover((low.amin(dim=0) >> _SHIFT) - 1, low.amax(dim=0) + 1 >> _SHIFT)
        pair = torch.stack([low, low + 1], dim=2)
        entries = self._entries(pair)
        missing = entries[self.table.reshape(-1)[entries] == 0].unique()
        if len(missing):
            self._allocate(missing)
        return Corners(self._index(pair, entries), weights)

    def _allocate(self, entries: Tensor) -> None:
        """Give memory to the blocks at distinct entries of the table."""
        first, count = len(self.blocks), len(entries)
        self.table.view(-1)[entries] = torch.arange(first, first + count, device=entries.device)
        coordinates = entries[:, None] // self.table_strides % self.table_size
        self.blocks = torch.cat([self.blocks, coordinates + self.low_block])
        missing = len(self.blocks) * _BLOCK_SIZE - len(self.values)
        if missing > 0:
            more = max(missing, int(_GROWTH_SHARE * len(self.values)))
            for name in ("values", "evidence", "change"):
                memory = getattr(self, name)
                setattr(self, name, torch.cat([memory, memory.new_zeros(more)]))

    def _cover(self, low: Tensor, high: Tensor) -> None:
        """Grow the table until it holds every block from `low` to `high`."""
        is_empty = len(self.blocks) == 1
        old_low = low if is_empty else self.low_block
        old_high = high + 1 if is_empty else self.low_block + self.table_size
        if not is_empty and bool(((low >= old_low) & (high < old_high)).all()):
            return
        new_low = torch.where(low < old_low, low - _GROWTH_BLOCKS, old_low)
        new_high = torch.where(high >= old_high, high + 1 + _GROWTH_BLOCKS, old_high)
        table = self.table.new_zeros((new_high - new_low).tolist())
        if not is_empty:
            x, y, z = (old_low - new_low).tolist()
            width, height, depth = self.table.shape
            table[x : x + width, y : y + height, z : z + depth] = self.table
        self.table, self.low_block = table, new_low
        self._measure_table()

    def _measure_table(self) -> None:
        device = self.table.device
        self.table_size = torch.tensor(self.table.shape, device=device)
        self.table_strides = torch.tensor(self.table.stride(), device=device)

    def _load_from_state_dict(self, state_dict: dict[str, Tensor], prefix: str, *arguments: object) -> None:
        """Take the size of the saved memory before its contents."""
        for name in ("values", "evidence", "change", "blocks", "table", "low_block"):
            saved = state_dict.get(prefix + name)
            if saved is not None:
                setattr(self, name, getattr(self, name).new_zeros(saved.shape))
        super()._load_from_state_dict(state_dict, prefix, *arguments)
        self._measure_table()
        self._touched = [self.change.nonzero().squeeze(1)]
