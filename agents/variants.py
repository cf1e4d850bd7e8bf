"""What may follow an agent's preset behind a "+": substitutions in map, choice of targets and navigator.

Those of the map are `anm_gym.map.presets.VARIANTS`; here they are told apart from the others.
"""

from collections.abc import Collection
from dataclasses import dataclass
from typing import Final, get_args

from agents.navigators import NAVIGATORS
from anm_gym.map.presets import VARIANTS
from anm_gym.map.settings import PerturbationFamily
from anm_gym.map.targets import Criterion

NAVIGATOR: Final = "nav="
"""Begins the variant that names who drives to the goals (Module 3 of the paper's ablation)."""
SELECT: Final = "select="
"""Begins the variant that names how a target view is chosen among clusters (Module 2)."""
NAVIGATOR_VARIANTS: Final = tuple(NAVIGATOR + name for name in NAVIGATORS)
"""One for every navigator."""
SELECT_VARIANTS: Final = tuple(SELECT + name for name in get_args(Criterion))
"""One for every criterion of `anm_gym.map.targets`."""
MAP_VARIANTS: Final = tuple(VARIANTS)
"""Substitutions in the neural map (Modules 1 and 4, and others)."""
MAP_KINDS: Final = {
    "a perturbation family": frozenset(get_args(PerturbationFamily)),
    "a way to replay": frozenset(name for name in VARIANTS if name.endswith("_replay")),
    "`relu`": frozenset({"relu"}),
}
"""Those of them that substitute the same part."""


@dataclass(frozen=True)
class Substitutions:
    """A preset, taken apart."""

    base: str
    """The preset before the first "+"."""
    map_preset: str
    """The preset with what concerns the neural map alone."""
    goal_preset: str
    """The preset without what names a navigator."""
    select: Criterion | None = None
    """How a target view is chosen among clusters; None as the preset has it."""
    navigator: str | None = None
    """Who drives; None as the agent has it."""


def split_variants(text: str, known: Collection[str]) -> tuple[str, list[str]]:
    """Split a preset from its variants; the name of a variant may hold a "+" itself.

    Args:
        text: ``preset`` or ``preset+variant+variant``.
        known: The variants that may follow.

    Returns:
        The preset, and the variants; a word that starts no known variant stands alone.

    Example:
        >>> split_variants("best+relu+nav=ddppo+fallback", ["relu", "nav=ddppo", "nav=ddppo+fallback"])
        ('best', ['relu', 'nav=ddppo+fallback'])
    """
    base, *words = text.split("+")
    variants: list[str] = []
    while words:
        lengths = [count for count in range(len(words), 0, -1) if "+".join(words[:count]) in known]
        count = lengths[0] if lengths else 1
        variants.append("+".join(words[:count]))
        words = words[count:]
    return base, variants


def substitutions(preset: str) -> Substitutions:
    """Take a preset apart by what its variants concern.

    Raises:
        ValueError: If two variants substitute the same part.

    Example:
        >>> substitutions("best+select=count+dropout").map_preset
        'best+dropout'
    """
    base, variants = split_variants(preset, [*MAP_VARIANTS, *SELECT_VARIANTS, *NAVIGATOR_VARIANTS])
    of_goals = [variant for variant in variants if not variant.startswith(NAVIGATOR)]
    of_map = [variant for variant in of_goals if not variant.startswith(SELECT)]
    for kind, names in MAP_KINDS.items():
        given = [variant for variant in of_map if variant in names]
        if len(given) > 1:
            raise ValueError(f"{kind} must be given once behind a preset, got {', '.join(given)}")
    criterion = _only(variants, SELECT)
    return Substitutions(
        base=base,
        map_preset="+".join([base, *of_map]),
        goal_preset="+".join([base, *of_goals]),
        select=next((name for name in get_args(Criterion) if name == criterion), None),
        navigator=_only(variants, NAVIGATOR),
    )


def _only(variants: list[str], prefix: str) -> str | None:
    """What the one variant with a prefix names; None if there is none."""
    names = [variant.removeprefix(prefix) for variant in variants if variant.startswith(prefix)]
    if len(names) > 1:
        raise ValueError(f"`{prefix}` must be given once behind a preset, got {', '.join(names)}")
    return names[0] if names else None
