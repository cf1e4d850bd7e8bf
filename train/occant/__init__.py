"""Training of OccAnt and ANS: `python -m train.occant`."""
