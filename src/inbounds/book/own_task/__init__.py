"""A task of one's own: what needs no learning, what has learned, and whether the difference is more than chance."""

from inbounds.book.own_task.comparing import best_of, compare, constant, greedy, noisy, play

__all__ = ["best_of", "compare", "constant", "greedy", "noisy", "play"]
