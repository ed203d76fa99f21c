"""What the chapters show: figures, videos, explorables and graders.

Everything here needs the ``book`` extra (``pip install ".[book]"`` in the source tree), films alone the lighter
``video``. Of the rest of the package only :mod:`inbounds.cli` imports it.
"""
