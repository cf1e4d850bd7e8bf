"""The ids of the suite and their default budgets."""

import gymnasium

EXPLORE_STEPS = 1000
"""Steps of an exploration episode (Active Neural Mapping, Sec. 5.1)."""
POINTNAV_STEPS = 500
"""Steps of a point-goal episode (Habitat)."""

IDS = ("ANM/Explore-v0", "ANM/PointNav-v0", "ANM/ActiveMapping-v0")


def register_environments() -> None:
    """Register every id; entry points are strings, so that nothing is loaded."""
    gymnasium.register("ANM/Explore-v0", "anm_gym.envs.explore:ExploreEnv", max_episode_steps=EXPLORE_STEPS)
    gymnasium.register(
        "ANM/PointNav-v0",
        "anm_gym.envs.pointnav:PointNavEnv",
        max_episode_steps=POINTNAV_STEPS,
        vector_entry_point="anm_gym.envs.pointnav_vector:PointNavVectorEnv",
    )
    gymnasium.register(
        "ANM/ActiveMapping-v0",
        "anm_gym.wrappers.active_mapping:make_active_mapping",
        max_episode_steps=EXPLORE_STEPS,
    )
