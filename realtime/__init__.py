"""Scene to image, now."""

from interchange.blas import choose_kernels

choose_kernels()
