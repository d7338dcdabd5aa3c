"""What data for training is refused for."""


class DatasetError(Exception):
    """Base of what this package raises. The text says which file and line, what is wrong, what to do."""


class SplitRefused(DatasetError):
    """The images cannot be divided as asked."""
