"""``swath-sysid paper wam-v``: the published study of a WAM-V."""

import time
from argparse import Namespace
from typing import Any

from swath_sysid.manoeuvring.paper.study import run_manoeuvring_study
from swath_sysid.manoeuvring.report.paper import manoeuvring_page


def repeat_study(_: Namespace) -> tuple[str, dict[str, Any]]:
    """The page of the study, and its data."""
    began = time.perf_counter()
    study = run_manoeuvring_study()
    data = {'derivatives': [vars(derivative) for derivative in study.derivatives]}
    return manoeuvring_page(study, time.perf_counter() - began), data
