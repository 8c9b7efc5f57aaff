"""The gap between captures and simulation: where it is, what causes it, and how far it shrinks.

Its packages stand on one another, in this order (import-linter keeps it so):

    sensor      from irradiance to the DN that a sensor is expected to give
    light       light as it is rendered, lamp by lamp and once
    compared    captures put together, each condition as the model stands
    noise       effects that move no mean image
    terms       what may be wrong, a number each, and the DN that a unit of it adds
    evidence    which causes there are: marginal likelihoods and priors
    search      where they stand
    measures    how large the gap is, where it lies, how far it shrinks
    judgement   what is called, on captures that nothing was fitted to
    processed   what cameras and files did to captures before, told and taken back
    corrected   what was found, written into the scene
    report      the page

``diagnose`` goes through them; ``diagnosis`` is what it returns.
"""
