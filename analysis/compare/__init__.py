"""Two images of one scene, number by number and by what inspection algorithms find in them."""
