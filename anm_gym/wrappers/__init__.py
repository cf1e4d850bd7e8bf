"""Wrappers, where an environment meets a map or a source of goals."""
