"""Scene to image, right."""

from interchange.blas import choose_kernels

choose_kernels()
