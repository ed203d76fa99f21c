"""Policy gradients on bounded action spaces.

Five rooms, in the order in which an action lives: it is drawn (`inbounds.distributions`), executed
(`inbounds.robots`), learned from (`inbounds.learning`), studied (`inbounds.study`) and shown
(`inbounds.book`). Two doors: to other libraries (`inbounds.integrations`), and to the command line
(`inbounds.cli`).

Importing the package is light: no Jupyter, Bokeh or mediapy. On Linux without a display it also chooses
MuJoCo's off-screen backend, which has to happen before `mujoco` is imported for the first time.
"""

from inbounds.headless import choose_backend

__version__ = "1.0.0"  # the one place; CITATION.cff and CHANGELOG.md are held to it

choose_backend()
