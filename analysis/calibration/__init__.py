"""Camera calibration: pictures of a board in, cameras with what is known and not known about them out."""
