"""Names of the topics on which attitude forecasts are published, live and in bags."""

NEXT_TOPIC = 'forecast/next'
HORIZON_TOPIC = 'forecast/horizon'
QUIESCENCE_TOPIC = 'forecast/quiescence'


def lead_topic(lead):
    """Topic of the forecasts at one lead: 0.5 s is on ``forecast/lead_0_5s``.

    Parameters
    ----------
    lead : float
        s.
    """
    return f'forecast/lead_{str(float(lead)).replace(".", "_")}s'
