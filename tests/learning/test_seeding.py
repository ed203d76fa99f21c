import torch

from inbounds.learning.seeding import SeedStreams

SEEDS = range(20)


def sources(streams: SeedStreams) -> list[int]:
    """31 bits of what feeds each stream (torch has dropped the lowest): the same where two are fed by one."""
    words = [g.bit_generator.seed_seq.generate_state(1)[0] for g in (streams.noise, streams.shuffle)]
    return [
        streams.initialization.initial_seed() % 2**31,
        streams.environment >> 1,
        *(int(word) >> 1 for word in words),
    ]


def test_no_two_streams_have_one_source() -> None:
    assert len({source for seed in SEEDS for source in sources(SeedStreams.of(seed))}) == 4 * len(SEEDS)


def test_no_two_generators_draw_the_same() -> None:
    streams = [SeedStreams.of(seed) for seed in SEEDS]
    assert len({g.random() for s in streams for g in (s.noise, s.shuffle)}) == 2 * len(SEEDS)
    assert len({torch.rand((), generator=s.initialization).item() for s in streams}) == len(SEEDS)
