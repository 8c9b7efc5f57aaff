"""Which causes there are: marginal likelihoods, priors, and how far they are to be believed."""
