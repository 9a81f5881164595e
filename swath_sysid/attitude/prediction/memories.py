"""How long what is remembered: periods of the motion, each for one thing, and what stands in before it is known."""

USUAL_PERIOD = 3.2  #: s; of a small craft, before its motion is known.
LEAST_SIZE = 1e-4  #: rad and rad/s; a craft that moves less is at rest.

NIS_MEMORY = 0.31  #: Over which the innovations of a state space are averaged.
NOW = 2.0  #: Show what a motion is like now: its amplitude, its activity, its phase.
LIFETIME = 12.0  #: After which all members of the library of seas begin again; half as long after that these take over.
#: After which sizes are forgotten, of errors as of the motion: a shorter one follows wave groups, in which errors grow
#: less than the motion.
MEMORY_OF_SIZE = 19.0
LONGEST_BRIDGED = 19.0  #: A silence over which the motion is followed; after a longer one it is another motion.
NEW_SEA = 19.0  #: In which a new sea shows, alone.
LOOKED_AT = 30.0  #: Of the past, in which the period of the motion is looked for.
HULL_MEMORY = 90.0  #: In which a change of the hull shows while the whole past still hides it.
WELL_LEARNT = 100.0  #: Teach as much of a sea as a longer past.
