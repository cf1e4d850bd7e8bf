"""Trained networks as files: safetensors with a format and settings, nothing that runs."""

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file
from torch import Tensor, nn

from anm_gym.errors import PolicyError
from anm_gym.whole_file import whole_file

WEIGHTS_FOLDER: Final = Path(__file__).parent / "weights"
"""Where the trained weights lie that come with a checkout."""


@dataclass(frozen=True)
class WeightsFormat:
    """One kind of file."""

    name: str
    """Format and version of the layout; a file of another one is refused."""
    noun: str
    """What errors call what is in it."""
    argument: str = "name_or_path"
    """The argument that names a file, for errors."""
    hint: str = ""
    """What to do if there is none, for errors."""

    def write(self, path: str | Path, tensors: Mapping[str, Tensor], settings: Mapping[str, Any]) -> None:
        """Write a file, replacing an older one; it appears whole or not at all."""
        plain = {name: values.detach().cpu().contiguous() for name, values in tensors.items()}
        with whole_file(path) as draft:
            save_file(plain, draft, metadata={"format": self.name, "settings": json.dumps(settings)})

    @contextmanager
    def reading(self, path: Path) -> Iterator[tuple[dict[str, Any], dict[str, Tensor]]]:
        """Read settings and tensors; what is wrong with them within the block is told of the file.

        Raises:
            PolicyError: If the file is missing, truncated, of another format or does not fit its settings.
        """
        try:
            with safe_open(str(path), framework="pt") as file:
                metadata: dict[str, Any] = file.metadata() or {}
                tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
        except (OSError, SafetensorError) as error:
            raise PolicyError(
                f"`{self.argument}` must name a saved {self.noun}, got {str(path)!r}: {error}{self.hint}"
            ) from error
        article = "an" if self.noun[0] in "aeiou" else "a"
        if (found := metadata.get("format")) != self.name:
            raise PolicyError(
                f"{article} {self.noun} must have format {self.name!r}, got {found!r} in {path}"
            )
        try:
            yield json.loads(metadata["settings"]), tensors
        except (KeyError, TypeError, ValueError, RuntimeError) as error:
            raise PolicyError(f"the {self.noun} in {path} must fit its settings, got {error}") from error


def prefixed(prefix: str, net: nn.Module, *, is_half: bool) -> dict[str, Tensor]:
    """Name the weights of one of several networks; on demand 16 bits of each are kept."""
    return {
        f"{prefix}.{name}": values.half() if is_half and values.is_floating_point() else values
        for name, values in net.state_dict().items()
    }


def without_prefix(prefix: str, tensors: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """The weights of one of several networks, 32 bits each."""
    chosen = {
        name.removeprefix(f"{prefix}."): values
        for name, values in tensors.items()
        if name.startswith(f"{prefix}.")
    }
    return {name: values.float() if values.is_floating_point() else values for name, values in chosen.items()}
