"""The study to choose from: robots, algorithm, families, endpoint and start, in the reader's browser.

`choices` writes what every choice shows, `element` puts it on a page, `explorer.js` draws it. Nothing is computed in
the browser but places of points: each number and each verdict is written here, by the functions that make the static
pages.

`assets` has every element's scripts and style; `page.js` is what the scripts share.

`claims` lists the claims of the source thesis, to choose from by verdict and subject.

`picked_seeds` is another: tick a few seeds a side and see what you would have published. It computes, in
`picked_seeds.js`, and is tested against Python.
"""
