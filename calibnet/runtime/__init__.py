"""What every part of the package needs of the machine: clock, precision, interruption, whole files."""
