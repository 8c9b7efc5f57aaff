"""The person's desk: command line, demo, and the window."""

from interchange.blas import choose_kernels

choose_kernels()
