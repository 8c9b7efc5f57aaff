"""The rasterisers, one file each."""
