"""The one error that callers show to users instead of a traceback."""


class InputError(ValueError):
    """What was given cannot be used.

    The message is one sentence that names what was wrong and what to do. The command
    line prints it and exits with code 2; a node counts it and reports a diagnostic.

    Parameters
    ----------
    message : str
    code : str
        Of the `Advice` that it is made of; '': of none.
    """

    def __init__(self, message: str = '', code: str = '') -> None:
        super().__init__(message)
        self.code = code
