"""The page on a record of flips: image-consistent triangulation, flip by flip, forwards and backwards."""
