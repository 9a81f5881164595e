"""What the pages that repeat a published study share, of tanks and of manoeuvring."""

#: Particulars of a craft, by the keys of a manifest.
PARTICULARS = {
    'length_m': 'length [m]',
    'beam_m': 'breadth [m]',
    'depth_m': 'depth [m]',
    'draft_m': 'draft [m]',
    'displacement_kg': 'displacement [kg]',
    'kg_m': 'KG [m]',
    'gm_transverse_m': 'GM transverse [m]',
    'gm_longitudinal_m': 'GM longitudinal [m]',
    'gyradius_m': 'radius of gyration [m]',
    'inertia_kg_m2': 'inertia with added inertia [kg m^2]',
    'water_density_kg_m3': 'water density [kg/m^3]',
    'water_temperature_c': 'water temperature [deg C]',
    'appendages': 'appendages',
    'basin': 'basin',
}

BY_CONSTRUCTION = 'by construction'  #: What a simulation has been given and therefore shows.


def citation(paper: str, authors: str | None) -> str:
    """Authors and title of a paper, or what is known of them."""
    return f'{authors}: {paper}.' if authors else f'{paper}; its authors and exact title are not known.'


def verdict_mark(verdict: str) -> str:
    """How a verdict on a conclusion is marked."""
    return 'best' if verdict.startswith('yes') else 'beyond' if verdict.startswith(('no', 'in ')) else ''
