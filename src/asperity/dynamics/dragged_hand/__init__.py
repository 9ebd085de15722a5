"""The 1-D hand of Otaduy & Lin (2004, Eq. 7): a mass dragged by a spring and damper."""
