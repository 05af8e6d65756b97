"""`python -m app`: the command `eigenfairing`."""

from app.cli import main

main()
