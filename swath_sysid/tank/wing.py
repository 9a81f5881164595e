"""What the tank wing hands in to the core."""

from swath_sysid.common.wings import Wing

WING = Wing(
    name='tank',
    order=1,
    papers=dict.fromkeys(
        ('swath-pitch', 'swath-roll', 'hydrofoil-pitch', 'swath-usv-pitch'), 'tank.cli.paper repeat_decay_study'
    ),
    tables_of_fit='tank.cli.extinction tables_of',
    trials_shown='tank.campaign.manifest trials_in_words',
)
