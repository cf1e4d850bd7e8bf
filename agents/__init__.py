"""What decides: navigators, the sources of goals of the baselines, and the roster of agents."""
