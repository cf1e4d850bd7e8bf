"""Depth cameras, the traversable grid, motion and geodesics over plain triangles."""
