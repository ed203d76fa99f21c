"""The graders of the exercises: one module a chapter, named like its notebook, over one way of judging."""
