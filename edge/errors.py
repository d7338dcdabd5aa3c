"""Errors of the appliance.

EdgeError
├── ConfigError      the configuration file: which key, what was found, what is expected
├── RecordingError   a session cannot be started, written or finished
├── FormatError      a file is not the recording it should be
├── ControlError     the recorder cannot be reached, or refused a request
├── ClusterError     a scheduler or its workers cannot be reached, or are not fit for a batch
└── UsageError       the command line asks for something that makes no sense
"""


class EdgeError(Exception):
    """Base of every error of the appliance. The text says what happened, where, and what to do."""


class ConfigError(EdgeError):
    """A configuration that cannot be used."""


class RecordingError(EdgeError):
    """A session cannot be started, written or finished."""


class FormatError(EdgeError):
    """A file is not the recording it should be."""


class ControlError(EdgeError):
    """The recorder cannot be reached, or refused a request."""


class ClusterError(EdgeError):
    """A scheduler or its workers cannot be reached, or are not fit for a batch."""


class UsageError(EdgeError):
    """The command line asks for something that makes no sense."""
