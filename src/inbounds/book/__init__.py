"""What the chapters show: figures, videos, explorables and graders.

What is drawn needs the extra `book` (`pip install ".[book]"` in the source tree). Some parts make do with less: films
with `video`, the report on the study with `report`, a task of one's own (`own_task`) with the package alone. Of the
rest of the package only `inbounds.cli` imports it.
"""
