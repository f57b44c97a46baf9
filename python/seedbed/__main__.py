"""`python -m seedbed` is the command `seedbed`."""

from seedbed_command import main

main()
