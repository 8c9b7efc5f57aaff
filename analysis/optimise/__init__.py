"""The best set-up: camera, lens, lamps and exposure searched under mechanical limits, against what inspection needs."""
