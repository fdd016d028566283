"""Fuzzing of everything that reads, and of detection and whole scenes against what they promise (``make fuzz``)."""
