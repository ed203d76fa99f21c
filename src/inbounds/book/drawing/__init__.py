"""How the book draws: figures in one style with alt text, and films."""
