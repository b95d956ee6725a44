"""Reproduces C. Padmanabhan and R. Singh (1995), on the public API of gapwalk alone.

"Dynamics of a piecewise non-linear system subject to dual harmonic excitation using parametric continuation", Journal
of Sound and Vibration 184(5), 767-799. Every figure is drawn again, and every statement about the figures is checked.

`jobs` lists the studies, `panels` and `figures` what is drawn of their results, `claims` what the paper says of them;
`quantities` is what both look at. `report` computes and draws, `page` writes, and ``python -m`` is the command::

    python -m reproductions.padmanabhan_singh_1995           # all figures and claims: out/paper/index.html
    python -m reproductions.padmanabhan_singh_1995 13 20a    # some figures
    make paper FIG=13
"""
