"""What is looked for before and beside the linear effects, one screen a file."""
