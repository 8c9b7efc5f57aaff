"""From irradiance to the DN that a sensor is expected to give: what simulations and captures are compared in."""
