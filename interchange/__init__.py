"""The shared language: what a scene is, what it means, how it is written."""

from interchange.blas import choose_kernels, choose_threads

choose_kernels()
choose_threads()
