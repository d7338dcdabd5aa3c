"""The appliance: recorder service, session files, validation, and the `mapforest` command line."""

__version__ = "0.1.0"
