"""The paper's tables, and the arithmetic of every comparison: `python -m train.tables`."""
