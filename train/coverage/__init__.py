"""The explorer as a learner: `python -m train.coverage`."""
