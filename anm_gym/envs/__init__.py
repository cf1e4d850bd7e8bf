"""Gymnasium environments over rendered meshes; none of them imports torch."""
