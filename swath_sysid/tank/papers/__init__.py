"""The published studies: their printed values as data, their trials simulated, their methods carried out again."""

from swath_sysid.common.wings import handed_in

STUDIES = tuple(handed_in('papers'))  #: Those of the other wing as well.
