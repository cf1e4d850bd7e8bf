"""Training of point-goal navigators, and their comparison: `python -m train.navigator`."""
