"""What may be wrong, a number each and the DN that a unit of it adds: tolerances, effects, families without a name."""
