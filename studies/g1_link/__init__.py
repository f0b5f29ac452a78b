"""The study of G1 behind a link: what another program, or a motor, does to its balance."""
