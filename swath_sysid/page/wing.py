"""What the wing of the page hands in to the core."""

from swath_sysid.common.wings import Wing

WING = Wing(name='page', order=4, other_nodes=('page',), runs_beside='page.cli.beside pages_beside')
