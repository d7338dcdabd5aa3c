"""All sessions of a directory, worked on by the workers of a Dask cluster: process, refine, report."""
