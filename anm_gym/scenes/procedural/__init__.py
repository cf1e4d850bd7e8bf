"""Furnished homes drawn from a tier and a seed, so that exploration needs no download.

`make_home` gives a `Scene`; `plan_home` gives its plan alone, `build_home` both and the furniture.
"""

from anm_gym.scenes.procedural.home import Home, build_home, make_home
from anm_gym.scenes.procedural.layout import plan_home
from anm_gym.scenes.procedural.plan import Layout, Opening, Rect, Room, Wall
from anm_gym.scenes.procedural.tiers import TIERS, TierSpec

__all__ = [
    "TIERS",
    "Home",
    "Layout",
    "Opening",
    "Rect",
    "Room",
    "TierSpec",
    "Wall",
    "build_home",
    "make_home",
    "plan_home",
]
