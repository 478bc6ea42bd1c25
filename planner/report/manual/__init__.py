"""The manual as one HTML file: a tutorial, the files, the commands, the numbers."""
