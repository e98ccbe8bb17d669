"""Accuracy studies of a set-up before anyone gets wet."""
