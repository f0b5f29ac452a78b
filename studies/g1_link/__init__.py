"""The link to a G1: what its checks find."""
