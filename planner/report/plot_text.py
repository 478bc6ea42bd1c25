"""Text of the user's in pictures."""


def plain_text(text: str) -> str:
    """A name as it stands: Matplotlib would read what lies between two dollars as a formula."""
    return text.replace("$", r"\$")
