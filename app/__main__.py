"""`python -m app`: the command `eigenfairing`."""

from app.cli.main import main

main()
