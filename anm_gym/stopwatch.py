"""CPU time by module, kept outside `info` so that an episode stays bit for bit reproducible."""

import time
from collections.abc import Iterator
from contextlib import contextmanager


class Stopwatch:
    """Add up the CPU time of named modules.

    CPU time of the whole process (all threads), not wall time: on a shared machine only the former
    can be compared.
    """

    def __init__(self) -> None:
        self.compute_ms: dict[str, float] = {}
        """Total CPU milliseconds by module."""

    @contextmanager
    def __call__(self, module: str) -> Iterator[None]:
        """Charge the CPU time of a ``with`` block to a module.

        Example:
            >>> stopwatch = Stopwatch()
            >>> with stopwatch("learn"):
            ...     total = sum(range(1000))
            >>> list(stopwatch.compute_ms)
            ['learn']
        """
        start_s = time.process_time()
        try:
            yield
        finally:
            elapsed_ms = 1000.0 * (time.process_time() - start_s)
            self.compute_ms[module] = self.compute_ms.get(module, 0.0) + elapsed_ms

    def reset(self) -> None:
        """Forget every total."""
        self.compute_ms.clear()
