"""Data for training on the disk: out of recordings, Label Studio and iNaturalist, into a model."""
