"""The publications of the findings. A DOI is given only if it was seen."""

from __future__ import annotations

from asperity.studies.literature.finding import Source

SEED = Source(
    "Otaduy & Lin", 2004, "A perceptually-inspired force model for haptic texture rendering"
)
FINGER_AND_PROBE = Source(
    "Klatzky & Lederman", 1999, "Perception & Psychophysics 61, 591-607", "10.3758/BF03205532"
)
SPEED = Source("Lederman, Klatzky, Hamilton & Ramsay", 1999, "Haptics-e")
DIAMETER_AND_FORCE = Source(
    "Lederman, Klatzky, Hamilton & Grindley", 2000, "ASME Dynamic Systems and Control"
)
DROP_POINT = Source(
    "Klatzky, Lederman, Hamilton, Grindley & Swendsen",
    2003,
    "Perception & Psychophysics 65(4), 613-631",
)
STATIC_MODEL = Source(
    "Unger, Hollis & Klatzky",
    2008,
    "The geometric model for perceived roughness applies to virtual textures",
)
BAND_POWER = Source(
    "Unger, Klatzky & Hollis", 2013, "The physical basis of perceived roughness, IEEE ToH"
)
GRATINGS = Source("Lawrence, Kitada, Klatzky & Lederman", 2007, "Perception 36(4), 547-557")
GRIT = Source("Stevens & Harris", 1962, "Journal of Experimental Psychology 64, 489-494")
LOW_RELIEF = Source("Drewing", 2016, "LNCS 9775, 21", "10.1007/978-3-319-42324-1_21")
