"""How fast the lockstep engine is beside its peers and beside the floor, and whether it learns what they learn.

* `python -m benchmarks.run`: steps per second, one core, interleaved; a table, a plot, the raw numbers.
* `python -m benchmarks.anatomy`: where the time of one epoch goes.
* `python -m benchmarks.validate`: learning curves beside stable-baselines3's, with a test of equivalence.
* `python -m benchmarks.anchor`: the same for the second study, by its protocol.
* `python -m benchmarks.engines`: the learning curves of the compiled engine beside autograd's.
* `python -m benchmarks.pole`: the answers of two exercises that take minutes.
* `python -m benchmarks.live`: the robot in the browser beside the study's.

A run that measures less than what is stored in `benchmarks/results` goes to `benchmarks/results/some` (`published.py`).
Peers come with the extra `bench`; those of another stack (SBX, CleanRL) may live in another environment, see
`python -m benchmarks.run --help`.
"""
