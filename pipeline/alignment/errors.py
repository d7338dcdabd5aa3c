"""What the alignment refuses."""


class AlignmentError(Exception):
    """Base of what the alignment raises. The text says which file, what was found, and what to do.

    AlignmentError
    |-- CloudError        a file is not the cloud or the table it should be
    |-- FrameError        coordinate systems, units or axes of two maps do not fit
    |-- ApartError        two maps share no place, or one holds nothing to align with
    `-- DeviceError       the GPU that was asked for, or PyTorch, is not there
    """


class CloudError(AlignmentError):
    """A file that cannot be read as points or stems."""


class FrameError(AlignmentError):
    """A missing or unsuitable coordinate system, other units than metres, swapped axes."""


class ApartError(AlignmentError):
    """Nothing in common."""


class DeviceError(AlignmentError):
    """Poses cannot be scored where they were asked to be."""
