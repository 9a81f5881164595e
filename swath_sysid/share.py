"""Where the package's own configuration, layouts and launch files are, however it was installed."""

from pathlib import Path

from swath_sysid.common.errors import InputError

PACKAGE = 'swath_sysid'


def share_folder(module_file: str | Path = __file__) -> Path:
    """The folder with the records, configuration and launch files of this installation.

    It is the checkout where the package runs from one, else ``share/swath_sysid`` below its prefix.

    Args:
        module_file: A module of the installation.

    Returns:
        The folder that holds ``records/``, ``config/`` and ``launch/``.

    Raises:
        InputError: The installation lacks them.

    Example:
        >>> (share_folder() / 'records' / 'morro_buoy.csv').is_file()
        True
    """
    # ament's index would need a sourced environment, ignores `pip install -e`, and may name another version's folder
    package_folder = Path(module_file).resolve().parent
    checkout = package_folder.parent
    for folder in (checkout, *(parent / 'share' / PACKAGE for parent in package_folder.parents)):
        if (folder / 'package.xml').is_file():
            return folder
    raise InputError(f'{package_folder} lacks its configuration files: install {PACKAGE} with pip or colcon')
