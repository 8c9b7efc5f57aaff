"""Light as it is rendered, lamp by lamp and once: what captures are simulated from."""
