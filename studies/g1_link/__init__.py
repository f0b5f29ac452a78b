"""The study of a G1 behind its link: motors, latency and the gains of its drives."""
