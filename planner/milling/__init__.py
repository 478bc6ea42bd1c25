"""From the FRFs at the cutter to the cut: tools coupled to a robot, and which cuts are stable."""
