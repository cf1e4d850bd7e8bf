"""What an episode and a map are worth: completion, map accuracy, curves, intervals, the oracle's bound."""
