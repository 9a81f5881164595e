"""``swath-sysid compile``: fills the cache of compiled functions, at installation or into an image."""

from argparse import Namespace

from swath_sysid.attitude.identification import refit
from swath_sysid.cli.progress import progress_of
from swath_sysid.common.accelerator import compile_kernels
from swath_sysid.common.errors import DONE
from swath_sysid.common.wings import offered
from swath_sysid.pipeline import forecast_pipeline


def run(arguments: Namespace) -> int:
    """Compile all that the nodes and the other verbs need; returns the exit code."""
    with progress_of('compiling') as progress:
        compile_kernels([forecast_pipeline.warm_up, refit.warm_up, *offered('warm_up')], progress)
    from swath_sysid.common.kernel_cache import cache_folder

    print(f'compiled into {cache_folder()}')
    return DONE
