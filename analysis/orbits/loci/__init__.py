"""Curves of special points over two parameters: equations.md 4.5 to 4.7, 4.19, 4.20. `follower` is the way in."""
