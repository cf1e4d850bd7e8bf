"""CPU time of a run over all of its starts, kept beside what it has made."""

import json
import time
from pathlib import Path
from typing import Final, final

from anm_gym.whole_file import write_whole

CLOCK_FILE: Final = "cpu_s.json"


@final
class RunClock:
    """Add the CPU time of this process to what former starts of a run have left in its folder.

    Args:
        folder: The run's; what a killed start took since it last kept its time is not known.
    """

    def __init__(self, folder: Path) -> None:
        self._path = folder / CLOCK_FILE
        before_s = json.loads(self._path.read_text(encoding="utf-8")) if self._path.exists() else 0.0
        self._offset_s = float(before_s) - time.process_time()

    def keep(self) -> float:
        """Write the time so far, and return it, seconds."""
        cpu_s = self._offset_s + time.process_time()
        write_whole(self._path, json.dumps(cpu_s) + "\n")
        return cpu_s
