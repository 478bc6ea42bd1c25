"""What several tests share: robots, problems, recordings, and ways to drive the program."""
