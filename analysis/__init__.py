"""Images to knowledge."""

from interchange.blas import choose_kernels

choose_kernels()
