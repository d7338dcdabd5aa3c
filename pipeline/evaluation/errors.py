"""What the evaluation refuses."""


class EvaluationError(Exception):
    """Base of what the evaluation raises.

    EvaluationError
    |-- DatasetError      a folder of labelled images is not what it should be; the message names file and line
    `-- ControlError      a list of surveyed points is not what it should be, or lies beside the map
    """


class DatasetError(EvaluationError):
    """A folder of labelled images is not what it should be."""


class ControlError(EvaluationError):
    """A list of surveyed points is not what it should be, or lies beside the map."""
