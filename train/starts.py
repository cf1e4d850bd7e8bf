"""Start poses of a protocol: drawn once, kept in a JSON file, the same for every agent and every machine.

The released code has one start per scene that depends on the versions of its simulator and was never
published. Here the file is the definition: it names the geometry that the starts belong to.

Command: ``python -m train.starts open-homes --seeds 10``.
"""

import json
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from jsonargparse import ArgumentParser
from tqdm import tqdm

from anm_gym.errors import SceneError
from anm_gym.scenes.datasets import ROOT_VARIABLE
from anm_gym.whole_file import write_whole
from train.command import parse_seeds, run_command
from train.episodes import Start, make_env, scene_of
from train.protocols import OPEN_SCENES, PROTOCOLS, Protocol, ProtocolScene, open_protocol
from train.provenance import environment_digest, geometry_digest, scenes_root

FORMAT: Final = 1
"""Version of the file's layout."""
FOLDER: Final = Path(__file__).parents[1] / "configs" / "starts"
"""Where the published files lie."""
_BLIND: Final = {"camera": {"width_px": 8, "height_px": 8}, "reward": "none"}


@dataclass(frozen=True)
class SceneStarts:
    """The starts in one scene."""

    geometry: str
    """Name of the scene's geometry, see `train.provenance.geometry_digest`."""
    by_seed: Mapping[int, Start] = field(default_factory=dict)
    """x, z (metres) and heading (radians) by seed."""


StartTable = dict[str, SceneStarts]
"""Starts by the scenes' labels."""


def published_file(protocol: Protocol, env_options: Mapping[str, Any] | None = None) -> Path | None:
    """Name the file of a protocol's published starts, whether or not it is there.

    None for `open-scenes`, which is another protocol for each folder.
    """
    if protocol.base == OPEN_SCENES:
        return None
    return FOLDER / file_name(protocol.base, env_options)


def file_name(stem: str = "starts", env_options: Mapping[str, Any] | None = None) -> str:
    """Name a file of starts: another storey, or another scale, has starts of its own.

    Args:
        stem: Beginning of the name; by default that of the file which a run leaves beside its rows.
        env_options: Arguments of the environment besides the scene; only `scene_options` matter here.
    """
    named = environment_digest(_scene_options(env_options))
    return f"{stem}-{named}.json" if named else f"{stem}.json"


def starts_for(
    protocol: Protocol, seeds: Sequence[int], out: Path, env_options: Mapping[str, Any] | None = None
) -> StartTable:
    """Collect the starts of a run and leave them beside its rows.

    They are taken from the run's own file if it was started before, else from the published one; what is
    in neither is drawn. A scene that cannot be loaded has none, so that its episodes fail and no others.

    Args:
        protocol: Scenes.
        seeds: One start per scene and seed.
        out: Folder of the run.
        env_options: Arguments of the environment besides the scene; only `scene_options` matter here.
    """
    published, own = published_file(protocol, env_options), out / file_name(env_options=env_options)
    table = merged([read_starts(path) for path in (published, own) if path is not None])
    for scene in protocol.scenes:
        known = table.get(scene.label)
        missing = [seed for seed in seeds if known is None or seed not in known.by_seed]
        if missing:
            with suppress(SceneError):
                table = merged([table, {scene.label: draw_starts(scene, missing, env_options)}])
    labels = [scene.label for scene in protocol.scenes]
    chosen = {label: _of_seeds(table[label], seeds) for label in labels if label in table}
    write_starts(own, protocol.base, merged([read_starts(own), chosen]))
    return chosen


def draw_starts(
    scene: ProtocolScene, seeds: Iterable[int], env_options: Mapping[str, Any] | None = None
) -> SceneStarts:
    """Draw starts as the environment's `reset` does: a uniform navigable cell and a uniform heading.

    Args:
        scene: The scene.
        seeds: Seeds of `reset`.
        env_options: Its `scene_options` are used.

    Source:
        Active Neural Mapping, Sec. 5.1: "randomly initialized in the traversable space".
    """
    env = make_env(scene.name, 1, {**_scene_options(env_options), **_BLIND})
    starts = {}
    for seed in seeds:
        env.reset(seed=seed)
        state = env.get_wrapper_attr("trajectory")[0]
        x, z = map(float, state.position_xz)
        starts[seed] = (round(x, 6), round(z, 6), round(float(state.heading_rad), 6))
    geometry = geometry_digest(scene_of(env).mesh)
    env.close()
    return SceneStarts(geometry, starts)


def read_starts(path: Path) -> StartTable:
    """Read a file of starts; empty if there is none.

    Raises:
        ValueError: If the file is of another format or malformed.
    """
    if not path.is_file():
        return {}
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        if content["format"] != FORMAT:
            raise ValueError(f"format {content['format']}")
        return {label: _scene_starts(entry) for label, entry in content["scenes"].items()}
    except (KeyError, TypeError, AttributeError, ValueError) as error:
        raise ValueError(f"{path} must be a file of starts of format {FORMAT}, got {error!r}") from error


def write_starts(path: Path, protocol_name: str, table: StartTable) -> Path:
    """Write a file of starts that reads back to the same numbers; it appears whole or not at all."""
    scenes = {
        label: {
            "geometry": starts.geometry,
            "starts": {str(seed): list(start) for seed, start in sorted(starts.by_seed.items())},
        }
        for label, starts in table.items()
    }
    content = {
        "format": FORMAT,
        "protocol": protocol_name,
        "units": "x (m), z (m), heading (rad); by seed",
        "scenes": scenes,
    }
    write_whole(path, json.dumps(content, indent=1) + "\n")
    return path


def merged(tables: Iterable[StartTable]) -> StartTable:
    """Join tables; a later one's starts replace an earlier one's.

    Raises:
        ValueError: If a scene's geometry differs between them.
    """
    result: StartTable = {}
    for table in tables:
        for label, starts in table.items():
            known = result.get(label, SceneStarts(starts.geometry))
            if known.geometry != starts.geometry:
                raise ValueError(
                    f"the starts of {label} must belong to one geometry, got {known.geometry} and "
                    f"{starts.geometry}; its mesh or its generator has changed: write the starts anew"
                )
            result[label] = SceneStarts(starts.geometry, {**known.by_seed, **starts.by_seed})
    return result


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command."""
    options = _parser().parse_args(arguments)
    protocol = open_protocol(options.protocol, options.root)
    protocol.require_scenes(scenes_root(options.env))
    out = Path(options.out) if options.out else published_file(protocol, options.env)
    if out is None:
        raise ValueError(
            f"`out` must name a file for {protocol.base}: its starts belong to one folder of meshes"
        )
    seeds = parse_seeds(options.seeds)
    kept = {} if options.anew else read_starts(out)
    drawn = {}
    for scene in tqdm(protocol.scenes, unit="scene"):
        drawn[scene.label] = draw_starts(scene, seeds, options.env)
    table = merged([drawn, kept])
    write_starts(out, protocol.base, table)
    for scene in protocol.scenes:
        print(f"{scene.label}: {scene.steps} steps, {len(table[scene.label].by_seed)} starts")
    print(f"starts: {out}")


def _parser() -> ArgumentParser:
    parser = ArgumentParser(prog="python -m train.starts", description=__doc__.splitlines()[0])
    add = parser.add_argument
    add("protocol", choices=PROTOCOLS, help="whose start poses")
    add(
        "--root", default=None, help=f"folder of datasets (${ROOT_VARIABLE}), or of the meshes of open-scenes"
    )
    add("--seeds", nargs="+", default=["10"], help="a count, or the seeds themselves: 0,1,2")
    add(
        "--out",
        default=None,
        help="the file; by default the protocol's published one, which open-scenes has not",
    )
    add("--anew", action="store_true", help="replace the starts that the file has; else they are kept")
    add("--env", type=dict | None, default=None, help="arguments of the environment; scene_options matter")
    return parser


def _scene_options(env_options: Mapping[str, Any] | None) -> dict[str, Any]:
    """What of an environment's arguments moves its starts."""
    return {key: value for key, value in (env_options or {}).items() if key == "scene_options"}


def _of_seeds(starts: SceneStarts, seeds: Iterable[int]) -> SceneStarts:
    return SceneStarts(
        starts.geometry, {seed: starts.by_seed[seed] for seed in seeds if seed in starts.by_seed}
    )


def _scene_starts(entry: Mapping[str, Any]) -> SceneStarts:
    starts = {}
    for seed, numbers in entry["starts"].items():
        x, z, heading_rad = map(float, numbers)
        starts[int(seed)] = (x, z, heading_rad)
    return SceneStarts(str(entry["geometry"]), starts)


if __name__ == "__main__":
    run_command(main)
