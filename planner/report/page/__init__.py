"""The report of a campaign as one HTML file."""
