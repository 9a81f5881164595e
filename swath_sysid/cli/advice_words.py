"""What the command line adds to the advice of the core: its flags, by the code of the advice."""

FLAGS = {
    'late-start': '--start',
    'disturbed-tail': '--end',
    'several-decays': '--start and --end',
    'forced-motion': '--start and --end',
    'no-decay': '--start and --end',
    'poor-fit': '--start and --end',
    'sea-not-fitted': '--start and --end',
}


def worded(code: str, message: str) -> str:
    """A sentence of the core with the flags that do what it advises.

    Parameters
    ----------
    code : str
        Of an `Advice` or `InputError`.
    message : str
        The neutral sentence.

    Returns
    -------
    str
    """
    return f'{message} ({FLAGS[code]})' if code in FLAGS else message
