"""What `python -m benchmarks` takes: a command for each benchmark, with options of its own."""
