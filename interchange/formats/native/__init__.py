"""Decoders of native code, to be called in isolation only; modules of their own, so that they load there once."""
