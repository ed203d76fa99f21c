"""What the chapters show: figures, videos, explorables and graders.

Everything here needs the ``book`` extra (``pip install "inbounds[book]"``), and nothing else in the package imports it.
"""
