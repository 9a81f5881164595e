"""What is called chance, and how sure a stated interval is."""

TWO_STD = 2.0  #: Standard deviations within which chance stays in 95 % of cases: the coverage factor k.
SIGNIFICANT = 4.0  #: Standard deviations beyond which a difference is not chance.
UNCERTAIN = 0.5  #: A standard deviation beyond this share of a value makes it uncertain.
CONFIDENCE = 0.95  #: Of the intervals that are stated.
