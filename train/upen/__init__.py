"""Training of UPEN's occupancy predictors: `python -m train.upen`."""
