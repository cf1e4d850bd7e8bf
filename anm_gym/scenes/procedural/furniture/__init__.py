"""The catalogue of furniture: every piece is drawn from primitives by a function of its own."""
