"""Example plans of one's own: each file works with `eigenfairing view SCENE --with FILE` as it is."""
