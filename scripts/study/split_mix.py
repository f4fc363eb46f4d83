"""The random numbers of `aso-ftc design`, for those who repeat its random cases."""


def uniform(state):
    """The numbers of SplitMix64 (Steele, Lea, Flood 2014) from 0 to 1, from the seed `state`."""
    mask = 2**64 - 1
    while True:
        state = (state + 0x9E3779B97F4A7C15) & mask
        z = ((state ^ (state >> 30)) * 0xBF58476D1CE4E5B9) & mask
        z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & mask
        yield ((z ^ (z >> 31)) >> 11) / 2**53
