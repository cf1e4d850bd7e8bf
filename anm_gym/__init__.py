"""Gymnasium environments in which a robot explores and maps indoor meshes.

Importing the package registers its ids and loads nothing heavy:

>>> import gymnasium, anm_gym
>>> "ANM/Explore-v0" in gymnasium.registry
True
"""

from anm_gym.registration import register_environments

__version__ = "0.1.0"

register_environments()
