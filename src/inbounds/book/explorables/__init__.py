"""Explorables: figures with sliders that work in a static page, without a server or a network.

One module each, NAME.py beside NAME.js; its function is ready to be the last line of a notebook cell::

    from inbounds.book.explorables.bounded_densities import bounded_densities

    bounded_densities()

The mathematics runs in the reader's browser and is tested against this package; how an explorable reaches the page
is told in `frame`.
"""
