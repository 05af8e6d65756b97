"""An example of a plugin: one module for each kind of thing that a package can add to EigenFairing."""
