"""Make the documents of the robots that Poise ships: `python -m bundled_robots`."""
