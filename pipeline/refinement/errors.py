"""What the refinement refuses."""


class RefinementError(Exception):
    """Base of what the refinement raises.

    RefinementError
    |-- NothingToRefine      a track without poses
    |-- LibraryMissing       the extra `refine` is not installed
    `-- ConstraintsRefused   a constraint that cannot be met; the message says which
    """


class NothingToRefine(RefinementError):
    """There is no trajectory, or none that moves."""


class LibraryMissing(RefinementError):
    """GTSAM or small_gicp cannot be imported."""


class ConstraintsRefused(RefinementError):
    """The analyst's constraints speak of what is not there, or contradict each other."""
