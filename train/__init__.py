"""The harness and the training commands: what runs agents, scores them and writes down what happened."""
