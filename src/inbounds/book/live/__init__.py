"""The live robot: trained policies of the study drive MuJoCo in the reader's browser.

    from inbounds.book.live.element import live_robot

    live_robot(films, robot="HalfCheetah", left="ppo-gaussian", right="ppo-logit-normal")

`element` puts it on a page, as films and a button; `export` writes robots and policies for JavaScript; `packages`
gets MuJoCo's WebAssembly build and three.js from npm; `site` puts all of it into one folder, which the built book
serves; `record` records steps of the Python environments, which tests repeat in JavaScript. The scripts are in `js`.

What is simulated, seen and paid is written twice, in `inbounds.robots` and in `js/world.js`, and what a family does in
`inbounds.learning.families` and `js/laws.js`: `tests/book/live` compares them on all six robots, step by step.
"""
