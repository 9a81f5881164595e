"""Where the package's own configuration, layouts and launch files are, however it was installed."""

from pathlib import Path

from swath_sysid.common.errors import InputError

PACKAGE = 'swath_sysid'


def share_folder(module_file: str | Path = __file__) -> Path:
    """The folder that holds package.xml, config/ and launch/ of this very installation.

    Found from the module's own path rather than through ament's index: the index needs a sourced environment,
    ignores ``pip install -e``, and may name another version's folder.

    Args:
        module_file: A module directly inside the package.

    Returns:
        The checkout itself where the package is run from one (``pip install -e``, ``colcon build --symlink-install``),
        otherwise ``share/swath_sysid`` below the prefix that holds the package (pip, colcon, a distribution's package).

    Raises:
        InputError: The package was copied without its share folder.
    """
    package_folder = Path(module_file).resolve().parent
    checkout = package_folder.parent
    for folder in (checkout, *(parent / 'share' / PACKAGE for parent in package_folder.parents)):
        if (folder / 'package.xml').is_file():
            return folder
    raise InputError(f'{package_folder} lacks its configuration files: install {PACKAGE} with pip or colcon')
