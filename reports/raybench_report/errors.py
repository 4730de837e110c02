"""What all parts throw; it imports nothing, since `raybench advise` shall start at once."""


class RunError(Exception):
    """Wrong input, such as a directory that holds no run: one line that says what is wrong."""
