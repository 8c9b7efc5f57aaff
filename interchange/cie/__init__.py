"""Published tables of the CIE, as CSV; README.md says where they are from."""
