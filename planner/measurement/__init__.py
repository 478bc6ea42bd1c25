"""What a measurement is: FRFs on lines, and how hits, chain, readback and records err."""
