"""The neural map: field, training, variability and targets; it knows nothing of Gymnasium."""
