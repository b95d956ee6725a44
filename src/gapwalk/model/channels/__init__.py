"""Files of measured data, in the formats of the test bench: channels with names, units and numbers."""
