"""The blind benchmark of the diagnosis: cases made by an engine, a lens and a sensor that share no line with it."""
