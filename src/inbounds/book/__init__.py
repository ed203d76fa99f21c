"""What the chapters show: figures, videos, explorables and graders.

Everything here needs the extra `book` (`pip install ".[book]"` in the source tree). Two parts make do with less: films
with `video`, the report on the study with `report`. Of the rest of the package only `inbounds.cli` imports it.
"""
