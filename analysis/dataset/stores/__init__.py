"""Datasets in Zarr stores: the arrays, the grid of the runs, the overview, and conversion from and to NetCDF."""
