"""Scenes: loading and checking meshes, floor plans, procedural homes."""

from anm_gym.scenes.catalog import make_scene
from anm_gym.scenes.load import load_scene
from anm_gym.scenes.report import MeshReport, mesh_report
from anm_gym.scenes.scene import Scene, Storey

__all__ = ["MeshReport", "Scene", "Storey", "load_scene", "make_scene", "mesh_report"]
