"""Files of point-goal episodes in Habitat's layout: a split, and one file for each of its scenes.

``val/val.json.gz`` names where the files of the scenes lie, by default
``val/content/<scene>.json.gz``; each holds the episodes of one scene. What an episode means is in
`pointnav_episodes`.
"""

import gzip
import json
import math
import zlib
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, Final

from anm_gym.envs.options import read_names
from anm_gym.envs.pointnav_episodes import PointNavEpisode, is_upright
from anm_gym.errors import EpisodeError
from anm_gym.whole_file import whole_file

CONTENT_PATH: Final = "{data_path}/content/{scene}.json.gz"
"""Where the files of the scenes lie, `data_path` being the split's folder (Habitat's default)."""
SCENES_PREFIX: Final = "data/scene_datasets/"
"""What Habitat takes off the front of a `scene_id`."""
SUFFIX: Final = ".json.gz"
"""End of every file's name."""

_NAMED_OF_GOAL: Final = frozenset({"position", "radius"})
_NAMED: Final = frozenset(
    {"episode_id", "scene_id", "start_position", "start_rotation", "goals", "shortest_paths", "info"}
)


def read_episodes(path: str | Path, scenes: Sequence[str] | None = None) -> Iterator[PointNavEpisode]:
    """Read the episodes of a split, one scene's file at a time.

    Where there is a folder of scenes' files, they count and the split's own episodes do not, as some
    datasets hold each episode in both places.

    Args:
        path: The split, such as ``val/val.json.gz``, or the file of a single scene.
        scenes: Names of the scenes' files, without ending; None takes all, in the order of names.

    Yields:
        The episodes in the order of the files.

    Raises:
        TypeError: If `scenes` is a single text.
        EpisodeError: If a file is missing, cut off or malformed; the message names file and field.

    Source:
        Habitat's loader of `PointNav-v1`.
    """
    split, wanted = Path(path), None if scenes is None else read_names("scenes", scenes)
    content = _read_json(split)
    pattern = content.get("content_scenes_path", CONTENT_PATH)
    if not isinstance(pattern, str) or "{scene}" not in pattern:
        raise EpisodeError(f"`content_scenes_path` of {split} must contain {{scene}}, got {pattern!r}")
    folder, ending = pattern.replace("{data_path}", str(split.parent)).split("{scene}", maxsplit=1)
    if not Path(folder).is_dir():
        episodes = _episodes_of(content, split)
        yield from (found for found in episodes if wanted is None or _file_stem(found.scene_id) in wanted)
        return
    names = (
        wanted
        if wanted is not None
        else sorted(
            file.name.removesuffix(ending) for file in Path(folder).iterdir() if file.name.endswith(ending)
        )
    )
    for name in names:
        file = Path(f"{folder}{name}{ending}")
        yield from _episodes_of(_read_json(file), file)


def write_episodes(path: str | Path, episodes: Iterable[PointNavEpisode]) -> tuple[Path, ...]:
    """Write a split and the files of its scenes; the same episodes make the same bytes.

    Args:
        path: The split, such as ``val/val.json.gz``.
        episodes: Any order; each scene keeps its own.

    Returns:
        The files, the split first.

    Raises:
        ValueError: If the path does not end in ``.json.gz``, two scenes would share a file, or two
            episodes of a scene share an id.
        EpisodeError: If an episode could not be read back, or files of other scenes lie there already:
            they would belong to the split. Nothing is written then.
    """
    split = Path(path)
    if not split.name.endswith(SUFFIX):
        raise ValueError(f"`path` must end in {SUFFIX}, got {split.name!r}")
    by_name = _by_file_stem(episodes)
    records = [_records_of(found) for found in by_name.values()]
    folder = split.parent / "content"
    strangers = {file.name for file in folder.glob(f"*{SUFFIX}")} - {f"{name}{SUFFIX}" for name in by_name}
    if strangers:
        raise EpisodeError(
            f"{folder} must hold no files of other scenes, got {', '.join(sorted(strangers))}"
            "; remove them or write elsewhere"
        )
    folder.mkdir(parents=True, exist_ok=True)
    files = [folder / f"{name}{SUFFIX}" for name in by_name]
    for file, own in zip(files, records, strict=True):
        _write_json(file, {"episodes": own})
    _write_json(split, {"episodes": [], "content_scenes_path": CONTENT_PATH})
    return split, *files


def to_json(episode: PointNavEpisode) -> dict[str, Any]:
    """Give an episode the form that it has in a file."""
    position, radius_m = list(episode.goal_position), episode.goal_radius_m
    return {
        "episode_id": episode.episode_id,
        "scene_id": episode.scene_id,
        "start_position": list(episode.start_position),
        "start_rotation": list(episode.start_rotation),
        "info": dict(episode.info),
        "goals": [{"position": position, "radius": radius_m, **episode.goal_others}],
        "shortest_paths": None if episode.shortest_paths is None else list(episode.shortest_paths),
        **episode.others,
    }


def from_json(record: Any, where: str) -> PointNavEpisode:
    """Read an episode from the form that it has in a file.

    Args:
        record: What the file holds.
        where: The place, for messages.

    Raises:
        EpisodeError: If a field is missing or malformed; the message names it.
    """
    fields = _mapping(record, "", where)
    goals = fields.get("goals")
    if not isinstance(goals, list) or len(goals) != 1:
        raise _malformed("goals", where, "be a list of one goal", goals)
    goal = _mapping(goals[0], "goals[0]", where)
    radius_m, paths, info = goal.get("radius"), fields.get("shortest_paths"), fields.get("info")
    if paths is not None and not isinstance(paths, list):
        raise _malformed("shortest_paths", where, "be a list or null", paths)
    x, y, z = _numbers(fields.get("start_position"), 3, "start_position", where)
    goal_x, goal_y, goal_z = _numbers(goal.get("position"), 3, "goals[0].position", where)
    return PointNavEpisode(
        episode_id=_text(fields.get("episode_id"), "episode_id", where),
        scene_id=_text(fields.get("scene_id"), "scene_id", where).removeprefix(SCENES_PREFIX),
        start_position=(x, y, z),
        start_rotation=_rotation(fields.get("start_rotation"), where),
        goal_position=(goal_x, goal_y, goal_z),
        goal_radius_m=None if radius_m is None else _numbers([radius_m], 1, "goals[0].radius", where)[0],
        shortest_paths=paths,
        info={} if info is None else _info(info, where),
        goal_others={name: value for name, value in goal.items() if name not in _NAMED_OF_GOAL},
        others={name: value for name, value in fields.items() if name not in _NAMED},
    )


def _episodes_of(content: dict[str, Any], file: Path) -> Iterator[PointNavEpisode]:
    records = content.get("episodes")
    if not isinstance(records, list):
        raise _malformed("episodes", str(file), "be a list", records)
    for index, record in enumerate(records):
        yield from_json(record, f"episode {index} of {file}")


def _by_file_stem(episodes: Iterable[PointNavEpisode]) -> dict[str, list[PointNavEpisode]]:
    by_name: dict[str, list[PointNavEpisode]] = {}
    for episode in episodes:
        found = by_name.setdefault(_file_stem(episode.scene_id), [])
        if found and found[0].scene_id != episode.scene_id:
            raise ValueError(
                "`episodes` must be of scenes with different file names, got "
                f"{found[0].scene_id} and {episode.scene_id}"
            )
        found.append(episode)
    return by_name


def _records_of(episodes: Sequence[PointNavEpisode]) -> list[dict[str, Any]]:
    """Give the episodes of a scene the form that they have in a file; refuse an id that several have."""
    episode_id, count = Counter(str(episode.episode_id) for episode in episodes).most_common(1)[0]
    if count > 1:
        raise ValueError(
            f"`episode_id` must be unique within {episodes[0].scene_id}, got {episode_id!r} {count} times"
            "; number its episodes anew"
        )
    return [_checked_record(episode) for episode in episodes]


def _checked_record(episode: PointNavEpisode) -> dict[str, Any]:
    """Give an episode the form that it has in a file, if it can be read back from there."""
    record, where = to_json(episode), f"episode {episode.episode_id} in {episode.scene_id}"
    from_json(record, where)
    try:
        json.dumps(record, allow_nan=False)
    except (TypeError, ValueError, RecursionError) as error:
        raise EpisodeError(f"{where} must be made of what JSON can say, got {error}") from error
    return record


def _file_stem(scene_id: str) -> str:
    """Name the file of a scene: the mesh's stem; colons of a procedural name become dashes."""
    name = Path(scene_id)
    return (name.stem if name.suffix else name.name).replace(":", "-")


def _read_json(file: Path) -> dict[str, Any]:
    try:
        content = json.loads(gzip.decompress(file.read_bytes()))
    except OSError as error:
        reason = "none" if isinstance(error, FileNotFoundError) else str(error)
        raise EpisodeError(f"{file} must be a gzip file of episodes, got {reason}") from error
    except (EOFError, zlib.error, ValueError, RecursionError) as error:
        raise EpisodeError(
            f"{file} must be a whole gzip file of JSON, got {error}; fetch it again"
        ) from error
    return _mapping(content, "", str(file))


def _write_json(file: Path, content: dict[str, Any]) -> None:
    text = json.dumps(content, allow_nan=False, separators=(",", ":"))
    with whole_file(file) as draft:
        draft.write_bytes(gzip.compress(text.encode(), mtime=0))


def _malformed(name: str, where: str, condition: str, value: Any) -> EpisodeError:
    text = repr(value)
    shown = text if len(text) <= 80 else f"{text[:77]}..."
    return EpisodeError(f"`{name}` of {where} must {condition}, got {shown}")


def _mapping(value: Any, name: str, where: str) -> dict[str, Any]:
    if isinstance(value, dict):
        return value
    if name:
        raise _malformed(name, where, "be an object", value)
    raise EpisodeError(f"{where} must be a JSON object, got {type(value).__name__}")


def _info(value: Any, where: str) -> dict[str, Any]:
    info = _mapping(value, "info", where)
    if info.get("geodesic_distance") is not None:
        _numbers([info["geodesic_distance"]], 1, "info.geodesic_distance", where)
    return info


def _text(value: Any, name: str, where: str) -> str:
    """Read a name; Habitat's older files number episodes."""
    if isinstance(value, str) and value:
        return value
    if name == "episode_id" and isinstance(value, int) and not isinstance(value, bool):
        return str(value)
    raise _malformed(name, where, "be a text", value)


def _numbers(value: Any, count: int, name: str, where: str) -> list[float]:
    is_list = isinstance(value, list) and len(value) == count
    if not is_list or not all(_is_finite(number) for number in value):
        raise _malformed(
            name, where, "be one finite number" if count == 1 else f"be {count} finite numbers", value
        )
    return [float(number) for number in value]


def _is_finite(value: Any) -> bool:
    if not isinstance(value, int | float) or isinstance(value, bool):
        return False
    try:
        return math.isfinite(value)
    except OverflowError:  # a whole number beyond the largest float
        return False


def _rotation(value: Any, where: str) -> tuple[float, float, float, float]:
    x, y, z, w = _numbers(value, 4, "start_rotation", where)
    if not is_upright((x, y, z, w)):
        raise _malformed("start_rotation", where, "be an upright unit quaternion (x, y, z, w)", [x, y, z, w])
    return x, y, z, w
