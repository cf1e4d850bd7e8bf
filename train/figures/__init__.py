"""The paper's figures, drawn from episodes of one's own: `python -m train.figures`."""
