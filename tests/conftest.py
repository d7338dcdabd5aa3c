"""What holds for all tests."""

from hypothesis import settings

# A first call compiles: how long an example takes says nothing about the code.
settings.register_profile("mapforest", deadline=None)
settings.load_profile("mapforest")
