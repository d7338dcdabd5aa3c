"""What the evaluation refuses."""


class EvaluationError(Exception):
    """Base of what the evaluation raises.

    EvaluationError
    `-- DatasetError      a folder of labelled images is not what it should be; the message names file and line
    """


class DatasetError(EvaluationError):
    """A folder of labelled images is not what it should be."""
