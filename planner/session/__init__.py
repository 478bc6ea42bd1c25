"""The interactive session beside the robot: propose, wait for the analyser, import, refit."""
