"""Named errors of the suite: what went wrong in the world, as against a wrong argument.

Wrong arguments raise the builtin ``ValueError`` or ``TypeError``; these classes are for meshes,
maps, episodes and optional back ends that cannot be used as they are.
"""


class AnmError(Exception):
    """Base of every error that the suite raises about the world rather than about an argument."""


class SceneError(AnmError):
    """A mesh, a floor plan or a scene name cannot be used; the message says why and what to do."""


class MapError(AnmError):
    """A neural map cannot answer, or a saved one cannot be read."""


class EpisodeError(AnmError):
    """An episode cannot be played: an unreachable start, goal or storey."""


class BackendError(AnmError):
    """An optional back end is missing or does not work here; the message names the remedy."""


class PolicyError(AnmError):
    """A trained policy cannot be read, or does not fit what it is asked to drive."""
